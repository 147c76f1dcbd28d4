"""Restricted likelihood of drifts beside fast noise: of what none of a fit's numbers reach."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from flightid.uncertainty.slow_half_cycles import HalfCycleSums

Array = NDArray[np.float64]
STEPS, CLOSE, FARTHEST = 30, 1e-4, 2.0
"""Steps of a search, what the last may gain (logarithms of a likelihood), and the largest step of a
variance's logarithm."""
SHORTEST = 0.1
"""Share of a step that is taken whatever it does: rounding may stand in its way."""
NONE = 1e-6
"""Variance of a drift over the fast noise's below which there is none."""
RIDGE = 1e-9
"""Information that every direction has, over that of unit noise: records may be blind to one."""


FAINTEST = 1e-9
"""Fast power left over that expected, below which a fit has taken an output whole: rounding alone
may come out below zero."""


class LikelihoodPoint(NamedTuple):
    """Restricted likelihood, and sums for its derivatives, by output."""

    value: float
    slope: Array
    information: Array
    level: Array


def shapes_of(corners: Sequence[float], n_bins: int, n: int) -> Array:
    """Spectra of drifts of unit variance at slow half cycles, (n_outputs, n_bins)."""
    turn = 2.0 * (1.0 - np.cos(np.pi * np.arange(n_bins) / n))
    poles = 1.0 - np.array(corners)[:, None]
    return np.asarray((1.0 - poles**2) / ((1.0 - poles) ** 2 + poles * turn))


def likeliest(
    parts: Sequence[HalfCycleSums], shapes: Array, free: NDArray[np.bool_], *, tied: bool = False
) -> tuple[LikelihoodPoint, Array, Array]:
    """Likeliest factors of the fast noises and variances of the drifts, by scoring.

    With `tied` drifts that are in one ratio to the fast noises.
    """
    factor, variance = np.ones(len(shapes)), np.zeros(len(shapes))
    fast = np.mean([part.fast.mean(axis=1) for part in parts], axis=0)
    groups = np.array([free * fast]) if tied else np.diag(free * fast)
    factor = weighed(parts, shapes, factor, variance).level
    here = weighed(parts, shapes, factor, variance)
    # The likelihood of a variance has one maximum nearly always: where it falls from zero, at zero.
    moving = groups @ here.slope > 0.0
    if not np.any(moving):
        return here, factor, variance
    ratios = np.zeros(len(groups))
    ratios[moving] = (groups @ here.slope)[moving] / (groups**2 @ here.information)[moving]
    variance = ratios @ groups
    here = weighed(parts, shapes, factor, variance)
    length = 1.0
    for _ in range(STEPS):
        moving &= ratios > NONE
        ratios[~moving] = 0.0
        step, own = np.zeros(len(groups)), ratios[:, None] * groups
        step[moving] = (own @ here.slope)[moving] / (own**2 @ here.information)[moving]
        gain = 0.5 * float(step @ (own @ here.slope))
        step = length * np.clip(step, -FARTHEST, FARTHEST)
        there_factor, there_ratios = factor * here.level**length, ratios * np.exp(step)
        there = weighed(parts, shapes, there_factor, there_ratios @ groups)
        if there.value < here.value - CLOSE and length > SHORTEST:
            length *= 0.5
            continue
        here, factor, ratios, length = there, there_factor, there_ratios, 1.0
        if gain < CLOSE:
            break
    return here, factor, ratios @ groups


def weighed(
    parts: Sequence[HalfCycleSums], shapes: Array, factor: Array, variance: Array
) -> LikelihoodPoint:
    """Restricted likelihood of all records at factors of fast noises and variances of drifts."""
    halves, value = [], 0.0
    total: Array | float = 0.0
    for part in parts:
        levels = factor[:, None] * part.fast + variance[:, None] * shapes
        gram = np.einsum("oij,o->ij", part.high, 1.0 / factor)
        flat = part.low.reshape(-1, part.low.shape[2])
        gram += flat.T @ (flat / levels.reshape(-1, 1))
        m = part.n_own
        lower = np.linalg.cholesky(gram[:m, :m])
        gone = np.linalg.solve(lower, gram[:m, m:])
        total = total + gram[m:, m:] - gone.T @ gone
        value -= float(np.sum(np.log(levels)) + part.n_high * np.sum(np.log(factor)))
        value -= 2.0 * float(np.sum(np.log(np.diag(lower))))
        halves.append((part, levels, lower, np.linalg.solve(lower.T, gone)))
    whole = np.asarray(total)
    shared = whole[:-1, :-1] + RIDGE * np.eye(len(whole) - 1) * np.mean(1.0 / factor)
    below = np.linalg.cholesky(shared)
    moved = np.linalg.solve(below, whole[:-1, -1])
    value -= 2.0 * float(np.sum(np.log(np.diag(below)))) + float(whole[-1, -1] - moved @ moved)
    spread = np.linalg.inv(below)
    estimate = spread.T @ moved
    sums = np.zeros((4, len(shapes)))
    for part, levels, lower, through in halves:
        sums += _derivatives(
            part, levels, (np.linalg.inv(lower), through), (spread, estimate), shapes, factor
        )
    slope, information, seen, expected = sums
    known = expected > 0.0
    level = np.where(known, seen, 1.0) / np.where(known, expected, 1.0)
    return LikelihoodPoint(0.5 * value, 0.5 * slope, 0.5 * information, np.fmax(level, FAINTEST))


def _derivatives(
    part: HalfCycleSums,
    levels: Array,
    own: tuple[Array, Array],
    shared: tuple[Array, Array],
    shapes: Array,
    factor: Array,
) -> Array:
    """By output: slope and information by the drift's variance; seen and expected fast power."""
    (back, through), (spread, estimate) = own, shared
    m = part.n_own
    # Columns whose squares are what the fit takes of each half cycle, and what is left of it.
    turn = np.zeros((part.low.shape[2], m + len(estimate) + 1))
    turn[:m, :m] = back.T
    turn[:m, m:-1], turn[m:-1, m:-1] = -through[:, :-1] @ spread.T, spread.T
    turn[:m, -1] = through[:, :-1] @ estimate - through[:, -1]
    turn[m:-1, -1], turn[-1, -1] = -estimate, 1.0
    turned = part.low @ turn
    kept = turned[:, :, :-1] / levels[:, :, None]
    left = 1.0 / levels - np.sum(kept**2, axis=2)
    error = (turned[:, :, -1] / levels) ** 2
    over = np.sum(turn * (part.high @ turn), axis=1) / factor[:, None] ** 2
    seen = np.sum(part.fast * error, axis=1) + over[:, -1]
    fast = np.sum(part.fast * left, axis=1) + part.n_high / factor - np.sum(over[:, :-1], axis=1)
    slope = np.sum(shapes * (error - left), axis=1)
    # Half cycles apart meet in what the fit takes.
    met = np.einsum("obk,ok->ob", (kept @ kept.swapaxes(1, 2)) ** 2, shapes)
    information = np.sum(shapes * (met + shapes * (left**2 - np.sum(kept**2, axis=2) ** 2)), axis=1)
    return np.array([slope, information, seen, fast])
