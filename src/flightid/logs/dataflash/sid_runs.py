"""Runs of ArduPilot's system-identification mode, located by their SIDS and SIDD messages."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from flightid.conventions import Axis
from flightid.frozen import dataclass
from flightid.logs.contents import LogContents

COPTER_DELAY_S = 1.0
"""Silence before the chirp on ArduCopter (SYSTEM_ID_DELAY, mode_systemid.cpp); 0 on ArduPlane."""
SHORT_S, BEFORE_S = 0.1, 0.05
"""Missing of a chirp that is whole, s; by how much SIDD may be written before SIDS, s."""

# SID_AXIS -> point of injection, axis, unit of the signal (ArduCopter/mode_systemid.cpp).
_RATE, _ANGLE = "deg/s", "deg"
AXES: dict[int, tuple[str, Axis | None, str]] = {
    1: ("input angle", Axis.ROLL, _ANGLE),
    2: ("input angle", Axis.PITCH, _ANGLE),
    3: ("input rate", Axis.YAW, _RATE),
    4: ("recovery angle", Axis.ROLL, _ANGLE),
    5: ("recovery angle", Axis.PITCH, _ANGLE),
    6: ("recovery rate", Axis.YAW, _RATE),
    7: ("rate", Axis.ROLL, _RATE),
    8: ("rate", Axis.PITCH, _RATE),
    9: ("rate", Axis.YAW, _RATE),
    10: ("mixer", Axis.ROLL, "1"),
    11: ("mixer", Axis.PITCH, "1"),
    12: ("mixer", Axis.YAW, "1"),
    13: ("mixer", Axis.HEAVE, "1"),
    14: ("measured lateral position", None, "m"),
    15: ("measured longitudinal position", None, "m"),
    16: ("measured lateral velocity", None, "m/s"),
    17: ("measured longitudinal velocity", None, "m/s"),
    18: ("input lateral velocity", None, "m/s"),
    19: ("input longitudinal velocity", None, "m/s"),
}


@dataclass(frozen=True)
class SidRun:
    """One run of the system-identification mode.

    Attributes
    ----------
    axis : int
        SID_AXIS: 1 to 19.
    start_s, stop_s : float
        First and last stamp of its SIDD rows, s.
    magnitude : float
        Amplitude at the start, in `unit` (a knob may have changed it in flight).
    f_start_hz, f_stop_hz : float
        Frequencies of the chirp, Hz.
    fade_in_s, fade_out_s, record_s : float
        SID_T_FADE_IN, SID_T_FADE_OUT and SID_T_REC, s.
    hold_s : float
        Dwell at the first frequency, s.
    delay_s : float
        Silence before the chirp, s.
    n_rows : int
        Rows of SIDD.

    Example
    -------
    >>> run = SidRun(10, 20.0, 160.0, 0.15, 0.05, 5.0, 5.0, 5.0, 130.0, 40.0, 1.0, 56000)
    >>> run, run.chirp_span_s
    (SidRun(mixer roll, 20 s to 160 s, 0.05 to 5 Hz, amplitude 0.15), (21.0, 151.0))
    """

    axis: int
    start_s: float
    stop_s: float
    magnitude: float
    f_start_hz: float
    f_stop_hz: float
    fade_in_s: float
    fade_out_s: float
    record_s: float
    hold_s: float
    delay_s: float
    n_rows: int

    @property
    def point(self) -> str:
        """Where the signal enters, for example ``"mixer"`` or ``"rate"``."""
        return AXES[self.axis][0] if self.axis in AXES else f"axis {self.axis}"

    @property
    def body_axis(self) -> Axis | None:
        """Body axis, or None for the horizontal position and velocity points."""
        return AXES[self.axis][1] if self.axis in AXES else None

    @property
    def unit(self) -> str:
        """Unit of the injected signal in the log."""
        return AXES[self.axis][2] if self.axis in AXES else "1"

    @property
    def chirp_span_s(self) -> tuple[float, float]:
        """From the first to the last instant of the chirp that was logged, s.

        The mode goes on logging after the chirp is over; that tail holds no excitation.
        """
        begin = self.start_s + self.delay_s
        return begin, min(begin + self.record_s, self.stop_s)

    @property
    def is_complete(self) -> bool:
        """Whether the chirp ran to its end."""
        return self.stop_s >= self.start_s + self.delay_s + self.record_s - SHORT_S

    def __repr__(self) -> str:
        """Point and axis, span, band and amplitude on one line."""
        what = self.point if self.body_axis is None else f"{self.point} {self.body_axis}"
        unit = "" if self.unit == "1" else f" {self.unit}"
        return (
            f"SidRun({what}, {self.start_s:.6g} s to {self.stop_s:.6g} s, {self.f_start_hz:g} to "
            f"{self.f_stop_hz:g} Hz, amplitude {self.magnitude:g}{unit})"
        )


def locate(log: LogContents) -> tuple[SidRun, ...]:
    """Runs in a log, in order; a run without SIDD rows is left out.

    Each SIDS row starts a run, which lasts until the waveform's own clock (SIDD.Time) jumps back or
    the next SIDS.
    """
    if "SIDS" not in log or "SIDD" not in log:
        return ()
    settings, data = log.table("SIDS"), log.table("SIDD")
    starts = settings.time_s
    runs = []
    for row in range(len(settings)):
        after = starts[row + 1] if row + 1 < len(settings) else np.inf
        rows = _rows_of_run(data.time_s, data["Time"], float(starts[row]), float(after))
        if rows.size < 2:
            continue
        value = {name: float(settings[name][row]) for name in settings.columns}
        first = int(rows[0])
        runs.append(
            SidRun(
                axis=int(value["Ax"]),
                # The waveform's clock says when the run began, even if the first rows are lost.
                start_s=float(data.time_s[first] - data["Time"][first]),
                stop_s=float(data.time_s[rows[-1]]),
                magnitude=value["Mag"],
                f_start_hz=value["FSt"],
                f_stop_hz=value["FSp"],
                fade_in_s=value["TFin"],
                fade_out_s=value["TFout"],
                record_s=value["TR"],
                hold_s=value["TC"],
                delay_s=COPTER_DELAY_S if log.vehicle == "copter" else 0.0,
                n_rows=rows.size,
            )
        )
    return tuple(runs)


def _rows_of_run(
    time_s: NDArray[np.float64], clock_s: NDArray[np.float64], start_s: float, after_s: float
) -> NDArray[np.intp]:
    # SIDS is written just before or after the first SIDD row of the same loop.
    rows = np.flatnonzero((time_s >= start_s - BEFORE_S) & (time_s < after_s - BEFORE_S))
    jumps = np.flatnonzero(np.diff(clock_s[rows]) < 0)
    if jumps.size == 0:
        return rows
    # A tail of the run before may stand first; the run itself begins where its clock does.
    pieces = np.split(rows, jumps + 1)
    return max(pieces, key=len)
