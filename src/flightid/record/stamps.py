"""Time stamps of one channel: order, missing samples, gaps, jitter; nothing is mended unasked."""

from __future__ import annotations

from enum import StrEnum
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from flightid.errors import DataError, ShapeError
from flightid.frozen import dataclass

GAP_FACTOR = 2.5
"""A spacing above this many median spacings is a gap; one lost sample (factor 2) is not."""
UNIFORM_TOLERANCE = 1e-3
"""Largest departure from a uniform grid, in sample times, that counts as rounding of stamps."""

SLOWEST_S = 1.0
"""Samples further apart are rare in dynamics, and usual in files whose time is in ms."""
IN_MS_S = 1000.0
"""Whole numbers further apart than this look like microseconds rather than milliseconds."""
WALK = 0.25
"""Part of a sample time by which a rounded grid may walk off the stamps over a record."""


def mean_spacing_s(stamps: NDArray[np.float64]) -> float:
    """Mean spacing of finite stamps outside gaps, s; 0 below two."""
    spacing = np.diff(stamps[np.isfinite(stamps)])
    if not spacing.size:
        return 0.0
    return float(np.mean(spacing[spacing <= GAP_FACTOR * np.median(spacing)]))


def rounded_step_s(stamps: NDArray[np.float64]) -> float:
    """Mean spacing outside gaps in the fewest digits that end within a quarter of a sample, s.

    Example
    -------
    >>> rounded_step_s(0.02 * np.arange(500) + 1e-4 * np.sin(np.arange(500)))
    0.02
    """
    step = mean_spacing_s(stamps)
    rounded = (float(f"{step:.{digits}g}") for digits in range(1, 10))
    return next((each for each in rounded if abs(each - step) * stamps.size <= WALK * step), step)


def finer_unit(step_s: float) -> tuple[str, float]:
    """The unit that stamps so far apart are likely in, were they not seconds, and its length, s.

    Example
    -------
    >>> finer_unit(20.0), finer_unit(20_000.0)
    (('ms', 0.001), ('us', 1e-06))
    """
    return ("ms", 1e-3) if step_s < IN_MS_S else ("us", 1e-6)


class StampPolicy(StrEnum):
    """What to do with a stamp that does not exceed the one before it.

    `ERROR` refuses; `DROP` keeps the first sample of a stamp and drops each sample that is not
    later than all before it; `SORT` puts samples in the order of their stamps first (for writers
    that store late messages out of order), then drops repeated stamps.

    Example
    -------
    >>> [policy.value for policy in StampPolicy]
    ['error', 'drop', 'sort']
    """

    ERROR = "error"
    DROP = "drop"
    SORT = "sort"


@dataclass(frozen=True)
class StampedSamples:
    """Samples of one channel on their own increasing stamps.

    Attributes
    ----------
    name : str
        Channel.
    time_s : ndarray, shape (n,)
        Strictly increasing stamps, s.
    values : ndarray, shape (n,)
        Finite samples.
    n_disordered : int
        Samples dropped or moved because of their stamps.
    n_missing : int
        Samples left out because they were not finite.
    """

    name: str
    time_s: NDArray[np.float64]
    values: NDArray[np.float64]
    n_disordered: int = 0
    n_missing: int = 0

    @cached_property
    def median_spacing_s(self) -> float:
        """Median time between stamps, s."""
        return float(np.median(np.diff(self.time_s)))

    @property
    def sample_time_s(self) -> float:
        """Mean time between stamps outside gaps, s; coarse stamps would mislead a median."""
        return float(np.mean(self._regular_spacing()))

    @property
    def jitter(self) -> float:
        """Root mean square departure of the spacing from its mean outside gaps, as a fraction."""
        regular = self._regular_spacing()
        return float(np.std(regular) / np.mean(regular))

    def _regular_spacing(self) -> NDArray[np.float64]:
        """Spacings outside gaps, s."""
        spacing = np.diff(self.time_s)
        return np.asarray(spacing[spacing <= GAP_FACTOR * self.median_spacing_s])

    @cached_property
    def usual_gaps(self) -> tuple[tuple[float, float], ...]:
        """Spans without a sample: spacings above 2.5 median spacings."""
        return tuple(self.gaps(GAP_FACTOR * self.median_spacing_s))

    def gaps(self, longest_s: float | None = None) -> list[tuple[float, float]]:
        """Spans without a sample: spacings above `longest_s`, or the `usual_gaps`."""
        if longest_s is None:
            return list(self.usual_gaps)
        (index,) = np.nonzero(np.diff(self.time_s) > longest_s)
        return [(float(self.time_s[i]), float(self.time_s[i + 1])) for i in index]

    def is_uniform(self) -> bool:
        """Tell whether the stamps lie on a uniform grid to within rounding."""
        count = self.time_s.size
        step = (self.time_s[-1] - self.time_s[0]) / (count - 1)
        worst = np.max(np.abs(self.time_s - self.time_s[0] - step * np.arange(count)))
        return bool(worst <= UNIFORM_TOLERANCE * step)

    def within(self, start_s: float, stop_s: float) -> StampedSamples:
        """Copy of the samples with ``start_s <= time <= stop_s``."""
        inside = (self.time_s >= start_s) & (self.time_s <= stop_s)
        return StampedSamples(self.name, self.time_s[inside], self.values[inside])

    def bridged(self) -> StampedSamples:
        """Copy in which gaps hold samples on the straight line, a median spacing apart."""
        step = self.median_spacing_s
        extra = [
            start + (stop - start) * np.arange(1, count) / count
            for start, stop in self.gaps()
            if (count := round((stop - start) / step)) > 1
        ]
        if not extra:
            return self
        added = np.concatenate(extra)
        stamps = np.union1d(self.time_s, added)
        return StampedSamples(self.name, stamps, np.interp(stamps, self.time_s, self.values))


def stamped(name: str, time_s: ArrayLike, values: ArrayLike, policy: StampPolicy) -> StampedSamples:
    """Check one channel; samples that are not finite become missing (the gap policy judges them).

    Parameters
    ----------
    name : str
        Channel, for messages.
    time_s, values : array_like, shape (n,)
        Stamps, s, and samples.
    policy : StampPolicy
        What to do with repeated and backward stamps.

    Raises
    ------
    ShapeError
        The arrays do not have one common length.
    DataError
        Stamps not finite, not increasing (policy `ERROR`), or fewer than two samples left.

    Example
    -------
    >>> stamped("p", [0.0, 0.1, 0.1, 0.2], [1.0, 2.0, 3.0, 4.0], StampPolicy.DROP).values
    array([1., 2., 4.])
    """
    stamps = np.array(time_s, dtype=np.float64)
    samples = np.array(values, dtype=np.float64)
    if stamps.ndim != 1 or stamps.shape != samples.shape:
        raise ShapeError(
            f"stamps and samples of channel {name!r} do not have one length",
            found=f"{stamps.shape} and {samples.shape}",
            needed="two one-dimensional arrays of equal length",
        )
    if not np.all(np.isfinite(stamps)):
        raise DataError(f"stamps of channel {name!r} are not finite", needed="stamps in seconds")
    present = np.isfinite(samples)
    n_missing = int(samples.size - np.count_nonzero(present))
    stamps, samples = stamps[present], samples[present]
    stamps, samples, n_disordered = _in_order(name, stamps, samples, policy)
    if stamps.size < 2:
        raise DataError(
            f"channel {name!r} holds too few samples", found=stamps.size, needed="at least 2"
        )
    return StampedSamples(name, stamps, samples, n_disordered, n_missing)


def _in_order(
    name: str, stamps: NDArray[np.float64], samples: NDArray[np.float64], policy: StampPolicy
) -> tuple[NDArray[np.float64], NDArray[np.float64], int]:
    backward = np.diff(stamps) <= 0
    if not backward.any():
        return stamps, samples, 0
    if policy is StampPolicy.ERROR:
        first = int(np.argmax(backward)) + 1
        raise DataError(
            f"stamps of channel {name!r} do not increase",
            found=f"{np.count_nonzero(backward)} repeated or backward stamps, the first at "
            f"index {first} ({stamps[first]:.6f} s)",
            needed="increasing stamps",
            action="copy the record again, for it may be damaged; of a sound one choose the "
            "stamp policy 'drop' or 'sort' of to_uniform",
        )
    n_disordered = 0
    if policy is StampPolicy.SORT:
        order = np.argsort(stamps, kind="stable")
        n_disordered = int(np.count_nonzero(order != np.arange(order.size)))
        stamps, samples = stamps[order], samples[order]
    latest = np.maximum.accumulate(stamps)
    later = np.concatenate(([True], stamps[1:] > latest[:-1]))
    n_disordered += int(later.size - np.count_nonzero(later))
    return stamps[later], samples[later], n_disordered
