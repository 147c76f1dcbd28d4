"""Tables of a review: numbers with their intervals, in the units that people fly in."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator

from flightid.findings import ranged
from flightid.review.identity import Battery, FlightIdentity, ModeSpan
from flightid.review.loop_response import LoopResponse
from flightid.review.motors import MotorUse
from flightid.review.vibration import Vibration
from flightid.table import Cell, Column, Table
from flightid.uncertainty.estimate import Estimate, Reading
from flightid.uncertainty.quantiles import interval_words, shown

Rows = tuple[tuple[Cell, ...], ...]
READ = 5
"""Readings of a step, of which those by frequency come behind."""


def battery(found: Battery | None, *, flown: bool) -> Iterable[tuple[Cell, ...]]:
    """Rows of voltage, current and charge: in the air where it flew, else of the whole log."""
    if found is None:
        return
    where = "in the air" if flown else "while logged"
    volts = f"{found.start_v:.4g} V at first, {found.least_v:.4g} V least {where}, "
    yield "battery", f"{volts}{found.end_v:.4g} V at the end"
    if found.cells:
        yield "a cell", f"{found.least_v / found.cells:.3g} V least of {found.cells} in series"
    if found.mean_a is not None and found.most_a is not None:
        yield "current", f"{found.mean_a:.3g} A mean {where}, {found.most_a:.3g} A most"
    if found.used_mah is not None:
        yield "drawn", f"{found.used_mah:.4g} mAh while logged"


def steps(loops: Iterable[LoopResponse]) -> Table:
    """What a step of the set-point would do, of each loop that the flight tells."""
    columns = (
        Column("loop"),
        Column("half way after", "ms"),
        Column("rises in", "ms"),
        Column("overshoots by", "%"),
        Column("settles in", "ms"),
        Column("reaches"),
    )
    told = [loop for loop in loops if loop.is_told]
    rows = tuple(
        (
            loop.name,
            cell(loop["delay to half"], 1e3),
            cell(loop["rise time"], 1e3),
            cell(loop["overshoot"]),
            cell(loop["settling time"], 1e3),
            _level(loop),
        )
        for loop in told
    )
    notes = (
        f"In brackets: {interval_words(shown())} intervals.",
        "Of a set-point that jumps by 1; rise from 10 to 90 % and settling (10 %) are those of the "
        "level that it reaches in the time that is read: the mean of its last fifth. Overshoot is "
        "beyond what is asked where that is within a tenth of it, else beyond the level.",
        *untold_notes((loop.name, each) for loop in told for each in loop.readings[:READ]),
    )
    return Table("Steps, from ordinary flying", columns, rows, notes)


def _level(loop: LoopResponse) -> str | None:
    """The level, and where it is not the last."""
    level, creeps = cell(loop["level"]), loop.creeps
    return f"{level} in {loop.time_s[-1]:.2g} s, {creeps}" if level and creeps else level


def untold_notes(missing: Iterable[tuple[str, Reading]]) -> Iterator[str]:
    """Why numbers are dashes, each reason once.

    Parameters
    ----------
    missing : iterable of tuple of str and Estimate
        Where a number stands, and the number; those that are told go.

    Example
    -------
    >>> late = Estimate[float | None]("rise time", None, "s", reason="too slow")
    >>> list(untold_notes([("roll rate", late), ("yaw rate", late)]))
    ['–: roll rate, yaw rate (rise time): too slow.']
    """
    untold = ((at, each.name, each.reason) for at, each in missing if each.value is None)
    return (f"–: {said}." for said in by_reason(untold))


def by_reason(missing: Iterable[tuple[str, str, str]]) -> Iterator[str]:
    """Places, names and reasons in words, each reason once.

    Example
    -------
    >>> list(by_reason([("roll", "rise time", "too slow"), ("yaw", "rise time", "too slow")]))
    ['roll, yaw (rise time): too slow']
    """
    reasons: dict[str, dict[str, list[str]]] = {}
    for place, name, reason in missing:
        if reason:
            reasons.setdefault(reason, {}).setdefault(place, []).append(name)
    for reason, places in reasons.items():
        alike: dict[str, list[str]] = {}
        for place, names in places.items():
            alike.setdefault(", ".join(names), []).append(place)
        said = "; ".join(f"{', '.join(where)} ({names})" for names, where in alike.items())
        yield f"{said}: {reason}"


def frequencies(loops: Iterable[LoopResponse]) -> Table:
    """Bandwidths, phase delay and tracking of each loop, with what was used for them."""
    columns = (
        Column("loop"),
        Column("phase delay", "ms"),
        Column("gain"),
        Column("-3 dB", "Hz"),
        Column("-90 deg", "Hz"),
        Column("-180 deg", "Hz"),
        Column("tracking error, rms"),
        Column("used", "s", 3),
        Column("at", "Hz", 3),
    )
    rows = []
    used = [loop for loop in loops if loop.used_s]
    for loop in used:
        read = {reading.name.split(" at ")[-1]: reading for reading in loop.readings}
        delay = next((r for r in loop.readings if r.name.startswith("phase delay")), None)
        gain = next((r for r in loop.readings if r.name.startswith("gain")), None)
        wanted = (read.get(name) for name in ("-3 dB", "-90 deg", "-180 deg"))
        rows.append(
            (
                loop.name,
                cell(delay, 1e3),
                cell(gain),
                *map(cell, wanted),
                _in_degrees(loop.tracking),
                loop.used_s,
                loop.rate_hz,
            )
        )
    note = (
        "Phase delay at 2 Hz of rate loops, at 0.5 Hz of attitude loops; gain at half of that. "
        "-3 dB: where a loop first follows with less than 0.71 of what is asked."
    )
    title = "Closed loops by frequency, and tracking"
    why = untold_notes((loop.name, each) for loop in used for each in loop.all_readings[READ:])
    read_any = any(loop.is_told for loop in used)
    untold = [
        f"–: {loop.name}: no step; its verdict says why." for loop in used if not loop.is_told
    ]
    # Where no loop shows a step no column of these is there, and no dash.
    notes = (note, *why, *untold) if read_any else ()
    return Table(title, columns, tuple(rows), notes)


def motors(used: Iterable[MotorUse]) -> Table:
    """Share of the range, balance and time at limits of each motor."""
    columns = (
        Column("motor"),
        Column("mean of its range", "%"),
        Column("more than all", "%"),
        Column("at lower limit", "% of time", 3),
        Column("at upper limit", "% of time", 3),
    )
    rows = tuple(
        (
            motor.name,
            cell(motor.mean, 100.0),
            cell(motor.difference, 100.0),
            100.0 * motor.at_lower,
            100.0 * motor.at_upper,
        )
        for motor in used
    )
    return Table("Motors in the air", columns, rows)


def vibrations(found: Iterable[Vibration]) -> Table:
    """Levels against limits."""
    columns = (
        Column("measure"),
        Column("median", "m/s^2", 3),
        Column("99th percentile", "m/s^2", 3),
        Column("fine below", "m/s^2"),
        Column("trouble above", "m/s^2"),
        Column("samples clipped"),
    )
    listed = tuple(found)
    rows = tuple((v.name, v.median, v.high, v.good.value, v.bad.value, v.clipped) for v in listed)
    notes = tuple(dict.fromkeys(f"Limits: {v.good.source}." for v in listed))
    return Table("Vibration in the air", columns, rows, notes)


def modes(spans: Iterable[ModeSpan]) -> Table:
    """Modes with their spans."""
    columns = (Column("mode"), Column("from", "s", 5), Column("to", "s", 5))
    rows: Rows = tuple((span.mode, span.start_s, span.stop_s) for span in spans)
    return Table("Modes", columns, rows)


def gains(identity: FlightIdentity) -> Table:
    """Flown gains by axis."""
    rows: Rows = tuple(
        (axis, ", ".join(f"{name} {value:.4g}" for name, value in values.items()))
        for axis, values in identity.gains.items()
    )
    changed = identity.changed_gains
    notes = (f"Changed while the log ran: {', '.join(changed)}.",) if changed else ()
    return Table("Flown gains", (Column("axis"), Column("parameters")), rows, notes)


def cell(reading: Reading | Estimate | None, factor: float = 1.0) -> str | None:
    """A value with its interval, as `flightid.findings.ranged` writes it; None: not told.

    Example
    -------
    >>> cell(Estimate("delay", 0.16372, "s", 1e-5), 1e3)
    '163.720 (163.700 to 163.740)'
    """
    if reading is None or reading.value is None:
        return None
    ends = reading.interval(shown())
    if ends is None:
        return f"{factor * reading.value:.3g}"
    low, high = sorted((factor * ends[0], factor * ends[1]))
    return ranged(factor * reading.value, (low, high))


def _in_degrees(tracking: Reading | None) -> str | None:
    if tracking is None or tracking.value is None:
        return None
    unit = "deg/s" if tracking.unit == "rad/s" else "deg"
    return f"{cell(tracking, math.degrees(1.0))} {unit}"
