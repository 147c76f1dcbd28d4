"""What was found in the samples of a record when they entered; it travels in the record's history.

Files and logs are examined before anything is resampled, for a filter spreads a spike; a record
that was made from arrays when it is asked for the first time.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence

from flightid.conventions import Light
from flightid.findings import Finding
from flightid.record.angle_units import angle_unit_faults
from flightid.record.channel import Channel
from flightid.record.commanded_edges import Surroundings
from flightid.record.history import NEW_BASES, SPREADS, Step
from flightid.record.interpolation import HALF_LENGTH, NEW_VALUES
from flightid.record.record import Record
from flightid.record.sample_faults import Array, SampleFault, sample_faults
from flightid.table import Cell
from flightid.version import VERSION

CHECK = "Record.check"
ENTRIES = frozenset({"read_records", "Log.record", CHECK})
"""Steps after which a record has been examined."""
REMOVE_OUTLIERS = "conditioning.remove_outliers"
BRIDGED = "deviations"
"""Option of a spike: threshold of outliers that bridges it and no other sample."""
MENDED = {REMOVE_OUTLIERS: "spikes"}
"""What a step takes out of the channels that its options count."""


def fault_steps(faults: Iterable[SampleFault]) -> tuple[Step, ...]:
    """Steps of a history that say what was found."""
    return tuple(
        Step(
            CHECK,
            {
                "channel": fault.channel,
                "start_s": fault.start_s,
                "stop_s": fault.stop_s,
                "code": fault.finding.code,
                "light": str(fault.finding.light),
                "found": fault.finding.message,
                "action": fault.finding.action,
                **({"places_s": _told(fault)} if len(fault.places_s) > 1 else {}),
                **({} if fault.deviations is None else {BRIDGED: fault.deviations}),
            },
            VERSION,
        )
        for fault in faults
    )


def _told(fault: SampleFault) -> str:
    return " ".join(f"{first!r}:{last!r}" for first, last in fault.places_s)


def places_of(options: Mapping[str, Cell]) -> tuple[tuple[float, float], ...]:
    """Where the fault of a step is, s: first and last instant of each place; none: nobody knows.

    Example
    -------
    >>> places_of({"start_s": 1.0, "stop_s": 9.0, "places_s": "1.0:1.0 8.5:9.0"})
    ((1.0, 1.0), (8.5, 9.0))
    >>> places_of({"start_s": 1.0, "stop_s": 9.0}), places_of({"start_s": None, "stop_s": None})
    (((1.0, 9.0),), ())
    """
    start, stop = options["start_s"], options["stop_s"]
    if start is None or stop is None:
        return ()
    pairs = (each.split(":") for each in str(options.get("places_s", "")).split())
    told = tuple((float(first), float(last)) for first, last in pairs)
    return told or ((float(start), float(stop)),)


def entry_steps(
    entering: Sequence[tuple[Channel, Array, Array]],
    beside: Sequence[tuple[Channel, Array, Array]] = (),
) -> tuple[Step, ...]:
    """What channels show as they enter, each on its own stamps, as steps of a history.

    Channels beside them, which nobody takes, bear witness to the units of those that enter.
    """
    around = Surroundings(tuple((c.role, time_s, samples) for c, time_s, samples in entering))
    found = [
        fault
        for channel, time_s, samples in entering
        for fault in sample_faults(
            channel.name, time_s, samples, unit=channel.unit, role=channel.role, around=around
        )
    ]
    known = (*entering, *beside)
    pairs = {channel.name: (time_s, samples) for channel, time_s, samples in known}
    units = {channel.name: channel.unit for channel, _, _ in known}
    taken = [channel.name for channel, _, _ in entering]
    return fault_steps(found + angle_unit_faults(pairs, units, taken))


def checked_history(record: Record) -> tuple[Step, ...]:
    """History of a record with what was found in its own span when it entered, or is found now."""
    if not any(step.operation in ENTRIES for step in record.history):
        channels = [(channel, record.time_s, record[n]) for n, channel in record.channels.items()]
        return (*record.history, *record.once(CHECK, lambda: entry_steps(channels)))
    first, last = float(record.time_s[0]), float(record.time_s[-1])
    reach = math.ceil(HALF_LENGTH) * record.sample_time_s
    return tuple(
        step
        for step in record.history
        if step.operation != CHECK
        or _touches(step, first, last, reach if _is_spread(record.history, step) else 0.0)
    )


def _touches(step: Step, first_s: float, last_s: float, reach_s: float) -> bool:
    places = places_of(step.options) or ((0.0, 0.0),)
    return any(stop + reach_s >= first_s and start - reach_s <= last_s for start, stop in places)


def _is_spread(history: Sequence[Step], check: Step) -> bool:
    """Whether a filter spread what was found of a channel over its length."""
    channel = str(check.options["channel"])
    made = [str(s.options.get(channel)) for s in history if s.operation in NEW_BASES]
    return any(said.startswith(SPREADS) for said in made)


def data_findings(
    history: Sequence[Step], channels: Iterable[str] | None = None
) -> tuple[Finding, ...]:
    """Findings that a history holds on some channels.

    Parameters
    ----------
    history : sequence of Step
        Of a record, by `checked_history`, or of a response.
    channels : iterable of str, optional
        Default: all.

    Returns
    -------
    tuple of Finding

    Example
    -------
    >>> import numpy as np
    >>> t = np.arange(400) / 100
    >>> y = np.sin(3 * t) + 50.0 * (t == 2.0)
    >>> record = Record.from_arrays(t, outputs={"y": y})
    >>> [finding.code for finding in data_findings(checked_history(record))]
    ['spikes']
    """
    wanted = None if channels is None else set(channels)
    found: dict[tuple[str, str, str], Finding] = {}
    for step in history:
        options, mended = step.options, MENDED.get(step.operation)
        found = {
            key: one
            for key, one in found.items()
            if not (key[0] == mended and key[1] in options) and not _is_thinned(step, *key[:2])
        }
        if step.operation != CHECK or (wanted is not None and options["channel"] not in wanted):
            continue
        code, channel, said = (str(options[key]) for key in ("code", "channel", "found"))
        light = Light(str(options["light"]))
        found[code, channel, said] = Finding(code, light, said, str(options["action"] or ""))
    return tuple(found.values())


def _is_thinned(step: Step, code: str, channel: str) -> bool:
    """Whether a step left the new values of a channel that repeats them, and no others."""
    said = str(step.options.get(channel, ""))
    return code == "samples-repeated" and step.operation in NEW_BASES and said.endswith(NEW_VALUES)


def record_findings(record: Record, channels: Iterable[str] | None = None) -> tuple[Finding, ...]:
    """Findings on the samples of a record in its own span."""
    return data_findings(checked_history(record), channels)
