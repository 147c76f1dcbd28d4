"""Search of NARX lags and widths by the error that counts: free run on records not trained on."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import product

import numpy as np

from flightid.conventions import Light
from flightid.errors import FitError, OptionError
from flightid.findings import Finding
from flightid.frozen import dataclass
from flightid.identification.fit import Fit
from flightid.identification.identify import identify
from flightid.identification.prediction.predict import predict
from flightid.models.narx.model import NarxModel
from flightid.models.narx.structure import NarxStructure
from flightid.progress import track
from flightid.record import Record
from flightid.result import Result
from flightid.simulation.metrics import fit_percent, rms_error
from flightid.table import Cell, Column, Table
from flightid.validation.order_scan.edges import Structure, edge_findings


@dataclass(frozen=True)
class FreeRunScore:
    """Free run of one model over the validation records.

    `rms` is in the output's unit; `fit_percent` 100 is perfect; `held` tells that the guard held
    the prediction somewhere.
    """

    rms: float
    fit_percent: float
    held: bool


@dataclass(frozen=True)
class NarxTrial:
    """One structure of a search: its fit (None with the reason where there is none) and scores."""

    structure: NarxStructure
    fit: Fit | None
    score: FreeRunScore | None
    baseline: FreeRunScore | None
    one_step_rms: float | None
    reason: str = ""


@dataclass(frozen=True)
class NarxSearch(Result, schema="flightid.narx_search/1"):
    """Trials in the order of their free-run error on the validation records, the best first.

    Example
    -------
    See `search_narx`:

    >>> NarxSearch.__name__
    'NarxSearch'
    """

    trials: tuple[NarxTrial, ...]
    findings: tuple[Finding, ...]

    @property
    def best(self) -> Fit:
        """The fit with the smallest free-run error."""
        fit = self.trials[0].fit
        if fit is None:
            raise FitError("no structure of the search could be fitted")
        return fit

    def summary(self) -> Table:
        """Table of the trials with the free run of the linear model of the same lags."""
        columns = (
            Column("output lags"),
            Column("input lags"),
            Column("width β"),
            Column("terms"),
            Column("one-step rms"),
            Column("free-run rms"),
            Column("free-run fit", "%"),
            Column("linear free-run rms"),
            Column("beats linear"),
            Column("note"),
        )
        notes = (
            "all errors on validation records; the samples that start the lags are not counted",
            *map(str, self.findings),
        )
        return Table("NARX search", columns, tuple(map(_row, self.trials)), notes)

    def _computed(self) -> dict[str, object]:
        return {
            "trials": self.summary().to_dict(),
            "best": self.best,
        }

    def __repr__(self) -> str:
        """Number of trials and the best one on one line."""
        return f"NarxSearch({len(self.trials)} structures, best {self.best!r})"


def search_narx(
    model: NarxStructure,
    records: Record | Sequence[Record],
    validation: Record | Sequence[Record],
    *,
    lags: Sequence[tuple[int, int]] = (),
    widths: Sequence[float] = (),
) -> NarxSearch:
    """Fit a NARX model with several lags and widths and rank them by free run on unseen records.

    Structures are compared by their own error over each record after the longest lag of the whole
    search, so that all are judged on the same samples.

    Parameters
    ----------
    model : NarxStructure
        What all trials share.
    records, validation : Record or sequence of Record
    lags : sequence of (int, int)
        Pairs (output_lags, input_lags); default: the model's own.
    widths : sequence of float
        In the model's width convention; default: the model's own.

    Returns
    -------
    NarxSearch
        Ranked trials, the linear model of the same lags beside each; a finding where the best
        loses to it or has to be held.

    Raises
    ------
    FitError
        No structure could be fitted.
    OptionError
        A structure outside its range, or no validation record.
    DataError
        Constant channels, too few samples, another sample time.

    Reference
    ---------
    Billings, *Nonlinear System Identification*, Wiley 2013, section 5.5: one-step errors do not
    tell models apart, model predicted outputs do.

    Example
    -------
    >>> import numpy as np
    >>> import flightid as fid
    >>> def fly(seed):
    ...     u = np.random.default_rng(seed).uniform(-1, 1, 200)
    ...     y = np.zeros(200)
    ...     for t in range(2, 200):
    ...         y[t] = 0.8 * np.tanh(y[t - 1]) + 0.5 * u[t - 2]
    ...     return fid.Record.from_arrays(np.arange(200) / 5, inputs={"u": u}, outputs={"y": y})
    >>> search = search_narx(fid.NarxStructure(("u",), "y", 1, 1, maximum_terms=8), fly(0), fly(1),
    ...                      lags=[(1, 1), (1, 2)])
    >>> search.best.structure.input_lags, search.trials[0].baseline.rms > search.trials[0].score.rms
    (2, True)
    """
    unseen = [validation] if isinstance(validation, Record) else list(validation)
    if not unseen:
        raise OptionError("a search has no validation record", needed="at least one")
    pairs = list(lags) or [(model.output_lags, model.input_lags)]
    models = [
        replace(model, output_lags=n_y, input_lags=n_u, width=width)
        for (n_y, n_u), width in product(pairs, list(widths) or [model.width])
    ]
    return search_further(NarxSearch((), ()), models, records, unseen)


def search_further(
    search: NarxSearch,
    models: Sequence[Structure],
    records: Record | Sequence[Record],
    unseen: Sequence[Record],
) -> NarxSearch:
    """A search with further structures, all scored anew over the same samples.

    Parameters
    ----------
    search : NarxSearch
    models : sequence
        Of NARX.
    records : Record or sequence of Record
    unseen : sequence of Record

    Raises
    ------
    FitError
        No structure could be fitted.
    """
    ends: list[tuple[NarxStructure, Fit | None, str]] = [
        (each.structure, each.fit, each.reason) for each in search.trials
    ]
    known = {each for each, *_ in ends}
    new = [each for each in models if isinstance(each, NarxStructure) and each not in known]
    for model in track(new, "NARX lags and widths"):
        try:
            ends.append((model, identify(model, records), ""))
        except FitError as error:
            ends.append((model, None, str(error)))
    start = max(lag.lag for model, *_ in ends for lag in model.lags)
    trials = [_scored(*end, unseen, start) for end in ends]
    if all(trial.fit is None for trial in trials):
        raise FitError(
            "no structure of the search could be fitted",
            found=trials[0].reason,
            action="use fewer lags, longer or richer records",
        )
    trials.sort(key=lambda trial: np.inf if trial.score is None else trial.score.rms)
    tried = [each.structure for each in trials]
    findings = (*_findings(trials[0]), *edge_findings(trials[0].structure, tried))
    return NarxSearch(tuple(trials), findings)


def _scored(
    model: NarxStructure, fit: Fit | None, reason: str, unseen: Sequence[Record], start: int
) -> NarxTrial:
    if fit is None:
        return NarxTrial(model, None, None, None, None, reason)
    one_step = _score(fit.model, unseen, start, 1).rms
    score = _score(fit.model, unseen, start, "free_run")
    return NarxTrial(
        model, fit, score, _score(fit.details.baseline, unseen, start, "free_run"), one_step
    )


def _score(
    model: NarxModel, records: Sequence[Record], start: int, horizon: int | str
) -> FreeRunScore:
    runs = predict(model, list(records), horizon)
    name = model.output
    measured = np.concatenate([run.measured[name][start:] for run in runs])
    predicted = np.concatenate([run.predicted[name][start:] for run in runs])
    return FreeRunScore(
        float(rms_error(measured, predicted)),
        float(fit_percent(measured, predicted)),
        any(run.diverged_at is not None for run in runs),
    )


def _row(trial: NarxTrial) -> tuple[Cell, ...]:
    model = trial.structure
    head = (model.output_lags, model.input_lags, model.beta if model.kernel else None)
    if trial.fit is None or trial.score is None or trial.baseline is None:
        return (*head, None, None, None, None, None, None, trial.reason)
    return (
        *head,
        len(trial.fit.details.chosen),
        trial.one_step_rms,
        trial.score.rms,
        trial.score.fit_percent,
        trial.baseline.rms,
        trial.score.rms < trial.baseline.rms,
        "free run was held by the guard" if trial.score.held else "",
    )


def _findings(best: NarxTrial) -> tuple[Finding, ...]:
    found = []
    if best.score is None or best.baseline is None:
        return ()
    if best.score.held:
        found.append(
            Finding(
                "free-run-unstable",
                Light.RED,
                "the best model left the guarded range in free run on a validation record",
                "use fewer terms, a wider kernel, or training records that cover the manoeuvre",
            )
        )
    if best.score.rms > best.baseline.rms * (1 + 1e-9):
        found.append(
            Finding(
                "loses-to-linear",
                Light.RED,
                f"in free run the best model (rms {best.score.rms:.4g}) is worse than the linear "
                f"model of the same lags (rms {best.baseline.rms:.4g})",
                "use the linear model (best.details.baseline)",
            )
        )
    return tuple(found)
