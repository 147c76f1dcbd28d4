"""PX4's autotune: states, model and gains of autotune_attitude_control_status."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import numpy as np
from numpy.typing import NDArray

from flightid.control.autopilots import AXES
from flightid.control.autopilots.px4_autotune import LARGEST, Px4AutotuneGains
from flightid.conventions import Light
from flightid.findings import Finding
from flightid.inspection.signals import Span
from flightid.inspection.stamps import believable
from flightid.logs import Log
from flightid.review.autotune.run import AutotuneRun

Array = NDArray[np.float64]
TOPIC = "autotune_attitude_control_status"
EARLIER = {"roll": 2, "pitch": 4, "yaw": 6, "verify": 8, "test": 10, "complete": 11, "fail": 12}
EARLIER |= {"disarm": 13}
LATER = {"roll": 3, "pitch": 6, "yaw": 9, "verify": 11, "test": 13, "complete": 14, "fail": 15}
LATER |= {"disarm": 16}
"""Numbers of the states until 1.16, and since states of fixed wings came between them."""
PAUSE_S, TIMEOUT_S, CONVERGED = 2.5, 20.0, 50.0
STICK = 0.05
"""Of the stick's range: more counts as the pilot's."""


def px4_run(log: Log) -> AutotuneRun | None:
    """Read PX4's autotune; None where the log holds none."""
    if TOPIC not in log:
        return None
    table = log.table(TOPIC)
    good = believable(table.time_s)
    time_s, state = table.time_s[good], table["state"][good].astype(int)
    if not np.any(state > 1):
        return None
    numbers = _numbers(time_s, state)
    spans: dict[str, tuple[Span, ...]] = {}
    gains: dict[str, Mapping[str, float]] = {}
    findings: list[Finding] = []
    columns = {name: table[name][good] for name in ("kc", "ki", "kd", "att_p")}
    for axis in AXES:
        rows = np.flatnonzero(state == numbers[axis])
        if rows.size < 2:
            continue
        runs = np.split(rows, np.flatnonzero(np.diff(rows) > 1) + 1)
        spans[axis] = tuple((float(time_s[run[0]]), float(time_s[run[-1]])) for run in runs)
        last = {name: float(values[rows[-1]]) for name, values in columns.items()}
        if all(map(np.isfinite, last.values())):
            gains[axis] = _gains(last).parameters(axis)
            findings += _unreasonable(axis, last)
        else:
            findings.append(_not_a_number(axis))
    finished = bool(np.isin(state, [numbers["complete"], numbers["disarm"]]).any())
    if np.any(state == numbers["fail"]):
        variances = [n for n in table.columns if n.startswith("coeff_var")]
        worst = np.max([table[n][good] for n in variances], axis=0) if variances else None
        findings.insert(0, _failure(log, time_s, state, numbers, worst))
    elif not finished:
        findings.insert(0, _unfinished())
    return AutotuneRun("px4_multicopter", (), spans, gains, finished, tuple(findings))


def _numbers(time_s: Array, state: NDArray[np.int64]) -> Mapping[str, int]:
    """Which numbering: roll is excited for five seconds or more, its pause lasts two."""
    three = time_s[state == 3]
    late = bool(np.any(state > 13)) or (three.size > 1 and float(np.ptp(three)) > 2 * PAUSE_S)
    return LATER if late else EARLIER


def _gains(last: Mapping[str, float]) -> Px4AutotuneGains:
    return Px4AutotuneGains(last["kc"], last["ki"], last["kd"], last["att_p"], acceptable=True)


def _unreasonable(axis: str, last: Mapping[str, float]) -> Iterator[Finding]:
    """Gains that PX4's own check refuses."""
    for name, most in LARGEST.items():
        if not 0.0 <= last[name] < most:
            yield Finding(
                f"autotune-gains-refused-{axis}",
                Light.RED,
                f"{axis}: {name} {last[name]:.3g} lies outside 0 to {most:g}: PX4 refuses it",
                "the model is poor: more excitation (MC_AT_SYSID_AMP), still air",
            )


def _not_a_number(axis: str) -> Finding:
    return Finding(
        f"autotune-not-a-number-{axis}",
        Light.RED,
        f"{axis}: its gains are not finite numbers",
        "do not apply them; update the firmware, whose check lets them pass",
    )


def _unfinished() -> Finding:
    return Finding(
        "autotune-unfinished",
        Light.AMBER,
        "it did not finish while the log ran",
        "log until the vehicle is disarmed",
    )


def _failure(
    log: Log,
    time_s: Array,
    state: NDArray[np.int64],
    numbers: Mapping[str, int],
    worst: Array | None,
) -> Finding:
    """Why it failed, by what it did last before and who touched the sticks."""
    first = int(np.flatnonzero(state == numbers["fail"])[0])
    before = int(state[max(first - 1, 0)])
    names = {number: name for name, number in numbers.items()}
    told = names.get(before, "a pause between axes")
    began = first - 1
    while began > 0 and state[began - 1] == before:
        began -= 1
    lasted = float(time_s[first] - time_s[began])
    at = float(time_s[first])
    if told in AXES and lasted > TIMEOUT_S - 1.0:
        spread = "" if worst is None else f", largest variance {worst[first - 1]:.3g}"
        return Finding(
            "autotune-timeout",
            Light.RED,
            f"{told}: no convergence within {TIMEOUT_S:g} s (variances below "
            f"{CONVERGED:g} are asked for{spread})",
            "raise MC_AT_SYSID_AMP, fly in still air, lower gains that oscillate",
        )
    if _stick_moved(log, at):
        return Finding(
            "autotune-pilot",
            Light.RED,
            f"a stick moved by more than 5 % at {at:.1f} s, in {told}",
            "leave the sticks centred, and check their trim",
        )
    if told == "test":
        return Finding(
            "autotune-oscillation",
            Light.RED,
            "the new gains made the controls work too hard within seconds: PX4 went back",
            "see the margins below; MC_AT_RISE_TIME up makes them gentler",
        )
    if told == "verify":
        return Finding("autotune-refused", Light.RED, "PX4 refused the gains that it found")
    return Finding(
        "autotune-interrupted",
        Light.RED,
        f"it ended in {told} after {lasted:.1f} s: the mode changed, or a failsafe did",
        "stay in one mode (Position or Altitude) until it is done",
    )


def _stick_moved(log: Log, at_s: float) -> bool:
    if "manual_control_setpoint" not in log:
        return False
    table = log.table("manual_control_setpoint")
    near = (table.time_s > at_s - 1.0) & (table.time_s <= at_s + 0.2)
    names = [n for n in ("roll", "pitch", "y", "x") if n in table.columns]
    return any(bool(np.any(np.abs(table[name][near]) > STICK)) for name in names)
