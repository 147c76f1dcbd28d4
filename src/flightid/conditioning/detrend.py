"""Removal of mean, line or trim value."""

from __future__ import annotations

from collections.abc import Iterable
from enum import StrEnum

import numpy as np

from flightid.errors import DataError, OptionError
from flightid.record import Record, Step
from flightid.table import Cell


class Trend(StrEnum):
    """What is removed: the mean, the least-squares line, or the declared trim value.

    Example
    -------
    >>> [kind.value for kind in Trend]
    ['mean', 'line', 'trim']
    """

    MEAN = "mean"
    LINE = "line"
    TRIM = "trim"


def chosen_channels(record: Record, channels: Iterable[str] | None) -> list[str]:
    """Names of the channels an operation acts on: all of them, or those named.

    Raises
    ------
    UnknownNameError
        There is no such channel.
    """
    names = list(record.channels) if channels is None else list(channels)
    for name in names:
        record.unit(name)
    return names


def detrend(
    record: Record, kind: Trend | str = Trend.MEAN, *, channels: Iterable[str] | None = None
) -> Record:
    """Remove the mean, the least-squares line or the trim value; what was removed is in history.

    Parameters
    ----------
    record : Record
        Data.
    kind : Trend
        ``"mean"``, ``"line"`` or ``"trim"``.
    channels : iterable of str, optional
        Channels to act on; default: all.

    Returns
    -------
    Record
        Copy; the history holds each removed level (in the channel's unit) and, for lines, slope
        (unit per s, about the middle of the record).

    Raises
    ------
    OptionError
        `kind` is not known.
    DataError
        No trim value was declared for a channel.
    UnknownNameError
        There is no such channel.

    Reference
    ---------
    Bendat & Piersol, Random Data (4th ed.), chapter 10 (trend removal).

    Example
    -------
    >>> record = Record.from_arrays([0.0, 0.1, 0.2], outputs={"p": [1.0, 2.0, 6.0]})
    >>> detrend(record)["p"]
    array([-2., -1.,  3.])
    """
    try:
        trend = Trend(kind)
    except ValueError:
        raise OptionError(
            "trend is not known", found=repr(kind), needed="'mean', 'line' or 'trim'"
        ) from None
    options: dict[str, Cell] = {"kind": str(trend)}
    samples = {}
    middle = record.time_s - record.time_s.mean()
    for name in chosen_channels(record, channels):
        values = record[name]
        level = float(values.mean())
        if trend is Trend.TRIM:
            if name not in record.trim:
                raise DataError(
                    f"channel {name!r} has no trim value",
                    needed="a trim value for every channel acted on",
                    action="declare a trim with the record, or name the channels",
                )
            level = record.trim[name]
        samples[name] = values - level
        options[f"{name}_level"] = level
        if trend is Trend.LINE:
            slope = float(np.dot(middle, values) / np.dot(middle, middle))
            samples[name] = samples[name] - slope * middle
            options[f"{name}_slope_per_s"] = slope
    return record.replace(samples, step=Step("conditioning.detrend", options))
