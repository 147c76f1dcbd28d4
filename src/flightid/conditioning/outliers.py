"""Outliers: samples that lie far from the median of their neighbours, found and bridged."""

from __future__ import annotations

from collections.abc import Iterable

from flightid.conditioning.detrend import chosen_channels
from flightid.record import Record, Step
from flightid.record.checks import REMOVE_OUTLIERS
from flightid.record.outlying import bridge_outliers
from flightid.table import Cell


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
    >>> import numpy as np
    >>> time_s = np.arange(200) * 0.01
    >>> y = np.sin(time_s)
    >>> y[50] += 8.0
    >>> record = Record.from_arrays(time_s, outputs={"y": y})
    >>> cleaned = remove_outliers(record)
    >>> bool(abs(cleaned["y"][50] - np.sin(0.5)) < 1e-4)
    True
    """
    names = record.outputs if channels is None else chosen_channels(record, channels)
    replaced, counts = {}, {}
    for name in names:
        samples, count = bridge_outliers(
            name, record.time_s, record[name], deviations=deviations, half_width=half_width
        )
        if count:
            replaced[name], counts[name] = samples, count
    options: dict[str, Cell] = {"deviations": deviations, "half_width": half_width, **counts}
    return record.replace(replaced, step=Step(REMOVE_OUTLIERS, options))
