"""The self-check of a mixer sweep: what was injected is what the log says was injected.

ArduCopter logs the command to the mixer (RATE.ROut) and the terms of the rate controller (PIDR).
Their difference is the injected signal as the mixer got it. It must equal the logged chirp
(SIDD.Targ), which the mode computes at the end of one loop and the mixer uses in the next, on the
axis of the run, and nothing on the other axes. Where it does, the point of injection, the axis, the
sign and the delay are proven rather than assumed.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np
from numpy.typing import NDArray

from flightid._native import cubic_spline
from flightid.conventions import Axis, Light
from flightid.findings import Finding
from flightid.frozen import dataclass
from flightid.logs.contents import LogContents
from flightid.logs.dataflash.sid_runs import SidRun
from flightid.scalar_search import minimum_between

# Axis -> command to the mixer in RATE, and the message with the controller's terms.
COMMANDS = {Axis.ROLL: ("ROut", "PIDR"), Axis.PITCH: ("POut", "PIDP"), Axis.YAW: ("YOut", "PIDY")}
TERMS = ("P", "I", "D", "FF", "DFF")
PROOF_CORRELATION = 0.999
"""Correlation of residual and chirp from which an injection counts as proven."""
PROOF_GAIN = 0.02
"""Departure of the gain from 1 that a proof allows; larger ones come from limits in the mixer."""
QUIET = 0.02
"""Residual, as a fraction of the chirp's deviation, below which an axis counts as not injected."""
EARLY = 0.2
"""Part of a loop by which a row may be stamped before the RATE row of its loop."""
LOOPS = (-2.0, 4.0)
"""Delays that are searched, in loops."""
HALF_A_LOOP = 0.5
"""Between the delays that are tried, in loops."""
COPTER_LOOP_HZ = 400.0
"""Loops a second where a log tells none."""
BEFORE_S = 0.05
"""Before a run's first row, s: SIDD may be written a little earlier than SIDS."""
FEWEST_ROWS = 10
"""Rows in which a chirp may be found."""
RELATED = 0.5
"""Correlation of residual and chirp below which no axis is named."""


@dataclass(frozen=True)
class AxisCheck:
    """What is left of one mixer command after the controller's terms are taken away.

    Attributes
    ----------
    axis : Axis
        Roll, pitch or yaw.
    residual_rms : float
        Root mean square of command minus terms, normalised command.
    correlation : float
        Correlation of the residual with the delayed chirp, -1 to 1.
    gain : float
        Residual over chirp, least squares.
    lag_s, lag_loops : float
        Delay of the residual behind the chirp's own clock, s and loops; positive is late.
    """

    axis: Axis
    residual_rms: float
    correlation: float
    gain: float
    lag_s: float
    lag_loops: float


@dataclass(frozen=True)
class InjectionCheck:
    """Result of the self-check of one run.

    Attributes
    ----------
    run : SidRun
        Run.
    axes : tuple of AxisCheck
        Roll, pitch and yaw, as far as they are logged.
    injected : AxisCheck or None
        The axis on which the chirp is found; None where there is none.
    is_proven : bool
        Whether point, axis, sign and delay of a mixer sweep are proven.
    loop_time_s : float
        Time of one loop, s.
    findings : tuple of Finding
        The verdict.

    Reference
    ---------
    ArduCopter/mode_systemid.cpp, AC_AttitudeControl_Multi::rate_controller_run, Copter.cpp (order
    of the fast loop).
    """

    run: SidRun
    axes: tuple[AxisCheck, ...]
    injected: AxisCheck | None
    is_proven: bool
    loop_time_s: float
    findings: tuple[Finding, ...]

    @property
    def sign(self) -> int:
        """Sign of the injection, 1 or -1; 0 where no chirp is found."""
        return 0 if self.injected is None else int(np.sign(self.injected.gain))

    def __repr__(self) -> str:
        """Run and verdict on one line."""
        if self.injected is None:
            return f"InjectionCheck({self.run!r}, no chirp in a mixer command)"
        found = self.injected
        return (
            f"InjectionCheck({self.run!r}, {'proven' if self.is_proven else 'not proven'}: "
            f"{found.axis}, gain {found.gain:.4g}, {found.lag_loops:.3g} loops late)"
        )


def check_injection(log: LogContents, run: SidRun) -> InjectionCheck:
    """Compare what reached the mixer with what the log says was injected.

    Parameters
    ----------
    log : LogContents
        ArduPilot log.
    run : SidRun
        One of its runs.

    Assumes that RATE, PIDR, PIDP, PIDY and SIDD are written in the same loop, as one logging call
    of the firmware does.
    """
    loop_time_s = loop_time(log)
    checked = [_check_axis(log, run, axis, loop_time_s) for axis in COMMANDS]
    axes = tuple(check for check in checked if check is not None)
    found = max(axes, key=lambda check: abs(check.correlation), default=None)
    if found is not None and abs(found.correlation) < RELATED:
        found = None
    proven = _is_proven(run, axes, found)
    return InjectionCheck(
        run, axes, found, proven, loop_time_s, (_verdict(run, axes, found, proven),)
    )


def loop_time(log: LogContents) -> float:
    """Time of one main loop, s: SCHED_LOOP_RATE, or the loop time that ANG logs, or 1/400 s."""
    rate_hz = log.parameters.get("SCHED_LOOP_RATE", 0.0)
    if rate_hz > 0:
        return 1.0 / rate_hz
    if "ANG" in log and "Dt" in log.table("ANG"):
        median = float(np.median(log.table("ANG")["Dt"]))
        if median > 0:
            return median
    return 1.0 / COPTER_LOOP_HZ


def paired_rows(
    time_s: NDArray[np.float64], other_s: NDArray[np.float64], loop_time_s: float
) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Rows of two messages written in the same loop.

    RATE carries the stamp of the gyroscope, at the start of the loop; others carry that of their
    writing, later in the loop (or some microseconds before RATE in firmware that stamps RATE so
    too). The nearest stamp would be that of the wrong loop once writing takes half a loop.
    """
    next_one = np.searchsorted(other_s, time_s - EARLY * loop_time_s)
    inside = next_one < other_s.size
    next_one = np.minimum(next_one, other_s.size - 1)
    inside &= other_s[next_one] < time_s + (1.0 - EARLY) * loop_time_s
    return np.flatnonzero(inside), next_one[inside]


def chirp_clock(log: LogContents, run: SidRun) -> tuple[NDArray[np.float64], ...]:
    """Stamps, waveform clock and signal of a run's SIDD rows, s, s and run unit."""
    data = log.table("SIDD")
    rows = (data.time_s >= run.start_s - BEFORE_S) & (data.time_s <= run.stop_s)
    clock = data["Time"][rows]
    keep = np.concatenate([[True], np.diff(clock) > 0])
    return data.time_s[rows][keep], clock[keep], data["Targ"][rows][keep]


def _check_axis(log: LogContents, run: SidRun, axis: Axis, loop_time_s: float) -> AxisCheck | None:
    residual = mixer_residual(log, axis, loop_time_s)
    if residual is None:
        return None
    stamp_s, clock_s, signal = chirp_clock(log, run)
    rows, of_chirp = paired_rows(residual[0], stamp_s, loop_time_s)
    begin, end = run.delay_s, run.delay_s + run.record_s
    inside = (clock_s[of_chirp] > begin) & (clock_s[of_chirp] < end)
    left, at_s = residual[1][rows][inside], clock_s[of_chirp][inside]
    if left.size < FEWEST_ROWS or float(np.std(signal)) == 0.0:
        return None
    rms = float(np.sqrt(np.mean(left**2)))
    if rms <= QUIET * float(np.std(signal)):
        return AxisCheck(axis, rms, 0.0, 0.0, 0.0, 0.0)
    spline = partial(cubic_spline, clock_s, signal)
    lag_s = _best_lag(left, at_s, spline, loop_time_s)
    correlation, gain = _projection(left, spline(at_s - lag_s))
    return AxisCheck(axis, rms, correlation, gain, lag_s, lag_s / loop_time_s)


def mixer_residual(
    log: LogContents, axis: Axis, loop_time_s: float
) -> tuple[NDArray[np.float64], NDArray[np.float64]] | None:
    """Command to the mixer minus the controller's terms, with the stamps of RATE, s."""
    command, controller = COMMANDS[axis]
    if "RATE" not in log or controller not in log:
        return None
    rates, terms = log.table("RATE"), log.table(controller)
    names = [name for name in TERMS if name in terms]
    if command not in rates or len(names) < len(TERMS) - 1:
        return None
    rows, others = paired_rows(rates.time_s, terms.time_s, loop_time_s)
    total = np.sum([terms[name][others] for name in names], axis=0)
    return rates.time_s[rows], rates[command][rows] - total


def _best_lag(
    left: NDArray[np.float64],
    at_s: NDArray[np.float64],
    spline: Callable[[NDArray[np.float64]], NDArray[np.float64]],
    loop_time_s: float,
) -> float:
    """Delay with the largest correlation: a search over half loops, then a refinement."""

    def loss(loops: float) -> float:
        return -abs(_projection(left, spline(at_s - loops * loop_time_s))[0])

    grid = np.arange(LOOPS[0], LOOPS[1] + HALF_A_LOOP, HALF_A_LOOP)
    best = float(grid[np.argmin([loss(float(loops)) for loops in grid])])
    return minimum_between(loss, best - HALF_A_LOOP, best + HALF_A_LOOP) * loop_time_s


def _projection(left: NDArray[np.float64], chirp: NDArray[np.float64]) -> tuple[float, float]:
    power = float(chirp @ chirp)
    if power == 0.0:
        return 0.0, 0.0
    product = float(left @ chirp)
    return product / float(np.sqrt(power * (left @ left))), product / power


def _is_proven(run: SidRun, axes: tuple[AxisCheck, ...], found: AxisCheck | None) -> bool:
    if found is None or run.point != "mixer":
        return False
    others = [check for check in axes if check is not found]
    return (
        found.axis == run.body_axis
        and abs(found.correlation) >= PROOF_CORRELATION
        and abs(abs(found.gain) - 1.0) <= PROOF_GAIN
        and all(check.residual_rms <= QUIET * found.residual_rms for check in others)
    )


def _verdict(
    run: SidRun, axes: tuple[AxisCheck, ...], found: AxisCheck | None, proven: bool
) -> Finding:
    if not axes:
        return Finding(
            "injection-unchecked",
            Light.UNKNOWN,
            "the log holds no RATE with PIDR, PIDP or PIDY beside the chirp",
            "set ATTITUDE_FAST, ATTITUDE_MED and PID in LOG_BITMASK",
        )
    if run.point != "mixer":
        return _verdict_upstream(run, found)
    if run.body_axis not in COMMANDS:
        return Finding(
            "injection-unchecked",
            Light.UNKNOWN,
            "the log does not separate the thrust command from an injected one",
        )
    if found is None:
        return _contradiction(run, "no mixer command holds more than its controller's terms")
    what = f"{found.axis} with gain {found.gain:.4g}"
    if proven:
        return Finding(
            "injection-proven",
            Light.GREEN,
            f"the mixer got the logged chirp on {what}, {found.lag_loops:.2g} loops after it was "
            "logged",
        )
    return _contradiction(
        run,
        f"found on {what}, correlation {found.correlation:.5g}, {found.lag_loops:.2g} loops late",
    )


def _verdict_upstream(run: SidRun, found: AxisCheck | None) -> Finding:
    if found is not None:
        return _contradiction(run, f"a chirp is found in the mixer command of {found.axis}")
    return Finding(
        "injection-upstream",
        Light.GREEN,
        "the mixer commands hold the controllers' terms alone, as a sweep at "
        f"{run.point!r} must leave them",
    )


def _contradiction(run: SidRun, found: str) -> Finding:
    return Finding(
        "injection-contradicted",
        Light.RED,
        f"the log says SID_AXIS {run.axis}, but {found}",
        "check the firmware's version; use the direct estimate, without the excitation channel",
    )
