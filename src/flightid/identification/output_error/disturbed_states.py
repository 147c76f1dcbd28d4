"""Whether residuals move together as one disturbance of the states would move them.

A gust disturbs few states, and from there goes into every output by the model's own responses. In
the residuals of one output it may hide below the noise; outputs tell it together. Of independent
sensors, whatever their colour, products of different outputs at a frequency average to nothing. So
these alone are weighed, as each disturbance would make them: the locally most powerful test of that
disturbance beside noise of known colour, with products of one output left out (native:
`shown_disturbances.rs`).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import scipy
from numpy.typing import NDArray

from flightid import _native
from flightid.frozen import dataclass
from flightid.identification.output_error.whitened_residuals import (
    LAGS,
    apart,
    colour_filters,
    unforetold,
)
from flightid.identification.records.held_model import LinearPoint
from flightid.models import GreyBoxModel, StateSpaceModel
from flightid.recursive_filter import filtered

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]
_System = tuple[Array, Array, Array, Array]
_Seen = tuple[Array, Complex, Array]
_Whitening = tuple[Array, Array, float]
SMOOTH = 8
"""Frequencies to each side over which a whitened output's power is averaged."""
FEWEST = 100
"""Samples of a record that is looked at."""
MEMORIES_S = (0.0, 0.3, 2.0)
"""Of disturbances, s: gusts have one."""
FALSE_ALARMS = 0.001
"""Share of records with noise of sensors alone in which a disturbance is named."""
LONG = 1 << 16
"""Samples from which a record is cut to a length of small factors, 0.7 % shorter at most, whose
transform takes a seventh of the time."""
TRIED = 2
"""Disturbances whose chance is worked out: those that stand out most."""


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
    pairs = [each.scores() for each in looked]
    score = np.sum([found for found, _ in pairs], axis=0)
    spread = np.sqrt(np.sum([variance for _, variance in pairs], axis=0))
    shown = score / np.where(spread > 0.0, spread, np.inf)
    best = np.argsort(-shown)[:TRIED]
    sizes = np.concatenate([each.sizes(best) for each in looked], axis=-1)
    chances = [
        _native.disturbance_chance(float(score[way]), size)
        for way, size in zip(best, sizes, strict=True)
    ]
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
        n = quick_length(white.shape[1])
        spectra = turned @ scipy.fft.rfft(white[:, :n], axis=1)[:, 1:]
        omega = 2.0 * np.pi * np.arange(1, spectra.shape[1] + 1) / (n * step_s)
        power = _smoothed(np.square(spectra.real) + np.square(spectra.imag))
        told = np.divide(spectra, np.sqrt(power), out=spectra)
        return cls(told, power, omega, np.array(filters), turned, system, step_s)

    def scores(self) -> tuple[Array, Array]:
        """Of all disturbances with each memory, memory by memory, and their variances by chance."""
        return _native.disturbance_scores(*self._asked(slice(None)), np.array(MEMORIES_S))

    def sizes(self, ways: NDArray[np.intp]) -> Array:
        """Squared weights of disturbances and memories, (n_ways, n_outputs, n_omega)."""
        memory, way = np.divmod(ways, self.system.pushes.shape[1])
        return _native.disturbance_sizes(*self._asked(way), np.array(MEMORIES_S)[memory])

    def _asked(self, ways: slice | NDArray[np.intp]) -> tuple[_System, _Seen, _Whitening]:
        a, c = self.system.a, self.system.c
        return (
            (a, self.system.pushes[:, ways], c, self.system.seen[:, ways]),
            (self.omega, self.told, self.power),
            (self.filters, self.turned, self.step_s),
        )


def quick_length(n: int) -> int:
    """Samples of so many whose transform is quick: all where they are few.

    Example
    -------
    >>> quick_length(1009), quick_length(999_983)
    (1009, 998250)
    """
    while n >= LONG and scipy.fft.next_fast_len(n) > n:
        n -= 1
    return n


def _smoothed(power: Array) -> Array:
    """Means over neighbouring frequencies, (n_outputs, n_omega)."""
    count = power.shape[1]
    sums = np.cumsum(np.pad(power, ((0, 0), (1, 0))), axis=1)
    ends = np.pad(sums, ((0, 0), (SMOOTH, SMOOTH)), mode="edge")
    place = np.clip(np.arange(-SMOOTH, count + SMOOTH + 1), 0, count)
    wide = 2 * SMOOTH + 1
    means = (ends[:, wide:] - ends[:, :count]) / (place[wide:] - place[:count])
    return np.asarray(np.maximum(means, np.finfo(float).tiny))
