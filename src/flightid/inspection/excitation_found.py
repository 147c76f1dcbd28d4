"""What moved the vehicle: injected sweeps, autotune, sweeps and steps of set-points, a pilot."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from flightid.frozen import dataclass
from flightid.inspection.axes import axes_of
from flightid.inspection.rate_chirps import chirps
from flightid.inspection.signals import Signal, Span, find, place_of
from flightid.inspection.stamps import log_span
from flightid.inspection.thresholds import RESTING_RATE
from flightid.logs import Log, SidRun

PX4_AUTOTUNE = {2: "roll", 4: "pitch", 6: "yaw"}
"""State of autotune_attitude_control_status while an axis is excited."""
AUTOMATIC = {
    *("AUTO", "GUIDED", "RTL", "LAND", "CIRCLE", "SMART_RTL", "BRAKE", "THROW", "AVOID_ADSB"),
    *(
        "GUIDED_NOGPS",
        "RTH",
        "WP",
        "FOLLOW",
        "AUTOROTATE",
        "DESCEND",
        "TERMINATION",
        "OFFBOARD",
        "ORBIT",
    ),
}
"""Modes in which no stick moves the vehicle, besides those named AUTO_…, of all autopilots."""
PLANE_AUTOMATIC = {"LOITER", "TAKEOFF", "QLAND", "QRTL", "THERMAL", "LOITER_ALT_QLAND"}
"""ArduPlane's own: a copter's LOITER is flown by stick."""
SEARCHED = ("sid", "chirp", "sweep", "autotune")
"""Excitations from which a model may be tried."""
WORDS = {"sid": "injected sweep", "steps": "steps", "flying": "plain flying", "hand": "by hand"}
SWEEP_RATIO, SWEEP_CYCLES, SWEEP_ORDER = 3.0, 8, 0.9
"""Last frequency over the first, cycles and rank correlation from which a set-point sweeps."""
HALF_PERIOD = 0.3
"""Share of the height that nine in ten stay below from which a half period counts."""
ENDS = 8
"""Of the half periods one in so many, at either end, tells where a sweep begins and ends."""
FEWEST_ROWS = 20
"""Samples of a set-point without which nothing is looked for."""
GRID_S, FEWEST_ON_GRID = 0.02, 40
"""Step in which jumps are looked for, s, and the shortest stretch in such steps."""
WITHIN, HELD = 5, 15
"""Steps of that grid within which a set-point jumps, and for which it then stands."""
JUMP, STANDS = 0.4, 0.1
"""Share of the whole height from which it jumps, and within which it stands."""
MIDDLE = (2, 98)
"""Percentiles between which a set-point's height is told: a spike is none."""


@dataclass(frozen=True)
class FoundExcitation:
    """A stretch of a log in which something excited an axis.

    Attributes
    ----------
    kind : str
        ``"sid"``, ``"autotune"``, ``"chirp"`` (of Betaflight or INAV, in a rate's
        set-point), ``"sweep"``, ``"steps"``; plain flying by ``"pilot"`` or
        ``"autopilot"``, ``"flying"`` where both did or the log does not tell; ``"hand"`` on the
        ground.
    axis : str
        ``"roll"``, ``"pitch"``, ``"yaw"``, or another injection point in words.
    start_s, stop_s : float
        Span, s.
    detail : str
        Settings or measures with units.
    """

    kind: str
    axis: str
    start_s: float
    stop_s: float
    detail: str

    @property
    def words(self) -> str:
        """The kind as people say it."""
        return WORDS.get(self.kind, self.kind)

    @property
    def is_injected(self) -> bool:
        """Whether the autopilot made it, so that it is independent of what the sensors read."""
        return self.kind in ("sid", "autotune", "chirp")

    @property
    def is_sweep(self) -> bool:
        """Whether a model may be tried from it."""
        return self.kind in SEARCHED

    @property
    def is_plain(self) -> bool:
        """Whether it is plain flying, no manoeuvre that was made for identification."""
        return self.kind in ("pilot", "autopilot", "flying")


def excitations(log: Log, spans: tuple[Span, ...]) -> tuple[FoundExcitation, ...]:
    """Everything that excited the vehicle, injected runs first.

    Looks in the spans in the air; without any, in the whole log.
    """
    found = [*map(_injected, log.sid_runs), *_chirped(log), *_autotune(log)]
    flying = bool(spans)
    spans = spans or (log_span(log),)
    for axis, names in axes_of(log.vehicle).items():
        asked = [s for s in spans if not any(e.is_injected and _overlap(s, e) for e in found)]
        # One signal after the other: of a long log two are much to hold.
        set_point = find(log, names.set_point) if asked else None
        shapes = [_shape(set_point, axis, span) for span in asked]
        del set_point
        rate = find(log, names.rate) if None in shapes else None
        for span, shape in zip(asked, shapes, strict=True):
            moved = _plain(log, span) if flying else ("hand", "moved on the ground")
            manoeuvre = shape or _motion(rate, axis, span, *moved)
            found += [manoeuvre] if manoeuvre is not None else []
    return tuple(found)


def injected_spans(log: Log) -> list[Span]:
    """Spans of sweeps that the autopilot made: of its own mode, or chirps of Betaflight."""
    runs = [(run.start_s, run.stop_s) for run in log.sid_runs]
    return runs or [each.span_s for each in chirps(log)]


def _chirped(log: Log) -> list[FoundExcitation]:
    return [
        FoundExcitation(
            "chirp", each.axis, *each.span_s,
            f"rate set-point, {each.low_hz:.3g} to {each.high_hz:.3g} Hz, {each.size_deg_s:.3g} "
            "deg/s at most",
        )
        for each in chirps(log)
    ]  # fmt: skip


def _overlap(span: Span, excitation: FoundExcitation) -> bool:
    return excitation.start_s < span[1] and excitation.stop_s > span[0]


def _injected(run: SidRun) -> FoundExcitation:
    """A run of ArduPilot's system identification mode."""
    axis = str(run.body_axis) if run.body_axis is not None else run.point
    unit = "" if run.unit == "1" else f" {run.unit}"
    return FoundExcitation(
        "sid",
        axis,
        *run.chirp_span_s,
        f"{run.point}, SID_AXIS {run.axis}, amplitude {run.magnitude:.3g}{unit}, "
        f"{run.f_start_hz:.3g} to {run.f_stop_hz:.3g} Hz"
        + ("" if run.is_complete else ", broken off"),
    )


def _autotune(log: Log) -> list[FoundExcitation]:
    name = "autotune_attitude_control_status"
    if name in log and "state" in log.messages[name].fields:
        table = log.table(name, log.messages[name].instances[0])
        found = []
        for state, axis in PX4_AUTOTUNE.items():
            stamps = table.time_s[table["state"] == state]
            if stamps.size > 1:
                found.append(
                    FoundExcitation(
                        "autotune", axis, float(stamps[0]), float(stamps[-1]), "PX4 autotune"
                    )
                )
        return found
    if "ATUN" in log:
        stamps = log.table("ATUN").time_s
        start, stop = float(stamps.min()), float(stamps.max())
        return [FoundExcitation("autotune", "roll, pitch or yaw", start, stop, "twitches")]
    return []


def _shape(signal: Signal | None, axis: str, span: Span) -> FoundExcitation | None:
    """Sweep or steps in a set-point."""
    if signal is None:
        return None
    part = place_of(signal.time_s, [span])
    stamps, values = signal.time_s[part], signal.values[part]
    if stamps.size < FEWEST_ROWS or np.std(values) < RESTING_RATE.value:
        return None
    centred = values - np.median(values)
    sweep = _sweep(stamps, centred)
    if sweep is not None:
        return FoundExcitation(
            "sweep", axis, span[0], span[1], f"set-point from {sweep[0]:.2g} to {sweep[1]:.2g} Hz"
        )
    steps = _steps(stamps, centred)
    if steps >= 2:
        return FoundExcitation("steps", axis, span[0], span[1], f"{steps} steps of the set-point")
    return None


def _sweep(stamps: NDArray[np.float64], values: NDArray[np.float64]) -> tuple[float, float] | None:
    """First and last frequency, Hz, where the half periods shrink (or grow) steadily."""
    level = HALF_PERIOD * float(np.percentile(np.abs(values), 90, overwrite_input=True))
    state = (values > level).astype(np.int8) - (values < -level)
    known = np.flatnonzero(state)
    turns = known[1:][np.diff(state[known]) != 0]
    if turns.size < 2 * SWEEP_CYCLES:
        return None
    frequency = 0.5 / np.diff(stamps[turns])
    order = np.corrcoef(np.arange(frequency.size), np.argsort(np.argsort(frequency)))[0, 1]
    tail = max(1, frequency.size // ENDS)
    first, last = float(np.median(frequency[:tail])), float(np.median(frequency[-tail:]))
    if abs(order) < SWEEP_ORDER or max(first, last) < SWEEP_RATIO * min(first, last):
        return None
    return first, last


def _steps(stamps: NDArray[np.float64], values: NDArray[np.float64]) -> int:
    """Number of jumps within 0.1 s to a level that is then held for 0.3 s."""
    grid = np.arange(stamps[0], stamps[-1], GRID_S)
    if grid.size < FEWEST_ON_GRID:
        return 0
    level = np.interp(grid, stamps, values)
    height = float(np.ptp(np.percentile(level, MIDDLE)))
    jump = np.abs(level[WITHIN:] - level[:-WITHIN]) > JUMP * height
    ahead = np.lib.stride_tricks.sliding_window_view(level[WITHIN:], HELD)
    flat = np.ptp(ahead, axis=1) < STANDS * height
    landed = jump[: flat.size] & flat
    return int(np.count_nonzero(np.diff(landed.astype(np.int8)) == 1))


def _plain(log: Log, span: Span) -> tuple[str, str]:
    """Who flew a span by the modes that the log tells: kind of excitation, and words for it."""
    told = [e for e in log.events if e.kind == "mode" and e.time_s is not None]
    before = [e for e in told if e.time_s is not None and e.time_s <= span[0]]
    since = [e for e in told if e.time_s is not None and span[0] < e.time_s <= span[1]]
    # A log that begins in the air writes its first mode a moment after its first sample.
    modes = [e.text.split(" ")[0] for e in (*before[-1:], *since)]
    if not modes:
        return "flying", "plain flying"
    by_itself = {_is_automatic(mode, log.vehicle) for mode in modes}
    names = " and ".join(dict.fromkeys(modes))
    if by_itself == {True}:
        return "autopilot", f"the autopilot's own flying ({names})"
    return ("pilot" if by_itself == {False} else "flying"), f"plain flying ({names})"


def _is_automatic(mode: str, vehicle: str | None) -> bool:
    return mode.startswith("AUTO_") or mode in (
        AUTOMATIC | (PLANE_AUTOMATIC if vehicle == "plane" else set())
    )


def _motion(
    rate: Signal | None, axis: str, span: Span, kind: str, how: str
) -> FoundExcitation | None:
    if rate is None:
        return None
    values = rate.within([span])
    spread = float(np.std(values)) if values.size else 0.0
    if spread < RESTING_RATE.value:
        return None
    return FoundExcitation(kind, axis, span[0], span[1], f"body rate {spread:.2g} rad/s rms, {how}")
