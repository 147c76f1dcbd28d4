"""From a log to a record: mapped channels on one time base, with the injected signal of a run."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from flightid._native import cubic_spline
from flightid.conventions import Role
from flightid.errors import DataError, MissingColumnError
from flightid.logs.blackbox.settings import loop_step_s
from flightid.logs.channels.channel_map import (
    ChannelMap,
    ChannelSource,
    MappedChannel,
    channel_map,
    default_map,
)
from flightid.logs.contents import LogContents
from flightid.logs.dataflash.sid_runs import SidRun
from flightid.logs.extraction import ChannelSamples, extract, find
from flightid.logs.scale_check import check_scales
from flightid.logs.self_check import InjectionCheck, check_injection, chirp_clock, paired_rows
from flightid.record import Channel, InputShape, Record, Step
from flightid.record.checks import entry_steps, fault_steps
from flightid.record.hold import InputHold
from flightid.record.interpolation import is_coarser
from flightid.record.sample_faults import SampleFault
from flightid.record.timebase import GapPolicy, to_uniform
from flightid.table import Cell
from flightid.units import convert

EXCITATION = "excitation"
STEADY = "zero", "first"
"""Holds that a low-pass to a coarser base takes away."""
EDGE_STEPS = 3.0
"""Steps of its own by which a channel may begin late or end early and still cover a span."""
OWN_STAMPS = 1e-3
"""Largest relative difference of a record's sample time from that of a channel that it copies."""
EVERY_LOOP = 0.1
"""Relative difference of a log's step from that of a loop, for jitter of its stamps."""
SI = {"deg": "rad", "deg/s": "rad/s"}


def make_record(
    log: LogContents,
    channels: ChannelMap | str | Path | None,
    names: Iterable[str] | None,
    span_s: tuple[float, float] | None,
    run: SidRun | None,
    sample_rate_hz: float | None,
    roles: Mapping[str, Role | str] | None,
    gaps: GapPolicy | str,
    max_gap_s: float | None,
    name: str | None,
    declared: InputShape,
) -> Record:
    """See `Log.record`."""
    chosen = _chosen(log, channels, names).with_roles(roles or {})
    if run is not None and span_s is None:
        span_s = run.chirp_span_s
    found, left_out = _found(log, chosen, span_s, required=names is not None)
    check = None
    if run is not None:
        check = check_injection(log, run)
        found.append(_excitation(log, run, check))
    reference = None if sample_rate_hz is not None else _reference(found)
    base = to_uniform(
        {item.channel.name: (item.time_s, item.values) for item in found},
        sample_time_s=None if sample_rate_hz is None else 1.0 / sample_rate_hz,
        reference=reference,
        span_s=_snapped(found, reference, span_s),
        gaps=gaps,
        max_gap_s=max_gap_s,
        hold=_filled(declared, found),
    )
    span = base.only
    record = Record.from_arrays(
        span.time_s,
        **{  # type: ignore[arg-type]
            group: {
                i.channel.name: span.samples[i.channel.name]
                for i in found
                if i.channel.role == role
            }
            for group, role in (
                ("inputs", Role.INPUT),
                ("outputs", Role.OUTPUT),
                ("excitations", Role.EXCITATION),
                ("others", Role.OTHER),
            )
        },
        units={item.channel.name: item.channel.unit for item in found},
        name=name or log.path.stem,
    )
    ordered = [item for role in Role for item in found if item.channel.role == role]
    labels = [Channel(i.channel.name, i.channel.unit, i.channel.role, i.note) for i in ordered]
    options: dict[str, Cell] = {"log": log.path.name, "map": chosen.title, **base.options}
    options |= {"left_out": ", ".join(left_out) or None}
    if check is not None:
        options |= {"sid_run": repr(run), "injection": str(check.findings[0])}
    shape = _input_shape(log, declared, chosen, found, base.sample_time_s)
    made = record.replace(channels=labels, step=Step("Log.record", options), input_shape=shape)
    entering = [(c, i.time_s, i.values) for c, i in zip(labels, ordered, strict=True)]
    inside = float(span.time_s[0]), float(span.time_s[-1])
    scales = [
        SampleFault(check.quantity, *inside, check.finding)
        for check in check_scales(log, chosen, inside)
        if check.finding is not None
    ]
    for step in (*entry_steps(entering), *fault_steps(scales)):
        made = made.replace(step=step)
    return made


def _filled(declared: InputShape, found: list[ChannelSamples]) -> dict[str, InputHold]:
    """What inputs do between their own samples, for a low-pass to a coarser base."""
    if declared.hold is None:
        return {}
    names = (item.channel.name for item in found if item.channel.role == Role.INPUT)
    return dict.fromkeys(names, declared.hold)


def _input_shape(
    log: LogContents,
    declared: InputShape,
    chosen: ChannelMap,
    found: list[ChannelSamples],
    step_s: float,
) -> InputShape:
    """What is declared, after a low-pass; else what the map knows, where nothing is resampled.

    Of a controller whose loops were not all logged nothing is known between the rows.
    """
    inputs = [item for item in found if item.channel.role == Role.INPUT]
    if declared.hold in STEADY and any(is_coarser(step_s, item.interval_s) for item in inputs):
        # Steps and lines that a low-pass went over are none any more; beside others, neither.
        every = all(is_coarser(step_s, item.interval_s) for item in inputs)
        return replace(declared, hold="band_limited" if every else None)
    if declared.hold is not None or chosen.hold is None:
        return declared
    loop_s = loop_step_s(log.parameters)
    if loop_s is not None and abs(step_s / loop_s - 1.0) > EVERY_LOOP:
        return declared
    own = all(abs(item.interval_s / step_s - 1.0) < OWN_STAMPS for item in inputs)
    return replace(declared, hold=chosen.hold) if own else declared


def _chosen(
    log: LogContents, channels: ChannelMap | str | Path | None, names: Iterable[str] | None
) -> ChannelMap:
    if channels is None:
        chosen = default_map(log.kind, log.vehicle)
    elif isinstance(channels, ChannelMap):
        chosen = channels
    else:
        chosen = channel_map(channels)
    if names is not None:
        return chosen.select(names)
    return replace(chosen, channels=tuple(c for c in chosen.channels if not c.on_request))


def _not_in_span(
    log: LogContents, channel: MappedChannel, span_s: tuple[float, float] | None
) -> DataError:
    """That a channel ends before a span begins, or begins behind it; or was never sampled."""
    whole = extract(log, channel, None)
    message = whole.source.message
    if span_s is None or whole.time_s.size < 2:
        return DataError(f"channel {channel.name!r} has no samples", needed=f"rows of {message}")
    first, last = float(whole.time_s[0]), float(whole.time_s[-1])
    return DataError(
        f"channel {channel.name!r} has no samples in the span",
        found=f"{message} from {first:.1f} to {last:.1f} s",
        needed=f"samples from {span_s[0]:g} to {span_s[1]:g} s",
        action="copy the log again where it is cut off, else name a span inside it",
    )


def _found(
    log: LogContents, chosen: ChannelMap, span_s: tuple[float, float] | None, *, required: bool
) -> tuple[list[ChannelSamples], list[str]]:
    """Channels that the log holds; the others by name with the reason, unless they are required.

    A channel that does not decide on the sample time may not cut the span either: it is left out
    where it does not cover what the deciding ones cover.
    """
    found, left_out = [], []
    for channel in chosen.channels:
        if find(log, channel) is None and not required:
            left_out.append(f"{channel.name} (not logged)")
            continue
        item = extract(log, channel, span_s)
        if item.time_s.size < 2:
            if required:
                raise _not_in_span(log, channel, span_s)
            left_out.append(f"{channel.name} (no samples in the span)")
            continue
        found.append(item)
    if found and not required:
        begin, end = _core_span(found)
        for item in [i for i in found if not i.channel.sets_rate]:
            slack = EDGE_STEPS * item.interval_s
            if item.time_s[0] > begin + slack or item.time_s[-1] < end - slack:
                left_out.append(f"{item.channel.name} (does not cover the span)")
                found.remove(item)
    roles = {item.channel.role for item in found}
    if not {Role.INPUT, Role.OUTPUT} <= roles and not required:
        raise MissingColumnError(
            "the log does not hold an input and an output of its channel map",
            found=", ".join(left_out) + " left out",
            needed="at least one of each",
            action="name another map, or read columns with Log.table",
        )
    return found, left_out


def _core_span(found: list[ChannelSamples]) -> tuple[float, float]:
    core = [item for item in found if item.channel.sets_rate] or found
    return max(float(i.time_s[0]) for i in core), min(float(i.time_s[-1]) for i in core)


def _reference(found: list[ChannelSamples]) -> str:
    """The slowest channel among those that decide on the sample time."""
    core = [item for item in found if item.channel.sets_rate] or found
    return max(core, key=lambda item: item.interval_s).channel.name


def _snapped(
    found: list[ChannelSamples], reference: str | None, span_s: tuple[float, float] | None
) -> tuple[float, float] | None:
    """Span that begins on a stamp of the reference, so that it is copied, not interpolated.

    A span that the channels miss by more than their own steps is left as it is, to be refused.
    """
    begin = max(float(item.time_s[0]) for item in found)
    end = min(float(item.time_s[-1]) for item in found)
    if span_s is not None:
        slack = EDGE_STEPS * max(item.interval_s for item in found)
        if begin > span_s[0] + slack or end < span_s[1] - slack:
            return span_s
        begin, end = max(begin, span_s[0]), min(end, span_s[1])
    if reference is None:
        return None if span_s is None else (begin, end)
    stamps = next(item.time_s for item in found if item.channel.name == reference)
    after = stamps[stamps >= begin]
    return (float(after[0]), end) if after.size and after[0] < end else span_s


def _excitation(log: LogContents, run: SidRun, check: InjectionCheck) -> ChannelSamples:
    """The injected signal at the instants when it acted, as far as that is proven.

    The mode logs the chirp at the end of the loop before the one that uses it. Where the self-check
    proves the delay, the chirp is shifted by it onto the stamps of RATE, which are those of the
    gyroscope; otherwise it keeps the stamps with which it was written.
    """
    stamp_s, clock_s, signal = chirp_clock(log, run)
    note = "as logged; its delay to the mixer is not proven"
    if check.is_proven and check.injected is not None:
        rates = log.table("RATE").time_s
        rows, of_chirp = paired_rows(rates, stamp_s, check.loop_time_s)
        at_s = clock_s[of_chirp] - check.injected.lag_s
        inside = at_s >= clock_s[0]
        stamp_s = rates[rows][inside]
        signal = check.sign * cubic_spline(clock_s, signal, at_s[inside])
        note = f"shifted by {check.injected.lag_loops:.2g} loops to when the mixer got it (proven)"
    unit = SI.get(run.unit, run.unit)
    channel = MappedChannel(EXCITATION, unit, Role.EXCITATION, False, False, ())
    source = ChannelSource("SIDD", ("Targ",), note=note)
    return ChannelSamples(channel, source, stamp_s, _in_unit(signal, run.unit, unit))


def _in_unit(signal: NDArray[np.float64], source: str, target: str) -> NDArray[np.float64]:
    return signal if source == target else convert(signal, source, target)
