"""Samples far from the median of their neighbours, in arrays: found, and bridged by a line."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from flightid import _native
from flightid.errors import DataError, OptionError

NORMAL_MAD = 1.4826
"""Standard deviation of normal noise over its median absolute deviation."""
MOST = 0.1
"""Share of a channel that may be bridged: more is no outlier but the signal."""
HALF_WIDTH = 3
FAR, FAR_FROM_NEIGHBOURS, NEIGHBOURS = 12.0, 5.0, 12
"""A spike lies so many robust deviations, and so many times its neighbours, from its median."""
HARMFUL = 0.5
"""Least height of a spike over the range of the middle 98 %."""


def bridge_outliers(
    name: str,
    time_s: NDArray[np.float64],
    samples: NDArray[np.float64],
    *,
    deviations: float,
    half_width: int,
) -> tuple[NDArray[np.float64], int]:
    """Samples with a straight line in time where they lie far from their running median.

    Parameters
    ----------
    name : str
        Channel, for messages.
    time_s, samples : ndarray, shape (n,)
        Stamps, uniform or not, s; samples that are not finite are left alone.
    deviations : float
        Robust standard deviations beyond which a sample is an outlier.
    half_width : int
        Neighbours on each side; an outlier lasts at most so many samples.

    Returns
    -------
    samples : ndarray, shape (n,)
    count : int
        How many were replaced.

    Raises
    ------
    OptionError
        A threshold or width without meaning.
    DataError
        More than a tenth of the channel would be replaced.

    Reference
    ---------
    Pearson et al., *Generalized Hampel Filters*, EURASIP J. Adv. Signal Process. 2016:87, eq. 3.

    Example
    -------
    >>> stamps = np.arange(10.0)
    >>> bridge_outliers("y", stamps, np.where(stamps == 4, 50.0, stamps), deviations=6.0,
    ...                 half_width=2)
    (array([0., 1., 2., 3., 4., 5., 6., 7., 8., 9.]), 1)
    """
    if not deviations > 0.0:
        raise OptionError("deviations is not positive", found=deviations, needed="above 0")
    if half_width < 1 or 2 * half_width + 1 > samples.size:
        raise OptionError(
            "half_width does not suit the record",
            found=half_width,
            needed=f"1 to {(samples.size - 1) // 2}",
        )
    present = np.isfinite(samples)
    bad = np.zeros(samples.size, dtype=bool)
    bad[present] = _outlying(samples[present], deviations, half_width)
    count = int(np.count_nonzero(bad))
    if count > MOST * samples.size:
        raise DataError(
            f"too many samples of channel {name!r} would count as outliers",
            found=f"{count} of {samples.size}",
            needed=f"at most {100.0 * MOST:.0f} %",
            action="raise deviations, or leave the channel out",
        )
    good = present & ~bad
    return np.where(bad, np.interp(time_s, time_s[good], samples[good]), samples), count


def alone(
    values: NDArray[np.float64],
) -> tuple[NDArray[np.intp], NDArray[np.float64], float]:
    """Samples that stand alone; all distances from the median of their neighbours; their spread."""
    away = distances(values, HALF_WIDTH)
    low, high = np.percentile(values, [1, 99])
    beyond = away > HARMFUL * (high - low)
    if not beyond.any():
        return np.empty(0, dtype=np.intp), away, 0.0
    spread = spread_of(away)
    tall = beyond & (away > FAR * spread)
    if not tall.any():
        return np.empty(0, dtype=np.intp), away, spread
    # The largest of the neighbours, without the few samples that a spike may last.
    around = _largest_near(np.where(tall, 0.0, away), NEIGHBOURS)
    crowd = np.convolve(tall, np.ones(2 * (NEIGHBOURS + HALF_WIDTH) + 1), mode="same")
    found = tall & (away > FAR_FROM_NEIGHBOURS * around) & (crowd <= HALF_WIDTH)
    return np.flatnonzero(found), away, spread


def _largest_near(values: NDArray[np.float64], half: int) -> NDArray[np.float64]:
    """Largest of each sample and `half` neighbours on either side: spans doubled, two joined."""
    largest, width, whole = np.pad(values, half, mode="edge"), 1, 2 * half + 1
    while 2 * width <= whole:
        largest, width = np.maximum(largest[:-width], largest[width:]), 2 * width
    n, rest = len(values), whole - width
    return np.maximum(largest[:n], largest[rest : rest + n])


def distances(samples: NDArray[np.float64], half_width: int) -> NDArray[np.float64]:
    """Distance of each sample from its running median."""
    return np.abs(samples - _native.running_median(samples, half_width))


def spread_of(away: NDArray[np.float64]) -> float:
    """Robust standard deviation of distances."""
    typical = float(np.median(away))
    if typical == 0.0:
        # More than half of the samples are their neighbours' median: a held or quiet channel.
        moved = away[away > 0.0]
        typical = float(np.median(moved)) if moved.size else 0.0
    return NORMAL_MAD * typical


def _outlying(
    samples: NDArray[np.float64], deviations: float, half_width: int
) -> NDArray[np.bool_]:
    away = distances(samples, half_width)
    # A clean curve lies near its running median everywhere: what rounding adds is no outlier.
    rounding = 1e-9 * float(np.ptp(samples))
    return np.asarray(away > deviations * spread_of(away) + rounding)
