"""Another sample time for a record that is already uniform."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

from flightid.record import InputShape, Interpolation, Record, Step, to_uniform


def resample(
    record: Record,
    sample_time_s: float,
    *,
    interpolation: Interpolation | str | Mapping[str, Interpolation | str] = "band-limited",
) -> Record:
    """Bring a record to another sample time, anti-aliased where it becomes coarser.

    Parameters
    ----------
    record : Record
        Data.
    sample_time_s : float
        New sample time, s.
    interpolation : Interpolation or mapping of str to Interpolation
        How samples arise between stamps, for all channels or by name (others: band-limited).

    Returns
    -------
    Record
        Copy; starts at the same instant. Its hold is "band_limited" where inputs were low-passed
        to a coarser base, and unknown where steps or lines were broken up.

    Raises
    ------
    OptionError
        `sample_time_s` is not positive.
    DataError
        The record is too short.
    UnknownNameError
        A key of `interpolation` is no channel.

    Reference
    ---------
    Oppenheim & Schafer, Discrete-Time Signal Processing (3rd ed.), section 4.6.

    Example
    -------
    >>> import numpy as np
    >>> time_s = np.arange(400) / 400
    >>> resample(Record.from_arrays(time_s, outputs={"p": np.sin(time_s)}), 0.01)
    Record('record', 100 samples, 100 Hz, 1 s, inputs [], outputs [p])
    """
    base = to_uniform(
        {name: (record.time_s, record[name]) for name in record.channels},
        sample_time_s=sample_time_s,
        interpolation=interpolation,
    )
    step = Step("conditioning.resample", base.options)
    time_s = base.only.time_s
    return record.replace(
        base.only.samples,
        time_s=time_s,
        step=step,
        input_shape=_shape_after(record, sample_time_s, interpolation),
    )


def _shape_after(
    record: Record,
    sample_time_s: float,
    interpolation: Interpolation | str | Mapping[str, Interpolation | str],
) -> InputShape:
    """Inputs that were low-passed to a coarser base are smooth on it, whatever they were."""
    methods = {
        interpolation.get(name, Interpolation.BAND_LIMITED)
        if isinstance(interpolation, Mapping)
        else interpolation
        for name in record.inputs
    }
    known = record.input_shape.on_another_base(record.sample_time_s, sample_time_s)
    if known.hold is None and methods == {"band-limited"} and sample_time_s > record.sample_time_s:
        return replace(known, hold="band_limited")
    return known if methods <= {"band-limited"} else known.without_hold()
