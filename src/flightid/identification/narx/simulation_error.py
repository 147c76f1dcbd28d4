"""Errors of free runs of a NARX model, with their exact derivatives through the recursion."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import scipy
from numpy.typing import NDArray

from flightid.frozen import dataclass
from flightid.identification.multistart import DenseEnd
from flightid.models.narx.model import NarxModel
from flightid.models.narx.terms import Lag, Term

Array = NDArray[np.float64]
Run = tuple[Array, Array]
"""Scaled output (n_samples,) and inputs (n_inputs, n_samples) of a record."""


@dataclass(frozen=True, eq=False)
class SimulationError:
    """Free runs of a model over scaled records, as a function of its weights, width and centres.

    Attributes
    ----------
    model : NarxModel
        Its terms; its values are the start.
    runs : sequence of tuple of ndarray
        Scaled output and inputs by record, longer than the longest lag.
    centres : bool
        Whether centres move too; the width of radial functions that have one always does.

    Reference
    ---------
    Nelles, *Nonlinear System Identification*, Springer 2001, section 17.5: the gradient of a
    recurrent model solves the recursion that its linearisation along the run makes.
    """

    model: NarxModel
    runs: Sequence[Run]
    centres: bool = False

    @property
    def _radial(self) -> list[int]:
        return [place for place, term in enumerate(self.model.terms) if term.centre]

    @property
    def _has_width(self) -> bool:
        return bool(self._radial) and self.model.structure.kernel != "thin_plate"

    @property
    def start(self) -> Array:
        """Weights, logarithm of the width, centres, as far as they move."""
        centres = [self.model.terms[k].centre for k in self._radial] if self.centres else []
        width = [np.log(self.model.structure.beta)] if self._has_width else []
        return np.concatenate([self.model.weights, width, np.ravel(centres)])

    def at(self, values: Array) -> NarxModel:
        """The model with these values."""
        count = len(self.model.terms)
        structure, terms = self.model.structure, list(self.model.terms)
        rest = values[count:]
        if self._has_width:
            width = float(np.exp(rest[0]))
            structure, rest = replace(structure, width=width, width_convention="beta"), rest[1:]
        if self.centres:
            rows = rest.reshape(len(self._radial), len(structure.lags))
            for place, row in zip(self._radial, rows.tolist(), strict=True):
                terms[place] = replace(terms[place], centre=tuple(row))
        weights = tuple(values[:count].tolist())
        return replace(self.model, structure=structure, terms=tuple(terms), weights=weights)

    def residuals(self, values: Array) -> Array:
        """Simulated minus measured output after the lags; infinite where the guard held a run."""
        if self._has_width and abs(values[len(self.model.terms)]) > LARGEST_LOG_WIDTH:
            return np.full(sum(self.counts), np.inf)
        model = self.at(values)
        found = []
        for (output, inputs), count in zip(self.runs, self.counts, strict=True):
            simulated, start, held = model.run_scaled(inputs, output, 0)
            good = held is None
            found.append(simulated[start:] - output[start:] if good else np.full(count, np.inf))
        return np.concatenate(found)

    @property
    def counts(self) -> list[int]:
        """Samples of each run after the lags."""
        return [output.size - self.model.structure.longest_lag for output, _ in self.runs]

    def jacobian(self, values: Array) -> Array:
        """Derivatives of the residuals, (n_residuals, n_values)."""
        model = self.at(values)
        rows = []
        for output, inputs in self.runs:
            simulated, start, _ = model.run_scaled(inputs, output, 0)
            vectors = lag_vectors(model, simulated, inputs, start)
            direct, slopes = self._derivatives(model, vectors)
            rows.append(_through_recursion(direct, slopes))
        return np.concatenate(rows)

    def _derivatives(self, model: NarxModel, vectors: Array) -> tuple[Array, Array]:
        """Of one step: by values (n_values, n), and by past outputs (n_y, n)."""
        columns = [term_columns(model, vectors)]
        n_y = model.structure.output_lags
        slopes = _product_slopes(model, vectors, n_y)
        beta, kernel = model.structure.beta, model.structure.kernel or "gaussian"
        by_width, by_centre = np.zeros(len(vectors)), []
        for place in self._radial:
            weight, centre = model.weights[place], np.array(model.terms[place].centre)
            away = vectors - centre
            squared = np.sum(away**2, axis=1)
            inner = _by_square(kernel, squared, beta)
            toward = 2.0 * weight * inner[:, None] * away
            slopes += toward[:, :n_y].T
            by_width += weight * _by_log_width(kernel, squared, beta)
            by_centre.append(-toward.T)
        columns += [by_width[None]] if self._has_width else []
        return np.concatenate([*columns, *(by_centre if self.centres else [])]), slopes

    def minimised(self, maximum_iterations: int) -> tuple[NarxModel, float, int, str]:
        """The model of the least sum of squares; that sum, steps and how the search ended."""
        start = self.start
        free = np.full(start.size, np.inf)
        end = DenseEnd.searched(
            self.residuals, self.jacobian, start, -free, free, sum(self.counts), maximum_iterations
        )
        left = self.residuals(end.x)
        return self.at(end.x), float(left @ left), end.iterations, end.termination


LARGEST_LOG_WIDTH = 7.0
"""Widths beyond e^±7 deviations are constants or points."""


def lag_vectors(model: NarxModel, output: Array, inputs: Array, start: int) -> Array:
    """Regressor vectors after the lags, (n_samples − start, n_lags)."""
    rows = {model.output: output, **dict(zip(model.inputs, inputs, strict=True))}
    n = output.size
    lags = model.structure.lags
    return np.array([rows[lag.channel][start - lag.lag : n - lag.lag] for lag in lags]).T


def term_columns(model: NarxModel, vectors: Array) -> Array:
    """Values of the terms, (n_terms, n_samples)."""
    beta, kernel = model.structure.beta, model.structure.kernel or "gaussian"
    places = {lag: place for place, lag in enumerate(model.structure.lags)}
    return np.array(
        [
            _radial_value(kernel, np.sum((vectors - term.centre) ** 2, axis=1), beta)
            if term.centre
            else _product(term, places, vectors)
            for term in model.terms
        ]
    ).reshape(len(model.terms), len(vectors))


def _product(term: Term, places: dict[Lag, int], vectors: Array) -> Array:
    values = np.ones(len(vectors))
    for lag, power in term.factors:
        values *= vectors[:, places[lag]] ** power
    return values


def _product_slopes(model: NarxModel, vectors: Array, n_y: int) -> Array:
    """Σ weight · ∂product/∂y(t − j), (n_y, n_samples)."""
    places: dict[Lag, int] = {lag: place for place, lag in enumerate(model.structure.lags)}
    found = np.zeros((n_y, len(vectors)))
    for term, weight in zip(model.terms, model.weights, strict=True):
        for k, (lag, power) in enumerate(term.factors):
            if places[lag] < n_y:
                rest = tuple(each for i, each in enumerate(term.factors) if i != k)
                reduced = replace(term, factors=(*rest, (lag, power - 1)))
                found[places[lag]] += weight * power * _product(reduced, places, vectors)
    return found


def _radial_value(kernel: str, squared: Array, beta: float) -> Array:
    if kernel == "gaussian":
        return np.asarray(np.exp(-squared / beta**2))
    if kernel == "thin_plate":
        tiny = np.finfo(float).tiny
        return np.asarray(0.5 * squared * np.log(np.maximum(squared, tiny)))
    root = np.sqrt(squared + beta**2)
    return np.asarray(root if kernel == "multiquadric" else 1.0 / root)


def _by_square(kernel: str, squared: Array, beta: float) -> Array:
    """Derivative by the squared distance."""
    value = _radial_value(kernel, squared, beta)
    if kernel == "gaussian":
        return -value / beta**2
    if kernel == "thin_plate":
        return np.asarray(0.5 * (np.log(np.maximum(squared, np.finfo(float).tiny)) + 1.0))
    return np.asarray(0.5 / value if kernel == "multiquadric" else -0.5 * value**3)


def _by_log_width(kernel: str, squared: Array, beta: float) -> Array:
    """β times the derivative by β."""
    inner = _by_square(kernel, squared, beta)
    return -2.0 * squared * inner if kernel == "gaussian" else 2.0 * beta**2 * inner


def _through_recursion(direct: Array, slopes: Array) -> Array:
    """s(t) = direct(t) + Σ slopes_j(t) s(t − j): a banded triangle solved, (n, n_values)."""
    n_y, n = slopes.shape
    if n_y == 0:
        return direct.T
    band = np.zeros((n_y + 1, n))
    band[0] = 1.0
    for j in range(1, n_y + 1):
        band[j, : n - j] = -slopes[j - 1, j:]
    solved, _ = scipy.linalg.lapack.dtbtrs(band, np.asfortranarray(direct.T), uplo="L", diag="U")
    return np.asarray(solved)
