"""What samples show of inputs: levels that stand still (a staircase), and exact repetition."""

from __future__ import annotations

import numpy as np
import scipy
from numpy.typing import NDArray

from flightid.frozen import dataclass

Array = NDArray[np.float64]
FEWEST_JUMPS = 8
"""Below it standing still may be the manoeuvre, not a hold."""
LARGE_JUMP = 0.2
"""Median jump over the range of an input that stands still between irregular jumps. Coarse
quantisation of a smooth signal also stands still, but then moves by its smallest step."""
STANDING = 0.5
"""Least share of samples that repeat the one before, for irregular jumps."""
ROUGH, MATERIAL = 1.7, 0.05
"""Power of second over first differences, 2 of a random walk and next to none of a smooth signal;
and of first differences over the signal's, below which its noise alone may be rough."""
FEWEST_PERIODS = 2
ROUNDING = 1e-9
"""Largest difference of two periods, over the range, that still counts as the same."""
BESIDE, LONGEST_STEP, DUST, FEWEST_PLATEAUS = 5, 1.5, 1e-9, 20
"""Steps beside a rest, of so many counts at most; differences over the range that are rounding;
plateaus below which nobody knows the count."""


@dataclass(frozen=True)
class Staircase:
    """An input that stands still over several samples and then jumps.

    Attributes
    ----------
    samples : int
        Every jump falls on a multiple of this; 1 for irregular jumps.
    n_jumps : int

    Example
    -------
    >>> str(Staircase(4, 30))
    'stands still and jumps every 4 samples or multiples of it (30 jumps)'
    """

    samples: int
    n_jumps: int

    def __str__(self) -> str:
        """What was seen, in words."""
        if self.samples > 1:
            return (
                f"stands still and jumps every {self.samples} samples or multiples of it "
                f"({self.n_jumps} jumps)"
            )
        return f"stands still between {self.n_jumps} large jumps"


def found_staircase(samples: Array) -> Staircase | None:
    """Find an input that is held: changes on a coarser grid than its own, or few large jumps.

    A smooth signal changes at every sample, a coarsely quantised one by its smallest step at
    instants that share no grid; neither is taken for a staircase. One that steps at every sample
    cannot be told from samples of a smooth signal, and is not found.

    Parameters
    ----------
    samples : ndarray, shape (n_samples,)

    Returns
    -------
    Staircase or None

    Example
    -------
    >>> held = np.repeat(np.random.default_rng(0).standard_normal(40), 5)
    >>> found_staircase(held)
    Staircase(samples=5, n_jumps=39)
    >>> found_staircase(np.round(10 * np.sin(0.05 * np.arange(400)))) is None
    True
    """
    jumps = np.flatnonzero(np.diff(samples)) + 1
    if jumps.size < FEWEST_JUMPS:
        return None
    grid = int(np.gcd.reduce(np.diff(jumps)))
    if grid > 1:
        return Staircase(grid, int(jumps.size))
    sizes = np.abs(np.diff(samples)[jumps - 1])
    large = np.median(sizes) >= LARGE_JUMP * np.ptp(samples)
    still = jumps.size <= (1.0 - STANDING) * samples.size
    return Staircase(1, int(jumps.size)) if large and still else None


def measured_rows(samples: Array) -> slice | None:
    """Rows at which a measured channel got a new value, where it repeats them on a coarser grid.

    Parameters
    ----------
    samples : ndarray, shape (n_samples,)

    Returns
    -------
    slice or None
        None where values do not repeat so, or the channel is a switch.

    Example
    -------
    >>> measured_rows(np.repeat(np.arange(20.0) ** 2, 3)[1:])
    slice(2, None, 3)
    """
    found = found_staircase(samples)
    if found is None or found.samples < 2 or is_switched(samples):
        return None
    first = int(np.flatnonzero(np.diff(samples))[0]) + 1
    return slice(first % found.samples, None, found.samples)


def stands_still(samples: Array) -> bool:
    """Whether samples stand still for the most and jump far within one, be it seldom.

    Few such jumps may be a pilot's, so they bear out steps that somebody told and accuse nobody.

    Parameters
    ----------
    samples : ndarray, shape (n_samples,)

    Example
    -------
    >>> doublet = np.repeat([0.0, 1.0, -1.0, 0.0], 20)
    >>> stands_still(doublet), stands_still(np.convolve(doublet, np.ones(3), "valid"))
    (True, False)
    """
    moves = np.abs(np.diff(samples))
    jumps = moves[moves > 0.0]
    still = 0 < jumps.size <= (1.0 - STANDING) * samples.size
    return still and bool(np.min(jumps) >= LARGE_JUMP * np.ptp(samples))


def is_rough(samples: Array) -> bool:
    """Whether samples move at random from one to the next, so that none tells what lies between.

    Parameters
    ----------
    samples : ndarray, shape (n_samples,)

    Example
    -------
    >>> random = np.random.default_rng(0)
    >>> is_rough(random.standard_normal(400)), is_rough(np.sin(0.3 * np.arange(400)))
    (True, False)
    """
    if samples.size < FEWEST_JUMPS:
        return False
    first, second = (float(np.var(np.diff(samples, order))) for order in (1, 2))
    return first > MATERIAL * float(np.var(samples)) and second > ROUGH * first


def is_switched(samples: Array) -> bool:
    """Whether samples take two levels alone and jump between them often, as a switch does.

    What lies between two such samples is one of the levels: the input was held.

    Parameters
    ----------
    samples : ndarray, shape (n_samples,)

    Example
    -------
    >>> is_switched(np.tile([3.0, 5.0, 5.0], 9)), is_switched(np.tile([3.0, 4.0, 5.0], 9))
    (True, False)
    """
    low, high = float(np.min(samples)), float(np.max(samples))
    two = low < high and bool(np.all((samples == low) | (samples == high)))
    return two and int(np.count_nonzero(np.diff(samples))) >= FEWEST_JUMPS


def found_period(samples: Array) -> int | None:
    """Find the least number of samples after which all rows repeat, to rounding.

    Parameters
    ----------
    samples : ndarray, shape (n_samples,) or (n_rows, n_samples)
        Constant rows are passed over.

    Returns
    -------
    int or None
        None where fewer than two whole periods are there, or any sample differs.

    Example
    -------
    >>> found_period(np.tile([0.0, 1.0, 1.0, 0.0, 1.0], 3))
    5
    >>> found_period(np.sin(np.arange(100) ** 1.5)) is None
    True
    """
    rows = np.atleast_2d(np.asarray(samples, dtype=np.float64))
    rows = rows[np.ptp(rows, axis=1) > 0.0]
    n = rows.shape[1]
    if not rows.size or n < 2 * FEWEST_PERIODS:
        return None
    longest = n // FEWEST_PERIODS
    centred = (rows - rows.mean(axis=1, keepdims=True)) / np.ptp(rows, axis=1)[:, None]
    for lag in _candidates(centred, longest):
        if np.max(np.abs(centred[:, lag:] - centred[:, :-lag])) <= ROUNDING:
            return int(lag)
    return None


def _candidates(rows: Array, longest: int) -> NDArray[np.intp]:
    """Lags at which the sum of squared differences vanishes to the rounding of its sums."""
    n = rows.shape[1]
    # Room for the lags that are asked; row by row, for long records are large.
    size = scipy.fft.next_fast_len(n + longest, real=True)
    power = np.zeros(size // 2 + 1)
    squares = np.zeros(n + 1)
    for row in rows:
        part = scipy.fft.rfft(row, size)
        power += np.square(part.real) + np.square(part.imag)
        squares[1:] += row**2
    products = scipy.fft.irfft(power, size)
    np.cumsum(squares, out=squares)
    lags = np.arange(1, longest + 1)
    away = squares[n - lags] + (squares[n] - squares[lags]) - 2.0 * products[lags]
    return np.asarray(lags[away <= 1e-9 * squares[n]], dtype=np.intp)


def rests_within_a_count(
    values: NDArray[np.float64],
    *,
    plateaus: NDArray[np.intp],
    rests: tuple[NDArray[np.intp], NDArray[np.intp]],
) -> NDArray[np.bool_]:
    """Which stretches may be rest between two counts of what is read in steps, as an encoder is.

    The count is the least difference of successive plateaus. Beside a rest nothing moves by more
    than that; noise that a failure stopped does. Resampling moves by parts of a count.

    Parameters
    ----------
    values : ndarray, shape (n,)
    plateaus : ndarray of int
        First samples of runs of two equal samples at least.
    rests : tuple of ndarray of int
        First and last samples of the stretches.
    """
    apart = np.abs(np.diff(values[plateaus]))
    apart = apart[apart > DUST * np.ptp(values)]
    if apart.size < FEWEST_PLATEAUS:
        return np.zeros(rests[0].size, dtype=np.bool_)
    most = LONGEST_STEP * float(np.min(apart))
    steps = np.abs(np.diff(values))
    beside = [
        np.r_[steps[max(0, start - BESIDE) : start], steps[stop : stop + BESIDE]].max(initial=0.0)
        for start, stop in zip(*rests, strict=True)
    ]
    return np.asarray(beside) <= most
