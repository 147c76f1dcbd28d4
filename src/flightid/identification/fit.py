"""The fit: a model with estimates, how well each is known, and where it all comes from."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import field
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from flightid.evidence import Evidence
from flightid.findings import Finding
from flightid.frozen import dataclass
from flightid.identification.details import Details
from flightid.identification.fitted_record import FittedRecord
from flightid.identification.fitted_response import FittedResponse
from flightid.identification.held_stable import held_stable
from flightid.identification.local_minimum import LocalMinimum
from flightid.identification.model_error import LeftOver, ModelErrorBound, model_errors
from flightid.identification.training import TrainingChannel, training_channels
from flightid.models import EstimateProvenance, Model
from flightid.models.linear.linear_system import LinearSystem
from flightid.record import Record
from flightid.result import Result
from flightid.table import Cell, Column, Table
from flightid.uncertainty.agreement import Agreement
from flightid.uncertainty.estimate import Estimate
from flightid.uncertainty.fitted_correlation import FittedCorrelation
from flightid.uncertainty.quantiles import LEVEL, half_width, interval_words, shown
from flightid.uncertainty.uncertain import Uncertain

GUIDE_BOUND = (
    "Cramér–Rao: Tischler's guide value of the cost (at most 20 %), which knows nothing of noise "
    "and bounds no error; standard errors come from the data's own errors."
)
WHITE_BOUND = (
    "Cramér–Rao: the standard error if residuals were white, in percent of the value; the standard "
    "error beside it allows for their colour."
)

WITHHOLDING = ("errors-not-white", "inputs-in-errors", "excitation-refutes", "order-too-high")
"""Findings that say why a fit has no covariance."""


class _OnDemand:
    """Evidence that is gathered once it is asked for: coherence takes a response of the records."""

    def __get__(self, fit: object, kind: type) -> object:
        if fit is None:
            return self
        kept = vars(fit)
        if not isinstance(kept["evidence"], Evidence):
            kept["evidence"] = kept["evidence"]()
        return kept["evidence"]

    def __set__(self, fit: object, value: Evidence | Callable[[], Evidence]) -> None:
        vars(fit)["evidence"] = value


@dataclass(frozen=True, repr=False, eq=False)
class Fit(
    Result,
    schema="flightid.fit/1",
    untold={
        "prediction_errors": "time histories",
        "input_correlations": "residual_tests tells them",
        "excited": "time histories",
        "left": "model_errors holds them",
        "missed": "findings and reasons tell it",
    },
):
    """Result of `flightid.identify`.

    Attributes
    ----------
    model : Model
        Of any kind, with the estimates.
    parameters : mapping of str to Estimate
        All parameters, in the model's order; coefficients of a black box.
    cost, average_cost : float
        Σ J_l and its average over the responses; guide: average at most 100, below 50 nearly
        indistinguishable. On records: sum and average of the outputs' costs.
    costs : mapping of str to float
        J_l by response. On records, by output: percent of the output's variance that the model
        leaves in `residuals`.
    names : tuple of str
        Parameters of `covariance` and `correlation`: free and not at a bound.
    covariance : ndarray, shape (n, n), or None
        Of the estimates over repeated flights; None where the errors of the data are not known.
    correlation : ndarray, shape (n, n)
        Of the inverse Hessian of the cost; guide: at most 0.98 in size.
    responses : tuple of FittedResponse
    minima : tuple of LocalMinimum
        What the starts found, best first.
    objective : float
        What was minimised: equal to `cost` for ``cost="coherence"``; on records the negative
        logarithm of the likelihood, without its constant; of a black box the sum of squared
        errors, or the determinant of their covariance.
    termination : str
        Why the iteration ended.
    iterations : int
    intervals_from : str
        ``"response covariance"``, ``"random error"`` (approximate), ``"coloured residuals"``,
        ``"white prediction errors"`` or ``"nothing"``.
    findings : tuple of Finding
    provenance : mapping
        Hash of the data, options, version of flightid, seed.
    records : tuple of FittedRecord
        In the time domain: measured and modelled outputs, initial states and biases.
    noise_covariance : ndarray, shape (n_outputs, n_outputs), or None
        R of the residuals, in the time domain.
    prediction_errors : tuple of Record
        Of a black box: errors one step ahead in place of the outputs, without the start.
    residual_horizon : int or str
        Of `residuals`: 1 where a good model leaves them white, else ``"free_run"``.
    structure : Model, PolynomialStructure, SubspaceStructure or NarxStructure
        What was asked.
    method : str
        As `flightid.identify` names it.
    details : Details or None
        What is special to the kind: `PolynomialDetails`, `SubspaceDetails`, `NarxDetails`.
    evidence : Evidence
        What was examined of data and fit, and the light that follows.
    agreement : Agreement or None
        Of records and of their halves, in the order of `names`.
    input_correlations : tuple of FittedCorrelation
        Of inputs with residuals, by what the fit leaves of noise; empty where it is not known.
    excited : tuple of Record
        Behind direct responses: see `LinearEstimate.excited`.
    left : LeftByModel or None
        Behind responses whose estimator's bias is taken out: errors of the structure.
    missed : str
        What the model misses of responses beyond errors of their points; empty where nothing.

    Example
    -------
    >>> import flightid as fid
    >>> omega = [1.0, 2.0, 4.0, 8.0]
    >>> model = fid.load_model("rate_integrator").with_fixed(tau=0.02)
    >>> data = fid.FrequencyResponse.from_values(omega, 2 * model.frequency_response(omega),
    ...     inputs=["tau_phi"], outputs=["p"], units={"p": "rad/s"})
    >>> fit = fid.identify(model, data)
    >>> fit
    Fit('Roll rate, integrator', 1 free of 2 parameters, 1 response, average cost 0.00)
    >>> round(fit.parameters["Ltphi"].value, 6)
    200.0
    """

    model: Any
    parameters: Mapping[str, Estimate]
    cost: float
    average_cost: float
    costs: Mapping[str, float]
    names: tuple[str, ...]
    covariance: NDArray[np.float64] | None
    correlation: NDArray[np.float64]
    responses: tuple[FittedResponse, ...]
    minima: tuple[LocalMinimum, ...]
    objective: float
    termination: str
    iterations: int
    intervals_from: str
    findings: tuple[Finding, ...] = ()
    provenance: Mapping[str, object] = field(default_factory=dict)
    records: tuple[FittedRecord, ...] = ()
    noise_covariance: NDArray[np.float64] | None = None
    prediction_errors: tuple[Record, ...] = ()
    residual_horizon: int | str = "free_run"
    structure: Any = None
    method: str = ""
    details: Any = None
    evidence: Evidence = field(default_factory=Evidence)
    agreement: Agreement | None = None
    input_correlations: tuple[FittedCorrelation, ...] = ()
    excited: tuple[Record, ...] = ()
    left: LeftOver | None = None
    missed: str = ""

    def __getstate__(self) -> dict[str, Any]:
        return {**vars(self), "evidence": self.evidence}

    @property
    def residuals(self) -> tuple[Record, ...]:
        """Errors on the training records in place of their outputs.

        One step ahead for black boxes, without the samples of the start; measured minus model for
        others.
        """
        return self.prediction_errors or tuple(item.residual_record() for item in self.records)

    @property
    def ranked(self) -> tuple[str, ...]:
        """Responses, or outputs on records, from the best fit to the worst."""
        return tuple(sorted(self.costs, key=lambda name: self.costs[name]))

    @property
    def training(self) -> dict[str, TrainingChannel]:
        """Where the training records were, by channel; empty for a fit of responses alone."""
        return training_channels([item.measured for item in self.records])

    @cached_property
    def model_errors(self) -> dict[str, ModelErrorBound]:
        """How far the model lies from its data by frequency, by ``"output/input"``."""
        filtered = self.residual_horizon != "free_run" and not self.prediction_errors
        return model_errors(
            self.model, self.responses, self.records, filtered=filtered, left=self.left
        )

    def linear_system(self) -> LinearSystem:
        """The linear system of the fitted model; ModelError with the reason where there is none."""
        made: LinearSystem = self.model.linear_system()
        return made

    def __repr__(self) -> str:
        """Size, average cost and what the kind adds, on one line."""
        free = sum(p.status in ("free", "at bound", "not seen") for p in self.parameters.values())
        counts = {"response": len(self.responses), "record": len(self.records)}
        seen = [f"{n} {word}{'' if n == 1 else 's'}" for word, n in counts.items() if n]
        unit = "" if self.responses else " %"
        words = "" if self.details is None else f", {self.details.words}"
        return (
            f"Fit({self.model.name!r}, {free} free of {len(self.parameters)} parameters, "
            f"{', '.join(seen)}, average cost {self.average_cost:.2f}{unit}{words})"
        )

    @cached_property
    def estimated(self) -> EstimateProvenance:
        """What is known of the estimates, as a model's file keeps it."""
        return EstimateProvenance(
            self.names,
            self.carried,
            self.method,
            self.intervals_from,
            {each.name: each.band_rad_s for each in self.responses},
            self.evidence.to_dict(),
            self.provenance,
            {name: each.to_dict() for name, each in self.model_errors.items()},
            self.withheld,
        )

    @property
    def withheld(self) -> str:
        """Why there is no covariance, as findings or else the parameters say it; may be empty."""
        if self.carried is not None:
            return ""
        if self.details is not None and self.details.undetermined:
            return str(self.details.undetermined)
        said = [each.message for each in self.findings if each.code in WITHHOLDING]
        # Of a black box only coefficients with intervals are named.
        names = [name for name in self.names or self.parameters if name in self.parameters]
        bare = [self.parameters[name].reason for name in names]
        return "; ".join(dict.fromkeys(said or filter(None, bare)))

    @property
    def carried(self) -> NDArray[np.float64] | None:
        """Covariance as it goes on to other numbers, whose intervals are normal: shape (n, n).

        Where records, or noise that was estimated, tell errors by few degrees of freedom, it is
        larger than `covariance` by what Student's distribution adds to a 95 % interval. None where
        some numbers of the vehicle have no errors: taken for exact they would make what is computed
        look known.
        """
        if self.details is not None and self.details.undetermined:
            return None
        if self.covariance is None:
            return None
        widths = [half_width(LEVEL, self.parameters[name].freedom) for name in self.names]
        share = np.array(widths) / half_width(LEVEL)
        return np.asarray(self.covariance * np.outer(share, share))

    def uncertain(self) -> Uncertain[Model]:
        """The fitted model with the covariance of its parameters, for what is computed from it.

        Parameters at a bound or fixed count as known exactly.

        Example
        -------
        >>> import numpy as np
        >>> import flightid as fid
        >>> truth = fid.load_model("rate_first_order").with_values({"Lp": -5.0, "Ltphi": 150.0})
        >>> omega = np.geomspace(0.5, 20.0, 30)
        >>> data = fid.FrequencyResponse.from_values(
        ...     omega, truth.frequency_response(omega), inputs=truth.inputs, outputs=truth.outputs,
        ...     units=truth.units, random_error=np.full((1, 1, 30), 0.02))
        >>> fid.identify(truth, data).uncertain()
        Uncertain(3 numbers, covariance known)
        """
        return uncertain_model(self.model, self.names, self.carried, self.withheld)

    def summary(self, *, level: float | None = None) -> Table:
        """Table of the parameters, with costs and findings below.

        Parameters
        ----------
        level : float, optional
            Of the intervals.
        """
        level = shown(level)
        words = interval_words(level)
        columns = (
            Column("parameter"),
            Column("value", digits=6),
            Column("unit"),
            Column("standard error", digits=3),
            Column("by noise alone", digits=3),
            Column(f"{words} low", digits=5),
            Column(f"{words} high", digits=5),
            Column("Cramér–Rao", "%", 3),
            Column("insensitivity", "%", 3),
            Column("status"),
            Column("note"),
        )
        alone = self._by_noise_alone()
        quantities = (self.details or Details()).quantities(self.parameters)
        rows = [_row(p, level, alone.get(p.name)) for p in quantities]
        table = Table(f"Fit of {self.model.name}", columns, tuple(rows), self._notes())
        return table.without_empty_columns().said_once()

    def _by_noise_alone(self) -> dict[str, float]:
        """Standard errors without the scatter between parts, where there is any."""
        found = self.agreement
        if found is None or found.by_scatter is None or len(found.by_noise) != len(self.names):
            return {}
        return dict(zip(self.names, map(float, found.by_noise), strict=True))

    def _notes(self) -> tuple[str, ...]:
        ranked = [f"{name} {self.costs[name]:.3g}" for name in self.ranked]
        costs = ", ".join(ranked)
        if len(ranked) > 1:
            costs = f"best {', '.join(ranked[:-1])}, worst {ranked[-1]}"
        meaning = (
            "(guide: at most 100)"
            if self.responses
            else "% of the outputs' variance left unexplained"
        )
        formulas = map(str, self.model.responses if self.responses else ())
        return (
            # Formulas of transfer functions; other responses are named with their costs below.
            *(text for text in formulas if text not in self.model.response_names),
            *(() if self.details is None else self.details.notes(self.structure)),
            f"Average cost {self.average_cost:.3g} {meaning}; {costs}.",
            *self._guides(),
            f"Intervals from: {self.intervals_from}.",
            f"Ended by {self.termination} after {self.iterations} iterations.",
            *map(str, self.findings),
            *self.evidence.lines,
        )

    def _guides(self) -> tuple[str, ...]:
        """What Cramér–Rao bounds stand beside standard errors for, where they do."""
        known = self.parameters.values()
        if not any(p.cramer_rao_percent is not None and p.stderr is not None for p in known):
            return ()
        if not self.responses:
            return (WHITE_BOUND,)
        return (GUIDE_BOUND,)

    def _tables(self) -> tuple[Table, ...]:
        beside = () if self.details is None else self.details.tables()
        return (self.summary(), *beside)

    def _computed(self) -> dict[str, object]:
        return {
            "estimated": self.estimated.to_dict(),
            "structure": repr(self.structure),
            "responses": {each.name: each for each in self.responses},
            "training": self.training,
        }


def _row(p: Estimate, level: float, alone: float | None) -> tuple[Cell, ...]:
    low, high = p.interval(level) or (None, None)
    guides = (p.cramer_rao_percent, p.insensitivity_percent)
    return (p.name, p.value, p.unit, p.stderr, alone, low, high, *guides, p.status, p.reason)


def uncertain_model(
    model: Model, names: Sequence[str], covariance: NDArray[np.float64] | None, reason: str = ""
) -> Uncertain[Model]:
    """A model with the covariance of some of its parameters, inside their bounds; or why not."""
    if covariance is None:
        return Uncertain.exact(model, reason or "the fit knows no errors of its data")
    free = [model.parameters[name] for name in names]
    bounds = np.array([p.minimum for p in free]), np.array([p.maximum for p in free])
    numbers = np.array([p.value for p in free], dtype=np.float64)

    def make(values: NDArray[np.float64]) -> Model:
        return model.with_values(dict(zip(names, map(float, values), strict=True)))

    stable = held_stable(model)
    allowed = None if stable is None else lambda values: stable(make(values))
    return Uncertain(numbers, covariance, make, bounds, allowed=allowed)


Fit.evidence = _OnDemand()  # type: ignore[assignment]
