"""Drift that a fit has bent out of sight: its power by restricted likelihood.

A parameter of a mode as slow as the record follows a sensor's drift, and so do free starts and
levels: what is left in the slowest half cycles is a fraction of what was there, in which no test
sees a drift. The likelihood of what a fit cannot follow counts the share that it took of each half
cycle.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
import scipy
from numpy.typing import NDArray

from flightid.uncertainty.fitted_directions import FittedDirections
from flightid.uncertainty.residual_noise import Autoregression
from flightid.uncertainty.restricted_likelihood import (
    RIDGE,
    LikelihoodPoint,
    likeliest,
    shapes_of,
    weighed,
)
from flightid.uncertainty.slow_drift import Drift
from flightid.uncertainty.slow_half_cycles import HalfCycleSums, half_cycles, levels_of, slowest

Array = NDArray[np.float64]
HALF_CYCLES = 32
"""Slowest half cycles of a record that a drift is read from."""
SAMPLES_EACH = 4
"""Samples of a record for each of them, at least."""
CORNER = 3.0
"""Of a drift over the inverse of a record's number of samples, rad: about a half cycle. Faster ones
look like walks, and a level knows little of what is slower."""
BENT = 0.1
"""Share of the information of some combination of parameters in these half cycles from which on a
fit may have bent them; below it residuals show what drift there is."""
ADDED = 0.05
"""Share of that combination's variance from which on a drift is carried on."""


class _CornerSearch(NamedTuple):
    """By output: corners of drifts, their spectra, and what is likeliest then."""

    corners: tuple[float, ...]
    shapes: Array
    found: tuple[LikelihoodPoint, Array, Array]


def with_drifts(
    models: Sequence[Autoregression],
    residuals: Sequence[Array],
    taken: Sequence[FittedDirections],
) -> Sequence[Autoregression]:
    """Models of the outputs' noise with the drift that restricted likelihood gives each.

    Parameters
    ----------
    models : sequence of Autoregression
        By output, by what the residuals show.
    residuals : sequence of ndarray, shape (n_outputs, n)
        By record.
    taken : sequence of FittedDirections
        By record, in the residuals' own metric.

    Returns
    -------
    sequence of Autoregression
        The same where a fit bends no slow half cycle, or where the drift adds little. A drift
        knows its degrees of freedom.

    Reference
    ---------
    Patterson & Thompson (1971), Recovery of inter-block information when block sizes are unequal,
    Biometrika 58(3); the walk's cosine transform: Strang (1999), SIAM Review 41(1), DCT-2.

    Example
    -------
    >>> from flightid.uncertainty.residual_noise import noise_models
    >>> random = np.random.default_rng(2)
    >>> walk = np.cumsum(random.standard_normal(400)) / 20.0
    >>> slow = np.linalg.qr(np.vander(np.linspace(-1.0, 1.0, 400), 4))[0]
    >>> noise = random.standard_normal(400) + walk
    >>> left = (noise - slow @ (slow.T @ noise))[None]
    >>> taken = [FittedDirections(np.zeros((1, 400, 0)), slow[None])]
    >>> white = Autoregression(np.array([1.0]), np.empty(0), 400, 1024)
    >>> (found,) = with_drifts([white], [left], taken)
    >>> found.drift is not None
    True
    """
    longest = max(each.shape[1] for each in residuals)
    n_bins = min(HALF_CYCLES, min(each.shape[1] for each in residuals) // SAMPLES_EACH)
    if n_bins < 2 or not taken[0].shared.shape[2] or not all(_sound(each) for each in models):
        return models
    sizes = levels_of(residuals)
    rows = [
        slowest(*each, size, n_bins)
        for each, size in zip(_paired(residuals, taken), sizes, strict=True)
    ]
    if _share(rows, [each.own.shape[2] for each in taken]) < BENT:
        return models
    # A faster drift than these half cycles reach is fast noise here.
    reached = 0.5 * np.pi * n_bins / longest
    beyond = [each.drift is not None and each.drift.corner > reached for each in models]
    fast = [m if far else replace(m, drift=None) for m, far in zip(models, beyond, strict=True)]
    records = list(zip(_paired(residuals, taken), rows, sizes, strict=True))

    def choose(corners: Sequence[float]) -> _CornerSearch:
        shapes = shapes_of(corners, n_bins, longest)
        return _CornerSearch(tuple(corners), shapes, likeliest(parts, shapes, ~np.array(beyond)))

    try:
        parts = [half_cycles(fast, *pair, low, size) for pair, low, size in records]
        best = choose([CORNER / longest] * len(models))
        for o, model in enumerate(models):
            if model.drift is None or beyond[o]:
                continue
            # A drift that showed may be of the corner that it showed with.
            corners = [*best.corners[:o], model.drift.corner, *best.corners[o + 1 :]]
            other = choose(corners)
            best = other if other.found[0].value > best.found[0].value else best
        return _drifting(models, parts, best, beyond)
    except np.linalg.LinAlgError:
        return models


def _drifting(
    models: Sequence[Autoregression],
    parts: Sequence[HalfCycleSums],
    best: _CornerSearch,
    beyond: Sequence[bool],
) -> Sequence[Autoregression]:
    """Models with the drifts of a choice; as they were where these add little."""
    free = ~np.array(beyond)
    end, factor, variance = best.found
    if np.any(variance > 0.0) and np.sum(free) > 1:
        # Where one ratio to the fast noises serves as well, no output is told to be without drift.
        alike = likeliest(parts, best.shapes, free, tied=True)
        if end.value - alike[0].value < np.sum(free) - 1:
            variance = np.maximum(variance, alike[2])
            end = weighed(parts, best.shapes, factor, variance)
    if _adds(parts, factor, variance[:, None] * best.shapes) < ADDED:
        return models
    drifting: list[Autoregression] = []
    for o, model in enumerate(models):
        if beyond[o]:
            drifting.append(model)
            continue
        drift = None
        if variance[o] > 0.0:
            known = 2.0 * float(variance[o] ** 2 * end.information[o])
            drift = Drift(float(variance[o]), best.corners[o], known)
        drifting.append(replace(model, lags=factor[o] * model.lags, drift=drift))
    return drifting


def _sound(model: Autoregression) -> bool:
    return bool(0.0 < float(model.lags[0]) < np.inf)


def _paired(
    residuals: Sequence[Array], taken: Sequence[FittedDirections]
) -> list[tuple[Array, FittedDirections]]:
    return list(zip(residuals, taken, strict=True))


def _share(rows: Sequence[Array], n_own: Sequence[int]) -> float:
    """Largest share of a shared direction's square in slow half cycles, a mean level apart."""
    total = sum(
        np.einsum("obi,obj->ij", low[:, 1:, m:-1], low[:, 1:, m:-1])
        for low, m in zip(rows, n_own, strict=True)
    )
    return float(np.linalg.eigvalsh(total)[-1])


def _adds(parts: Sequence[HalfCycleSums], factor: Array, drifts: Array) -> float:
    """Largest share by which drifts add to the variance of a combination of parameters."""
    count = parts[0].low.shape[2] - 1 - parts[0].n_own
    fast, slow = RIDGE * np.eye(count), np.zeros((count, count))
    for part in parts:
        here = slice(part.n_own, -1)
        rows, levels = part.low[:, :, here], factor[:, None] * part.fast
        slow += np.einsum("obi,ob,obj->ij", rows, drifts, rows)
        fast += np.einsum("obi,ob,obj->ij", rows, levels, rows)
        # Of fast half cycles products are weighed by the inverse of their noise.
        power = factor * np.mean(part.fast, axis=1) ** 2
        fast += np.einsum("oij,o->ij", part.high[:, here, here], power)
    return float(scipy.linalg.eigh(slow, fast, eigvals_only=True)[-1])
