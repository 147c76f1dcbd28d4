"""NARX models: the structure as asked for, and the same with terms and weights that can be run.

Native side: `narx.rs`, `radial_basis.rs`.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from flightid import _native
from flightid.errors import DataError, ModelError, OptionError, UnitError
from flightid.models.narx.terms import KERNELS, Lag, Term, width_to_beta
from flightid.record import Record

STOPS = ("press", "sse", "err", "terms", "aic", "aicc", "bic")
CANDIDATES = ("data", "kmeans", "grid")
REGULARISATIONS = ("none", "uniform", "local")


@dataclass(frozen=True)
class NarxModel:
    """Structure of y(t) = f(y(t-1) … y(t-n_y), u(t-d) … u(t-d-n_u+1)) for `identify`.

    Every channel is scaled to zero mean and unit deviation (N - 1) over the training records; the
    scaling stays in the fit. Constant and linear terms are always kept; the others are chosen.

    Attributes
    ----------
    output : str
    inputs : tuple of str
    output_lags, input_lags : int
        n_y, and n_u of each input.
    delay : int
        Smallest lag d of the inputs; 0 for a direct path.
    kernel : str or None
        ``"gaussian"`` exp(-d²/β²), ``"multiquadric"`` √(d²+β²), ``"inverse_multiquadric"``,
        ``"thin_plate"`` d² ln d (no width), or None for no radial functions.
    width, width_convention : float, str
        Width in deviations: ``"beta"``, ``"matlab_spread"`` (β = spread/0.8326) or ``"sigma"``
        (β = √2 σ).
    candidates : str
        Centres to choose from: ``"data"`` every training sample, ``"kmeans"`` or ``"grid"``.
    n_candidates : int
        Clusters, or levels of the grid along each regressor.
    seed : int
        Of the clusters.
    constant, linear : bool
        Whether these terms are in the model.
    degree : int
        Largest total power of the products to choose from; below 2 there are none.
    stop : str
        ``"press"`` (smallest leave-one-out error), ``"sse"`` or ``"err"`` with `goal` (of the
        scaled output), ``"aic"``, ``"aicc"``, ``"bic"``, or ``"terms"``.
    goal : float
        Sum of squared errors or error-reduction ratio that ends the selection.
    maximum_terms : int
        Most terms, constant and linear ones included.
    regularisation : str
        ``"none"``, ``"uniform"`` (one `penalty` for all chosen terms) or ``"local"``: a penalty of
        its own for each chosen term, from the evidence for it; terms without evidence go. Constant
        and linear terms are not penalised.
    penalty : float
        λ of the squared coefficient of a term's part that is orthogonal to the terms before it;
        for ``"local"`` that of the first choice.
    held_back : float
        Share of each record, at its end, that takes no part in the choice of terms: weights and
        their standard errors come from it alone, so that the errors hold in spite of the choice
        (in white noise). 0: choice and weights share all samples.
    guard : float
        Predictions are held inside the middle of the training outputs ± guard times half their
        range, and flagged.

    Raises
    ------
    OptionError
        A value outside its range.

    Example
    -------
    >>> NarxModel("theta", ("voltage",), 4, 4, width=2.0, width_convention="sigma")
    NarxModel('theta' from voltage, 4 + 4 lags, gaussian β = 2.828 (sigma 2), stop press)
    """

    output: str
    inputs: tuple[str, ...]
    output_lags: int
    input_lags: int
    delay: int = 1
    kernel: str | None = "gaussian"
    width: float = 5.0
    width_convention: str = "beta"
    candidates: str = "data"
    n_candidates: int = 100
    seed: int = 0
    constant: bool = True
    linear: bool = True
    degree: int = 1
    stop: str = "press"
    goal: float = 0.0
    maximum_terms: int = 30
    regularisation: str = "none"
    penalty: float = 0.0
    held_back: float = 0.0
    guard: float = 3.0

    def __post_init__(self) -> None:
        object.__setattr__(self, "inputs", tuple(self.inputs))
        least = {"input_lags": 0, "output_lags": 0, "delay": 0, "degree": 1, "maximum_terms": 1}
        for name, low in {**least, "n_candidates": 1}.items():
            if getattr(self, name) < low:
                raise OptionError(f"{name} is too small", found=getattr(self, name), needed=low)
        choices = {
            "stop": STOPS,
            "candidates": CANDIDATES,
            "kernel": (*KERNELS, None),
            "regularisation": REGULARISATIONS,
        }
        for name, allowed in choices.items():
            if getattr(self, name) not in allowed:
                needed = ", ".join(map(str, allowed))
                raise OptionError(f"unknown {name}", found=getattr(self, name), needed=needed)
        if not self.lags:
            raise OptionError("a NARX model has no lags", needed="output_lags or input_lags")
        if len({self.output, *self.inputs}) != 1 + len(self.inputs):
            raise OptionError("a channel is named twice", found=(self.output, *self.inputs))
        if not (math.isfinite(self.guard) and self.guard >= 1):
            raise OptionError("guard cuts training data", found=self.guard, needed="1 or more")
        if self.stop in ("sse", "err") and not self.goal > 0:
            raise OptionError(f"stop {self.stop!r} has no goal", found=self.goal, needed="above 0")
        width_to_beta(self.width, self.width_convention)
        self._check_penalties()

    def _check_penalties(self) -> None:
        penalty, kind = self.penalty, self.regularisation
        if not (math.isfinite(penalty) and penalty >= 0):
            raise OptionError("a penalty is negative", found=penalty, needed="0 or more")
        if (kind == "uniform") is not (penalty > 0) and kind != "local":
            raise OptionError(
                "penalty and regularisation disagree",
                found=f"regularisation={kind!r}, penalty={penalty}",
                needed="a penalty above 0 for 'uniform', none for 'none'",
            )
        if not 0 <= self.held_back < 1:
            raise OptionError(
                "held_back is no share", found=self.held_back, needed="0 to below 1, such as 0.5"
            )
        if self.held_back and kind != "none":
            raise OptionError(
                "penalised weights have no standard errors to hold samples back for",
                found=f"regularisation={kind!r}, held_back={self.held_back}",
                needed="one of the two",
            )

    @property
    def beta(self) -> float:
        """Width β, deviations."""
        return width_to_beta(self.width, self.width_convention)

    @property
    def lags(self) -> tuple[Lag, ...]:
        """The regressor vector: lags of the output, then of each input."""
        outputs = [Lag(self.output, lag) for lag in range(1, self.output_lags + 1)]
        span = range(self.delay, self.delay + self.input_lags)
        return (*outputs, *(Lag(name, lag) for name in self.inputs for lag in span))

    def __repr__(self) -> str:
        """Structure on one line, the width in β and as it was given."""
        kernel = "no radial terms" if self.kernel is None else f"{self.kernel}"
        if self.kernel not in (None, "thin_plate"):
            kernel += f" β = {self.beta:.4g} ({self.width_convention} {self.width:.4g})"
        lags = f"{self.output_lags} + {self.input_lags} lags"
        return (
            f"NarxModel({self.output!r} from {', '.join(self.inputs)}, {lags}, {kernel}, "
            f"stop {self.stop})"
        )


@dataclass(frozen=True)
class Scaling:
    """Means and deviations (N - 1) of the training records by channel, and their units.

    `output_range` holds the smallest and largest training output, in deviations.
    """

    mean: dict[str, float]
    deviation: dict[str, float]
    units: dict[str, str]
    sample_time_s: float
    output_range: tuple[float, float]

    def scaled(self, record: Record, name: str) -> NDArray[np.float64]:
        """Samples of a channel in deviations about the training mean, after checks."""
        if record.unit(name) != self.units[name]:
            raise UnitError(
                f"channel {name!r} has another unit than in training",
                found=record.unit(name),
                needed=self.units[name],
                action="convert it with Record.to_units",
            )
        if abs(record.sample_time_s / self.sample_time_s - 1.0) > 1e-6:
            raise DataError(
                "the record has another sample time than the model's training records",
                found=f"{record.sample_time_s:.6g} s",
                needed=f"{self.sample_time_s:.6g} s",
                action="resample it with conditioning.resample",
            )
        return np.ascontiguousarray((record[name] - self.mean[name]) / self.deviation[name])


@dataclass(frozen=True)
class NarxPrediction:
    """Output of a NARX model on a record.

    Attributes
    ----------
    measured, predicted : ndarray, shape (n_samples,)
        In the output's unit; the first `start` predictions are the measured values.
    horizon : int or str
        Samples ahead, or ``"free_run"``.
    start : int
        Samples that initialise the lags: no score counts them.
    diverged_at : int or None
        First sample at which the guard held the prediction.
    """

    measured: NDArray[np.float64]
    predicted: NDArray[np.float64]
    horizon: int | str
    start: int
    diverged_at: int | None

    @property
    def scored(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Measured and predicted samples after the start, for `flightid.validation`."""
        return self.measured[self.start :], self.predicted[self.start :]

    @property
    def error_rms(self) -> float:
        """Root mean square error after the start, in the output's unit."""
        measured, predicted = self.scored
        return float(np.sqrt(np.mean((measured - predicted) ** 2)))

    def __repr__(self) -> str:
        """Horizon, size and error on one line."""
        ahead = "free run" if self.horizon == "free_run" else f"{self.horizon} ahead"
        left = "" if self.diverged_at is None else f", held from sample {self.diverged_at}"
        return (
            f"NarxPrediction({ahead}, {self.measured.size} samples, rms {self.error_rms:.4g}{left})"
        )


@dataclass(frozen=True)
class NarxEquation:
    """A NARX model with its terms, weights (of scaled channels) and scaling: what can be run."""

    model: NarxModel
    terms: tuple[Term, ...]
    weights: tuple[float, ...]
    scaling: Scaling

    def predict(self, record: Record, horizon: int | str = "free_run") -> NarxPrediction:
        """Predict the output one step, k steps or the whole record ahead.

        Parameters
        ----------
        record : Record
            With the model's channels, units and sample time; its first outputs start the lags.
        horizon : int or "free_run"

        Returns
        -------
        NarxPrediction

        Raises
        ------
        OptionError
            A horizon that is neither.
        DataError
            Another sample time, or fewer samples than lags.
        UnitError
            A channel in another unit.
        UnknownNameError
            A channel is missing.
        ModelError
            A term with a lag that the model does not have.
        """
        if horizon != "free_run" and not (isinstance(horizon, int) and horizon > 0):
            raise OptionError("unknown horizon", found=horizon, needed="1, 2, … or 'free_run'")
        model, scaling = self.model, self.scaling
        channels = (model.output, *model.inputs)
        scaled = [scaling.scaled(record, name) for name in channels]
        places = {lag: place for place, lag in enumerate(model.lags)}
        low, high = scaling.output_range
        middle, half = 0.5 * (low + high), 0.5 * model.guard * (high - low)
        radial = [i for i, term in enumerate(self.terms) if term.centre]
        centres = [self.terms[i].centre for i in radial]
        values, start, diverged = _native.run_narx(
            scaled[0],
            np.array(scaled[1:]).reshape(len(model.inputs), record.n_samples),
            [(channels.index(lag.channel), lag.lag) for lag in model.lags],
            self._monomials(places),
            np.array(centres, dtype=np.float64).reshape(len(radial), len(model.lags)),
            np.array([self.weights[i] for i in radial], dtype=np.float64),
            model.kernel or "gaussian",
            model.beta,
            (middle - half, middle + half),
            0 if horizon == "free_run" else int(horizon),
        )
        name = model.output
        predicted = values * scaling.deviation[name] + scaling.mean[name]
        predicted[:start] = record[name][:start]
        return NarxPrediction(record[name], predicted, horizon, start, diverged)

    def _monomials(self, places: dict[Lag, int]) -> list[tuple[float, list[tuple[int, int]]]]:
        found = []
        for term, weight in zip(self.terms, self.weights, strict=True):
            if term.centre:
                continue
            missing = [str(lag) for lag, _ in term.factors if lag not in places]
            if missing:
                raise ModelError("a term has a lag outside the model", found=", ".join(missing))
            found.append((weight, [(places[lag], power) for lag, power in term.factors]))
        return found
