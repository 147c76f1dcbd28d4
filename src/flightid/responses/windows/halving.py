"""Half as many samples for slow sinusoids, again and again: the exact way to decimate.

A half-band kernel tells sinusoids up to a frequency at odd places from those at even ones. So the
products of a row with such sinusoids, tapered or not, are those of a row of half as many samples,
onto which the samples between were weighed: nothing is filtered or folded over. Rows are longer by
what the ends of a window send beyond it, where its tapered sinusoids are thought to go on.

Records are halved once for windows of all lengths, whose ends are then put right; rows of windows
by a shorter kernel as often as that pays for frequencies that are half as fast each time.
"""

from __future__ import annotations

from functools import cache, cached_property

import numpy as np
from numpy.typing import NDArray

from flightid import _native

HALVED = 1.28
"""Frequency up to which a record is halved, rad per sample: to 2e-13 of a sinusoid, by 48 weights.
Bands end at a fifth of the sampling rate by default, 1.257."""
HALVED_WEIGHTS = 48
STEPPED = 0.6
"""Frequency up to which a row is halved, rad per sample: to 5e-14 of a sinusoid, by 13 weights."""
STEPPED_WEIGHTS = 13
LONG = 4
"""Reaches of the kernel in a window from which on halved records pay."""
COSTS = 60.0
"""Frequencies whose products take as long as a number of a halved row."""
FEWEST = 30
"""Frequencies from which on halved records pay."""
GRID = 2000
"""Frequencies at which weights are found: forty to each of them or more."""
Real = NDArray[np.float64]
NONE = np.empty((1, 0))


class Halves:
    """A record, and its channels at every second sample as far as windows ask for them.

    Parameters
    ----------
    samples : ndarray, shape (n_channels, n_samples)

    Example
    -------
    >>> halves = Halves(np.cos(0.5 * np.arange(400.0))[None])
    >>> bool(np.allclose(halves.even[0, 60:-60], 2.0 * halves.samples[0, 120:-120:2]))
    True
    """

    def __init__(self, samples: Real) -> None:
        self.samples = np.ascontiguousarray(samples)

    @cached_property
    def even(self) -> Real:
        """At samples 0, 2, 4 and so on, those between weighed onto them."""
        return _native.halved(self.samples, False, halved_weights())

    @cached_property
    def odd(self) -> Real:
        """Likewise at samples 1, 3, 5 and so on."""
        return _native.halved(self.samples, True, halved_weights())

    def about(self, middle: int, hop: int) -> tuple[Real, Real]:
        """Those that hold the middles of windows, of which one is given; nothing for others."""
        both = hop % 2 == 1
        even = self.even if both or middle % 2 == 0 else NONE
        return even, self.odd if both or middle % 2 == 1 else NONE


@cache
def halved_weights() -> Real:
    """Weights by which records are halved, nearest neighbours first."""
    return _half_band(HALVED, HALVED_WEIGHTS)


@cache
def stepped_weights() -> Real:
    """Weights by which rows are halved."""
    return _half_band(STEPPED, STEPPED_WEIGHTS)


def _half_band(highest: float, count: int) -> Real:
    """Weights w with Σ 2 w_k cos((2k + 1)ω) = 1 up to a frequency: least squares, ends dense."""
    omega = highest * np.sin(0.5 * np.pi * (np.arange(GRID) + 0.5) / GRID)
    cosines = 2.0 * np.cos(np.multiply.outer(omega, 2.0 * np.arange(count) + 1.0))
    return np.asarray(np.linalg.lstsq(cosines, np.ones(GRID), rcond=None)[0])


def halved_rows(highest: Real, length: int) -> bool:
    """Whether windows of so many samples begin with halved records.

    Parameters
    ----------
    highest : ndarray, increasing
        Highest frequency in each tapered sinusoid, rad per sample.
    length : int
    """
    long = length >= LONG * (2 * HALVED_WEIGHTS - 1)
    return long and len(highest) >= FEWEST and float(highest[-1]) <= HALVED


def level_sizes(highest: Real, length: int, *, halved: bool) -> list[tuple[int, int, int]]:
    """Samples to a step, steps in a row and how many frequencies, all slower ones among them.

    One after another, the finest first, as far as it pays; sizes are those of the native half.
    """
    step, width = 1, length // 2 + 1
    if halved:
        step, width = 2, (length // 2 + 2 * HALVED_WEIGHTS - 1) // 2 + 1
    found = [(step, width, len(highest))]
    while True:
        slow = int(np.searchsorted(step * highest, STEPPED, "right"))
        shorter = (width - 1 + 2 * STEPPED_WEIGHTS - 1) // 2 + 1
        if slow * (width - shorter) <= COSTS * shorter:
            return found
        step, width = 2 * step, shorter
        found.append((step, width, slow))


def exponentials(omega: Real, count: int) -> NDArray[np.complex128]:
    """``exp(jωd)`` for d below `count`, from two short tables: coarse steps and fine ones."""
    fine = int(np.ceil(np.sqrt(count)))
    coarse = -(-count // fine)
    small = np.exp(1j * np.multiply.outer(omega, np.arange(fine)))
    large = np.exp(1j * np.multiply.outer(omega, fine * np.arange(coarse)))
    whole = (large[:, :, None] * small[:, None, :]).reshape(len(omega), coarse * fine)
    return np.asarray(whole[:, :count])
