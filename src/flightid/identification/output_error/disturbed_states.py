"""Whether residuals move together as one disturbance of the states would move them.

A gust disturbs few states, and from there goes into every output by the model's own responses. In
the residuals of one output it may hide below the noise; outputs tell it together. Of independent
sensors, whatever their colour, products of different outputs at a frequency average to nothing. So
these alone are weighed, as each disturbance would make them: the locally most powerful test of that
disturbance beside noise of known colour, with products of one output left out.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from flightid.frozen import dataclass
from flightid.identification.output_error.whitened_residuals import (
    LAGS,
    apart,
    colour_filters,
    parts,
    unforetold,
)
from flightid.identification.records.held_model import LinearPoint
from flightid.models import GreyBoxModel, StateSpaceModel
from flightid.recursive_filter import filtered

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]
SMOOTH = 8
"""Frequencies to each side over which a whitened output's power is averaged."""
FEWEST = 100
"""Samples of a record that is looked at."""
MEMORIES_S = (0.3, 2.0)
"""Of gusts, s, beside disturbances without memory."""
FALSE_ALARMS = 0.001
"""Share of records with noise of sensors alone in which a disturbance is named."""
TRIED = 2
"""Disturbances whose chance is worked out: those that stand out most."""
HALVINGS, NEAR = 25, 1e-10
"""Of intervals that hold an exponent; steps so small, over the largest exponent, end the search."""


@dataclass(frozen=True)
class DisturbedSystem:
    """A model at a record's middle, in continuous time.

    Attributes
    ----------
    a : ndarray, shape (n, n)
    c : ndarray, shape (n_outputs, n)
    pushes : ndarray, shape (n, n_ways)
        What each disturbance adds to the state derivatives.
    seen : ndarray, shape (n_outputs, n_ways)
        What outputs feel of it at once.
    ways : tuple of str
        Disturbances in words.
    """

    a: Array
    c: Array
    pushes: Array
    seen: Array
    ways: tuple[str, ...]


@dataclass(frozen=True)
class ShownDisturbance:
    """What stands out most.

    Attributes
    ----------
    way : int
        Column of `DisturbedSystem.pushes`.
    chance : float
        Of independent outputs that stand out as much in any of the ways (Bonferroni).
    """

    way: int
    chance: float

    @property
    def is_found(self) -> bool:
        """Whether sensors alone would hardly do it."""
        return self.chance < FALSE_ALARMS


def disturbances(
    fitted: GreyBoxModel, systems: Sequence[tuple[Array, Array]]
) -> list[DisturbedSystem]:
    """Noise on each state, and a gust on each that equations feel by a parameter.

    Parameters
    ----------
    fitted : GreyBoxModel
    systems : sequence of tuple of ndarray
        A and C of it at each record's middle.
    """
    n, p = systems[0][0].shape[0], systems[0][1].shape[0]
    names = list(fitted.states) if isinstance(fitted, StateSpaceModel) else []
    driven, seen = np.ones((n, n)) if names else np.zeros((n, n)), np.zeros((p, n))
    if isinstance(fitted, StateSpaceModel) and fitted.is_linear:
        point = LinearPoint.of(fitted, fitted.parameters.independent_values())
        driven = 1.0 * np.any(point.a[1:] != 0.0, axis=0)
        seen = 1.0 * np.any(point.c[1:] != 0.0, axis=0)
    felt = np.flatnonzero(np.any(driven, axis=0))
    names = names if len(names) == n else [""] * n
    ways = [*(f"noise on {name}" for name in names), *(f"a gust on {names[k]}" for k in felt)]
    if not any(names):
        ways = ["noise on the states"] * len(ways)
    return [
        DisturbedSystem(
            a,
            c,
            np.hstack([np.eye(n), (a * driven)[:, felt]]),
            np.hstack([np.zeros((p, n)), (c * seen)[:, felt]]),
            tuple(ways),
        )
        for a, c in systems
    ]


def moved_together(
    residuals: Sequence[Array],
    systems: Sequence[DisturbedSystem],
    steps_s: Sequence[float],
    inputs: Sequence[Array] = (),
) -> ShownDisturbance | None:
    """The disturbance that residuals show most, and its chance; None where they tell nothing.

    Parameters
    ----------
    residuals : sequence of ndarray, shape (n_outputs, n_samples)
        Of each record.
    systems : sequence of DisturbedSystem
    steps_s : sequence of float
        Sample time of each record, s.
    inputs : sequence of ndarray, shape (n_inputs, n_samples)
        What neighbouring samples of them foretell is taken out first: a lag, delay or hold that the
        model has wrong moves outputs together too, and is no disturbance.

    Reference
    ---------
    Whittle (1953), Arkiv för Matematik 2, p. 423 (likelihood by frequencies); Rao (1948), Proc.
    Cambridge Philosophical Society 44 (score tests); Daniels (1987), International Statistical
    Review 55 (tails by saddlepoint).
    """
    kept = [k for k, each in enumerate(residuals) if each.shape[1] >= FEWEST + LAGS]
    if not kept or residuals[0].shape[0] < 2:
        return None
    rows = [residuals[k] - residuals[k].mean(axis=1, keepdims=True) for k in kept]
    rows = unforetold(rows, [inputs[k] for k in kept] if inputs else [])
    filters = colour_filters(rows)
    if filters is None:
        return None
    white = [
        np.array([filtered(f, [1.0], row) for f, row in zip(filters, each, strict=True)])[:, LAGS:]
        for each in rows
    ]
    turned = apart(white)
    looked = [
        _LookedAt.of(each, filters, turned, systems[k], steps_s[k])
        for each, k in zip(white, kept, strict=True)
    ]
    n_ways = systems[0].pushes.shape[1]
    every = np.arange(n_ways * (1 + len(MEMORIES_S)))
    score, spread = np.zeros(len(every)), np.zeros(len(every))
    for weights, told in (piece for each in looked for piece in each.pieces(every)):
        size = np.abs(weights) ** 2
        together = np.abs(np.sum(np.conj(weights) * told, axis=1)) ** 2
        score += np.sum(together - np.sum(size * np.abs(told) ** 2, axis=1), axis=-1)
        spread += np.sum(np.sum(size, axis=1) ** 2 - np.sum(size**2, axis=1), axis=-1)
    spread = np.sqrt(spread)
    shown = score / np.where(spread > 0.0, spread, np.inf)
    best = np.argsort(-shown)[:TRIED]
    found = [np.abs(weights) ** 2 for each in looked for weights, _ in each.pieces(best)]
    sizes = np.concatenate(found, axis=-1)
    chances = [_chance(score[way], size) for way, size in zip(best, sizes, strict=True)]
    place = int(np.argmin(chances))
    return ShownDisturbance(int(best[place]) % n_ways, min(len(shown) * chances[place], 1.0))


@dataclass(frozen=True, eq=False)
class _LookedAt:
    """A record's whitened residuals by frequency, `told` (n_outputs, n_omega), and their powers."""

    told: Complex
    power: Array
    omega: Array
    filters: Array
    turned: Array
    system: DisturbedSystem
    step_s: float

    @classmethod
    def of(
        cls,
        white: Array,
        filters: Sequence[Array],
        turned: Array,
        system: DisturbedSystem,
        step_s: float,
    ) -> _LookedAt:
        spectra = turned @ np.fft.rfft(white, axis=1)[:, 1:]
        omega = 2.0 * np.pi * np.arange(1, spectra.shape[1] + 1) / (white.shape[1] * step_s)
        power = _smoothed(np.abs(spectra) ** 2)
        told = spectra / np.sqrt(power)
        return cls(told, power, omega, np.array(filters), turned, system, step_s)

    def pieces(self, ways: NDArray[np.intp]) -> Iterator[tuple[Complex, Complex]]:
        """Weights (n_ways, n_outputs, some omega) of disturbances and memories, and `told`."""
        memory, way = np.divmod(ways, self.system.pushes.shape[1])
        needed, place = np.unique(way, return_inverse=True)
        pushes, seen = self.system.pushes[:, needed], self.system.seen[:, needed]
        for part in parts(len(self.omega)):
            omega = self.omega[part]
            through = self.filters @ np.exp(
                -1j * np.outer(np.arange(LAGS + 1), omega * self.step_s)
            )
            grid = 1j * omega[:, None, None] * np.eye(len(self.system.a))
            states = np.linalg.solve(grid - self.system.a, pushes[None])
            moved = (self.system.c @ states + seen).transpose(2, 1, 0) * through
            moved = (self.turned @ moved) / np.sqrt(self.power[:, part])
            slow = [1.0 / np.abs(1j * omega * t + 1.0) for t in MEMORIES_S]
            memories = np.array([np.ones_like(omega), *slow])
            yield moved[place] * memories[memory][:, None, :], self.told[:, part]


def _smoothed(power: Array) -> Array:
    """Means over neighbouring frequencies, (n_outputs, n_omega)."""
    sums = np.cumsum(np.pad(power, ((0, 0), (1, 0))), axis=1)
    place = np.arange(power.shape[1])
    low = np.maximum(place - SMOOTH, 0)
    high = np.minimum(place + SMOOTH + 1, power.shape[1])
    means = (sums[:, high] - sums[:, low]) / (high - low)
    return np.asarray(np.maximum(means, np.finfo(float).tiny))


def _chance(score: float, size: Array) -> float:
    """Probability of so large a sum over frequencies, size (n_outputs, n_omega), by saddlepoint.

    v* (w w* - diag |w|²) v of complex normal v has the logarithm of its moments
    K(s) = -Σ ln(1 + s |w|²) - ln(1 - s Σ |w|²/(1 + s |w|²)).
    """
    if score <= 0.0 or not np.any(size > 0.0):
        return 1.0
    low, high = 0.0, _largest(size)
    tilt, end = 0.5 * high, high
    for _ in range(HALVINGS):
        moments, slope, bend = _moments(tilt, size)
        low, high = (tilt, high) if slope <= score else (low, tilt)
        # Newton's steps where they stay between what is known, as they do near the end.
        step = (score - slope) / bend if bend > 0.0 else np.inf
        inside = low < tilt + step < high
        if inside and abs(step) <= NEAR * end:
            break
        tilt = tilt + step if inside else 0.5 * (low + high)
    else:
        moments, _, bend = _moments(tilt, size)
    bound = float(np.exp(min(moments - tilt * score, 0.0)))
    return float(bound / max(1.0, tilt * float(np.sqrt(2.0 * np.pi * bend))))


def _moments(tilt: float, size: Array) -> tuple[float, float, float]:
    """K, its slope and its bend at an exponent, summed over frequencies."""
    near = 1.0 / (1.0 + tilt * size)
    share = size * near
    first, second = np.sum(share, axis=0), np.sum(share * near, axis=0)
    left = 1.0 - tilt * first
    bend = np.sum(share**2, axis=0) - 2.0 * np.sum(share**2 * near, axis=0) / left
    return (
        float(np.sum(np.log(near)) - np.sum(np.log(left))),
        float(np.sum(second / left - first)),
        float(np.sum(bend + (second / left) ** 2)),
    )


def _largest(size: Array) -> float:
    """Exponent below which the moments of all frequencies are finite, by bisection."""
    others = float(np.max(np.sum(size, axis=0) - np.max(size, axis=0)))
    low, high = 0.0, 1.0 / max(others, np.finfo(float).tiny)
    for _ in range(HALVINGS):
        tried = 0.5 * (low + high)
        finite = np.all(tried * np.sum(size / (1.0 + tried * size), axis=0) < 1.0)
        low, high = (tried, high) if finite else (low, tried)
    return low
