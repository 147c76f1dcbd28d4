"""Another sample time for a record that is already uniform."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

from flightid.record import InputShape, Interpolation, Record, Step, to_uniform
from flightid.record.checks import checked_history
from flightid.record.chosen_hold import shape_of
from flightid.record.interpolation import is_coarser, usual_method
from flightid.record.slow_channels import said_of_slow, slow_channels

STILL = (("zero", {"previous"}), ("first", {"linear"}))
"""Ways to a finer base that keep what inputs do between samples."""


def resample(
    record: Record,
    sample_time_s: float,
    *,
    interpolation: Interpolation | str | Mapping[str, Interpolation | str] | None = None,
) -> Record:
    """Bring a record to another sample time, anti-aliased where it becomes coarser.

    Parameters
    ----------
    record : Record
        Data.
    sample_time_s : float
        New sample time, s.
    interpolation : Interpolation or mapping of str to Interpolation, optional
        How samples arise between stamps, for all channels or by name. Default: of inputs that are
        held the previous value, of inputs on straight lines those, of all else band-limited.

    Returns
    -------
    Record
        Copy; starts at the same instant, or the first at which outputs that repeat their values
        have a new one: on a coarser base these are taken at such instants alone. Its hold is
        "band_limited" where inputs were low-passed to a coarser base, as the steps or lines that
        they are known to be, and unknown where steps or lines were broken up.

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
    methods = _methods(record, sample_time_s, interpolation)
    hold = shape_of(record).hold
    rows = {name: (record.time_s, record[name]) for name in record.channels}
    slow = slow_channels(rows, record.outputs, sample_time_s)
    base = to_uniform(
        {**rows, **slow},
        sample_time_s=sample_time_s,
        interpolation=methods,
        hold={} if hold is None else dict.fromkeys(record.inputs, hold),
    )
    step = Step("conditioning.resample", said_of_slow(base.options, slow, sample_time_s))
    time_s = base.only.time_s
    for found in checked_history(record)[len(record.history) :] if slow else ():
        record = record.replace(step=found)
    return record.replace(
        base.only.samples,
        time_s=time_s,
        step=step,
        input_shape=_shape_after(record, sample_time_s, methods),
    )


def _methods(
    record: Record,
    sample_time_s: float,
    asked: Interpolation | str | Mapping[str, Interpolation | str] | None,
) -> dict[str, Interpolation | str]:
    """Interpolation by channel: what was asked for, else what the inputs' hold calls for."""
    if isinstance(asked, str):
        return dict.fromkeys(record.channels, asked)
    usual: dict[str, Interpolation | str] = {
        name: usual_method(
            record.hold if name in record.inputs else None, record.sample_time_s, sample_time_s
        )
        for name in record.channels
    }
    return {**usual, **(asked or {})}


def _shape_after(
    record: Record, sample_time_s: float, methods: Mapping[str, Interpolation | str]
) -> InputShape:
    """Inputs that were low-passed to a coarser base are smooth on it, whatever they were.

    Steps stay steps where a finer base has a sample at every step.
    """
    used = {str(methods[name]) for name in record.inputs}
    known = record.input_shape
    if is_coarser(sample_time_s, record.sample_time_s) and not used & {"previous", "point"}:
        return replace(known, hold="band_limited") if used else known
    ratio = record.sample_time_s / sample_time_s
    nested = abs(ratio - round(ratio)) < 1e-9 * ratio and round(ratio) >= 1
    if nested and (known.hold, used) in STILL:
        return known
    moved = known.on_another_base(record.sample_time_s, sample_time_s)
    return moved if used <= {"band-limited"} else moved.without_hold()
