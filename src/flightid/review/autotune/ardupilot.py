"""ArduCopter's autotune: twitches in ATUN and ATDE, events and messages."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from flightid.control.autopilots import AXES
from flightid.control.autopilots.parameter_table import parameter_entries
from flightid.conventions import Light
from flightid.findings import Finding
from flightid.inspection.signals import Span
from flightid.inspection.stamps import believable
from flightid.logs import Log
from flightid.review.autotune.run import AutotuneRun, TuneStep

Array = NDArray[np.float64]
STEPS = {0: "rate D up", 1: "rate D down", 2: "rate P up"}
LATER_STEPS = {3: "rate FF up", 4: "angle P down", 5: "angle P up"}
EARLIER_STEPS = {3: "angle P down", 4: "angle P up"}
"""Until 4.3 the angle's steps followed the rate's at once."""
SUCCEEDED, FAILED, SAVED = 33, 34, 37
MOST_P, MOST_D = 2.0, 0.2
"""AUTOTUNE_RP_MAX and AUTOTUNE_RD_MAX of AC_AutoTune_Multi.cpp."""
AT_END = 1.02
LEAST_D = 0.001
YAW_I_RATIO = 0.1
APART_S, LONGEST_WAIT_S = 0.1, 15.0
NO_ANSWER, SHORT_OF = 0.2, 0.8
"""Of the target: what is no answer, and the 80 % below which a twitch cannot be judged."""
STORED_TWICE = 5.0
"""Targets are 15 deg/s or more; until 4.1 the log declared a factor of 0.01 too much."""


def ardupilot_run(log: Log) -> AutotuneRun | None:
    """Read ArduCopter's autotune; None where the log holds none."""
    flown = any(e.kind == "mode" and "AUTOTUNE" in e.text for e in log.events)
    if "ATUN" not in log:
        if not flown:
            return None
        return AutotuneRun("arducopter", (), {}, {}, False, tuple(_no_tests(log)))
    table = log.table("ATUN")
    good = believable(table.time_s)
    axis = np.minimum(table["Axis"][good].astype(int), 2)
    number = table["TuneStep"][good].astype(int)
    targets = table["Targ"][good]
    scale = 100.0 if np.median(targets[number <= 2], axis=None) < STORED_TWICE else 1.0
    seen = {
        name: scale * table[field][good]
        for name, field in (("target", "Targ"), ("least", "Min"), ("most", "Max"))
    }
    values = {
        role: table[name][good] for role, name in (("p", "RP"), ("d", "RD"), ("angle_p", "SP"))
    }
    words = STEPS | (EARLIER_STEPS if 3 in number else LATER_STEPS)
    steps = tuple(_steps(axis, number, seen, words))
    gains = {AXES[k]: _gains(AXES[k], axis == k, values) for k in sorted(set(axis.tolist()))}
    events = _events(log)
    finished = SUCCEEDED in events
    return AutotuneRun(
        "arducopter", steps, _twitches(log, table.time_s[good], axis), gains, finished,
        tuple(_judged(log, events, axis, number, seen, values)),
    )  # fmt: skip


def _events(log: Log) -> list[int]:
    return [] if "EV" not in log else log.table("EV")["Id"].astype(int).tolist()


def _steps(
    axis: Array, number: Array, seen: Mapping[str, Array], words: Mapping[int, str]
) -> Iterator[TuneStep]:
    """Runs of tests of one kind, in order."""
    edges = np.flatnonzero((np.diff(axis) != 0) | (np.diff(number) != 0)) + 1
    for rows in np.split(np.arange(axis.size), edges):
        last = rows[-1]
        kind = words.get(int(number[last]), f"step {number[last]}")
        yield TuneStep(
            AXES[int(axis[last])], kind, rows.size,
            *(float(seen[name][last]) for name in ("target", "most", "least")),
        )  # fmt: skip


def _gains(axis: str, rows: NDArray[np.bool_], values: Mapping[str, Array]) -> dict[str, float]:
    """Last gains under their names; the integral follows P, of yaw a tenth, D is its filter."""
    last = {role: float(column[rows][-1]) for role, column in values.items()}
    last["i"] = last["p"] * (YAW_I_RATIO if axis == "yaw" else 1.0)
    if axis == "yaw":
        last["flte"] = last.pop("d")
    entries = parameter_entries("arducopter", axis)
    return {entry.name: last[entry.role] for entry in entries if entry.role in last}


def _twitches(log: Log, ends_s: Array, axis: Array) -> dict[str, tuple[Span, ...]]:
    """Each burst of details ends with its row of ATUN, which names the axis."""
    if "ATDE" not in log:
        return {}
    stamps = log.table("ATDE").time_s
    stamps = stamps[believable(stamps)]
    bursts = np.split(stamps, np.flatnonzero(np.diff(stamps) > APART_S) + 1)
    found: dict[str, list[Span]] = {}
    for burst in bursts:
        if burst.size < 2:
            continue
        after = int(np.searchsorted(ends_s, burst[-1] - APART_S))
        name = AXES[int(axis[min(after, axis.size - 1)])]
        found.setdefault(name, []).append((float(burst[0]), float(burst[-1])))
    return {name: tuple(spans) for name, spans in found.items()}


def _texts(log: Log) -> list[str]:
    return [e.text for e in log.events if e.kind == "text" and e.text.startswith("AutoTune")]


def _no_tests(log: Log) -> Iterator[Finding]:
    yield Finding(
        "autotune-no-tests",
        Light.RED,
        "autotune was flown, and not one twitch is in the log",
        "let go of the sticks in still air: it waits until the vehicle is level and untouched",
    )
    yield from _interruptions(log)


def _interruptions(log: Log) -> Iterator[Finding]:
    said = _texts(log)
    if any("Level" in text or "WFL" in text for text in said):
        yield Finding(
            "autotune-not-level",
            Light.AMBER,
            "it waited for the vehicle to be level: "
            + next(t for t in said if "Level" in t or "WFL" in t),
            "fly in still air; lower gains that oscillate, raise gains that let it drift",
        )
    if any("Override" in text for text in said):
        yield Finding(
            "autotune-pilot",
            Light.AMBER,
            "the pilot's sticks interrupted it",
            "leave the sticks centred, and check their trim and dead zone",
        )


def _judged(
    log: Log,
    events: Sequence[int],
    axis: Array,
    number: Array,
    seen: Mapping[str, Array],
    values: Mapping[str, Array],
) -> Iterator[Finding]:
    if FAILED in events:
        yield Finding("autotune-failed", Light.RED, "the autopilot called it a failure")
    elif SUCCEEDED not in events:
        yield Finding(
            "autotune-unfinished",
            Light.AMBER,
            f"it did not finish: the last test was on {AXES[int(axis[-1])]}",
            "leave it time: an axis takes some minutes; AUTOTUNE_AXES 1, 2 or 4 tunes one",
        )
    elif SAVED not in events:
        yield Finding(
            "autotune-not-saved",
            Light.AMBER,
            "it succeeded, and its gains were not saved",
            "land and disarm with the switch still in autotune's position",
        )
    yield from _interruptions(log)
    if "ATDE" in log:
        waits = np.diff(log.table("ATDE").time_s)
        longest = float(waits.max(initial=0.0))
        if longest > LONGEST_WAIT_S:
            yield Finding(
                "autotune-waited",
                Light.AMBER,
                f"it waited up to {longest:.0f} s between twitches to be level or left alone",
                "fly in still air, sticks centred",
            )
    least_d = log.parameters.get("AUTOTUNE_MIN_D", LEAST_D)
    for k in sorted(set(axis.tolist())):
        rows = axis == k
        yield from _of_axis(AXES[int(k)], rows, number, seen, values, least_d)


def _of_axis(
    axis: str,
    rows: NDArray[np.bool_],
    number: Array,
    seen: Mapping[str, Array],
    values: Mapping[str, Array],
    least_d: float,
) -> Iterator[Finding]:
    """What the tests and the ends of the gains tell of one axis."""
    share = seen["most"][rows] / seen["target"][rows]
    p, d = (float(values[role][rows][-1]) for role in ("p", "d"))
    if float(np.median(share)) < NO_ANSWER:
        yield Finding(
            f"autotune-no-response-{axis}",
            Light.RED,
            f"{axis}: twitches reach {100 * np.median(share):.0f} % of their target: the vehicle "
            "hardly answers",
            "look for motors at their limits, too much weight, or a wrong motor order",
        )
    elif p >= MOST_P / AT_END:
        yield Finding(
            f"autotune-target-not-reached-{axis}",
            Light.RED,
            f"{axis}: rate P stands at its end, {p:.3g}, and the target was not reached",
            "less weight or more powerful motors; do not fly such gains",
        )
    if axis == "yaw":
        return
    if d <= least_d * AT_END:
        yield Finding(
            f"autotune-noise-{axis}",
            Light.AMBER,
            f"{axis}: D fell to its least, {d:.3g}: what bounced back after each twitch was more "
            "than AUTOTUNE_AGGR, by noise or by a late vehicle",
            "filter the gyro first (flightid flight LOG shows its noise), then tune again",
        )
    elif d >= MOST_D / AT_END:
        yield Finding(
            f"autotune-bounce-not-reached-{axis}",
            Light.RED,
            f"{axis}: D stands at its end, {d:.3g}: twitches never bounced back",
            "do not fly such gains: the vehicle is slower than autotune can see",
        )
    last_rate = np.flatnonzero(rows & (number <= 2))
    if last_rate.size:
        k = int(last_rate[-1])
        if SHORT_OF > seen["most"][k] / seen["target"][k] >= NO_ANSWER:
            yield Finding(
                f"autotune-short-{axis}",
                Light.AMBER,
                f"{axis}: the last rate twitch reached {seen['most'][k]:.3g} of "
                f"{seen['target'][k]:.3g} deg/s",
                "its P is still too low for autotune's own test: let it go on",
            )
