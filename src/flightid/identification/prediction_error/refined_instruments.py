"""Output error in a closed loop by refined instruments."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from flightid.errors import FitError
from flightid.frozen import dataclass
from flightid.identification.prediction_error.coloured_errors import instrumental_covariance
from flightid.identification.prediction_error.linear_regression import regress, require_errors
from flightid.identification.prediction_error.part_blocks import errors_at
from flightid.models.polynomial.structure import PolynomialStructure
from flightid.models.sampled.channels import SampledChannels
from flightid.recursive_filter import filtered
from flightid.uncertainty.coloured_residuals import ResidualCovariance

Array = NDArray[np.float64]
MOST_STEPS, SETTLED = 50, 1e-7
"""Steps of the search, and the step relative to the coefficients that ends it."""
NOISE_LAGS, ROWS_PER_LAG = 24, 20
DECAYED, MOST_SKIPPED = 0.01, 0.25
"""What is left of the slowest mode of the slopes' start where rows begin to count, and most of a
record that this may take."""


@dataclass(frozen=True)
class RefinedEstimate:
    """Coefficients, their covariance, steps taken and samples of each record before rows count."""

    theta: Array
    known: ResidualCovariance
    steps: int
    skip: int


def refined_instruments(
    structure: PolynomialStructure, data: SampledChannels, moved: Array, theta: Array
) -> RefinedEstimate:
    """Coefficients at which what is left goes with no slope of the model by the excitations.

    The slopes of B/F u by its coefficients, of what the excitations move of the inputs, are the
    instruments; those of the measured inputs the regressors; both and what is left are whitened by
    a long noise model of it. The noise, which the loop feeds to the inputs, is in neither
    instruments nor, but for itself, in what is left.

    Parameters
    ----------
    structure : PolynomialStructure
        Output error.
    data : SampledChannels
    moved : ndarray, shape (n_inputs, n_samples)
        What the excitations alone move of the inputs.
    theta : ndarray, shape (n,)
        Where the search begins: consistent, such as the fit to `moved`.

    Raises
    ------
    FitError
        The search does not settle.

    Reference
    ---------
    Gilson & Van den Hof, Automatica 41 (2005), 241-249; Young, *Recursive Estimation and
    Time-Series Analysis*, 2nd ed. (2011), chapters 7 and 9.
    """
    if theta.size != sum(structure.nb) + sum(structure.nf):
        raise FitError(
            "refined instruments fit each input a denominator of its own",
            found=f"denominators={structure.denominators!r}",
            action="give denominators='separate'",
        )
    skip = _settling(structure, theta, min(data.lengths))
    for step in range(1, MOST_STEPS + 1):
        parts = _equations(structure, data, moved, theta, skip)
        instruments, regressors, left = (np.concatenate(rows) for rows in parts)
        require_errors(left.size, theta.size)
        solved = np.linalg.solve(instruments.T @ regressors, instruments.T @ left)
        change = np.asarray(solved, dtype=np.float64)
        theta = _stable_step(structure, theta, change)
        if np.linalg.norm(change) <= SETTLED * np.linalg.norm(theta):
            parts = _equations(structure, data, moved, theta, skip)
            return RefinedEstimate(theta, instrumental_covariance(*parts), step, skip)
    raise FitError(
        "refined instruments do not settle",
        found=f"{MOST_STEPS} steps",
        needed=f"a step below {SETTLED:g} of the coefficients",
        action="lower the orders, use a richer excitation, or fit ARX by iv4",
    )


def _equations(
    structure: PolynomialStructure,
    data: SampledChannels,
    moved: Array,
    theta: Array,
    skip: int,
) -> tuple[list[Array], list[Array], list[Array]]:
    """Instruments, regressors and what is left by record, whitened, about their means."""
    left = errors_at(structure, data, [], theta)
    whitener = _whitener(left, data, skip)
    made: tuple[list[Array], list[Array], list[Array]] = ([], [], [])
    for span in data.spans:
        rows = (
            _slopes(structure, moved[:, span], theta),
            _slopes(structure, data.inputs[:, span], theta),
            left[None, span],
        )
        for kept, several in zip(made, rows, strict=True):
            white = np.array([filtered(whitener, np.ones(1), row)[skip:] for row in several])
            kept.append((white - white.mean(axis=1, keepdims=True)).T if data.levels else white.T)
    return made[0], made[1], [each[:, 0] for each in made[2]]


def _whitener(left: Array, data: SampledChannels, skip: int) -> Array:
    """Long noise model of what is left after the first samples of each record."""
    kept = [left[span][skip:] for span in data.spans]
    lengths = tuple(row.size for row in kept)
    degree = max(1, min(NOISE_LAGS, sum(lengths) // ROWS_PER_LAG, min(lengths) // 4))
    row = np.concatenate(kept)
    none = np.empty((0, row.size))
    noise = regress(row, none, lengths, degree, [], [], levels=data.levels).shortest
    return np.concatenate([[1.0], noise])


def _parts(structure: PolynomialStructure, theta: Array) -> list[tuple[int, Array, Array]]:
    """Delay, B and F of each input."""
    n = sum(structure.nb)
    above = np.split(theta[:n], np.cumsum(structure.nb)[:-1])
    below = np.split(theta[n:], np.cumsum(structure.nf)[:-1])
    return [
        (k, b, np.concatenate([[1.0], f]))
        for k, b, f in zip(structure.nk, above, below, strict=True)
    ]


def _slopes(structure: PolynomialStructure, inputs: Array, theta: Array) -> Array:
    """Derivatives of Σ B/F u by the coefficients, from rest, shape (n_coefficients, n_samples)."""
    by_above, by_below = [], []
    for row, (delay, b, f) in zip(inputs, _parts(structure, theta), strict=True):
        through = filtered(np.ones(1), f, row)
        run = filtered(-np.concatenate([np.zeros(delay), b]), f, through)
        by_above += [_later(through, delay + k) for k in range(b.size)]
        by_below += [_later(run, k) for k in range(1, f.size)]
    return np.array([*by_above, *by_below])


def _later(row: Array, lag: int) -> Array:
    return np.concatenate([np.zeros(lag), row[: row.size - lag]])


def _reach(structure: PolynomialStructure, theta: Array) -> float:
    roots = [np.abs(np.roots(f)) for _, _, f in _parts(structure, theta)]
    return float(np.max(np.concatenate(roots), initial=0.0))


def _settling(structure: PolynomialStructure, theta: Array, shortest: int) -> int:
    """Samples until what was before a record has left the slopes."""
    reach = min(_reach(structure, theta), 1.0 - 1e-9)
    samples = np.log(DECAYED) / np.log(reach) if reach > 0.0 else 0.0
    return min(structure.longest_lag + int(samples), int(MOST_SKIPPED * shortest))


def _stable_step(structure: PolynomialStructure, theta: Array, change: Array) -> Array:
    """The step, halved while it leaves the stable models."""
    while _reach(structure, theta + change) >= 1.0 and np.linalg.norm(change) > 0.0:
        change = 0.5 * change
    return theta + change
