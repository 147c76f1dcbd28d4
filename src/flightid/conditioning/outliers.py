"""Outliers: samples that lie far from the median of their neighbours, found and bridged."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import median_filter

from flightid.conditioning.detrend import chosen_channels
from flightid.errors import DataError, OptionError
from flightid.record import Record, Step
from flightid.table import Cell

NORMAL_MAD = 1.4826
"""Standard deviation of normal noise over its median absolute deviation."""
MOST = 0.1
"""Share of a channel that may be bridged: more is no outlier but the signal."""


def remove_outliers(
    record: Record,
    *,
    deviations: float = 6.0,
    half_width: int = 3,
    channels: Iterable[str] | None = None,
) -> Record:
    """Replace samples far from the median of their neighbours by a line between the next good ones.

    A sample counts as an outlier where it lies more than `deviations` robust standard deviations
    from the running median; the deviation is that of all distances from it, so a channel without
    noise keeps its steps.

    Parameters
    ----------
    record : Record
    deviations : float
        Robust standard deviations beyond which a sample is an outlier.
    half_width : int
        Neighbours on each side; an outlier lasts at most so many samples.
    channels : iterable of str, optional
        Default: all outputs, since inputs may step.

    Returns
    -------
    Record
        How many samples of each channel were replaced is in its history.

    Raises
    ------
    OptionError
        A threshold or width without meaning.
    DataError
        More than a tenth of a channel would be replaced.
    UnknownNameError
        A channel is missing.

    Assumes
    -------
    Outliers shorter than `half_width` samples in a signal that is smooth over the window. Biased
    for signals that spike by nature.

    Reference
    ---------
    Pearson et al., *Generalized Hampel Filters*, EURASIP J. Adv. Signal Process. 2016:87, eq. 3.

    Example
    -------
    >>> time_s = np.arange(200) * 0.01
    >>> y = np.sin(time_s)
    >>> y[50] += 8.0
    >>> record = Record.from_arrays(time_s, outputs={"y": y})
    >>> cleaned = remove_outliers(record)
    >>> bool(abs(cleaned["y"][50] - np.sin(0.5)) < 1e-4)
    True
    """
    if not deviations > 0.0:
        raise OptionError("deviations is not positive", found=deviations, needed="above 0")
    if half_width < 1 or 2 * half_width + 1 > record.n_samples:
        raise OptionError(
            "half_width does not suit the record",
            found=half_width,
            needed=f"1 to {(record.n_samples - 1) // 2}",
        )
    names = record.outputs if channels is None else chosen_channels(record, channels)
    replaced, counts = {}, {}
    for name in names:
        bad = _outliers(record[name], deviations, half_width)
        count = int(np.count_nonzero(bad))
        if count > MOST * record.n_samples:
            raise DataError(
                f"too many samples of channel {name!r} would count as outliers",
                found=f"{count} of {record.n_samples}",
                needed=f"at most {MOST:.0%}",
                action="raise deviations, or leave the channel out",
            )
        if count:
            place = np.arange(record.n_samples)
            replaced[name] = np.where(
                bad, np.interp(place, place[~bad], record[name][~bad]), record[name]
            )
            counts[name] = count
    options: dict[str, Cell] = {"deviations": deviations, "half_width": half_width, **counts}
    return record.replace(replaced, step=Step("conditioning.remove_outliers", options))


def _outliers(
    samples: NDArray[np.float64], deviations: float, half_width: int
) -> NDArray[np.bool_]:
    away = np.abs(samples - median_filter(samples, 2 * half_width + 1, mode="nearest"))
    typical = float(np.median(away))
    if typical == 0.0:
        # More than half of the samples are their neighbours' median: a held or quiet channel.
        moved = away[away > 0.0]
        typical = float(np.median(moved)) if moved.size else 0.0
    spread = NORMAL_MAD * typical
    # A clean curve lies near its running median everywhere: what rounding adds is no outlier.
    rounding = 1e-9 * float(np.ptp(samples))
    return np.asarray(away > deviations * spread + rounding)
