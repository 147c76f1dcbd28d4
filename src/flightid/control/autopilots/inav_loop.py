"""INAV's rate controller of multicopters as a loop."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from typing import ClassVar

import numpy as np
from numpy.typing import ArrayLike

from flightid.control.autopilots.betaflight_era import BetaflightEra
from flightid.control.autopilots.betaflight_filters import betaflight_filters
from flightid.control.autopilots.betaflight_loop import (
    MIXER,
    SUM_LIMIT,
    BetaflightLoop,
    IntegralRelax,
)
from flightid.control.autopilots.filter_stages import FilterPath, FilterStage, pole_stage
from flightid.control.autopilots.filters import (
    Omega,
    Response,
    difference_response,
    one_pole_response,
)
from flightid.control.autopilots.notch_tracking import NotchTracking
from flightid.control.autopilots.parameter_table import Axis, AxisParameters
from flightid.frozen import dataclass
from flightid.recursive_filter import filtered

P_DIVISOR, I_DIVISOR, D_DIVISOR, CD_DIVISOR = 31.0, 4.0, 1905.0, 7270.0
"""FP_PID_RATE_P_, _I_, _D_ and _D_FF_MULTIPLIER: a gain over it is PID sum over deg/s."""
LEVEL_DIVISOR = 6.56
"""FP_PID_LEVEL_P_MULTIPLIER: levelling's P over it is 1/s."""
ERA = BetaflightEra(yaw_integral=1.0, tpa_of_d=False)
CD_LPF_HZ, CD_ORDER = 30.0, 3
"""`mc_cd_lpf_hz` as it comes, of which the header tells nothing, and its poles."""
RELAX_HZ, I_SHARE = 15.0, 0.33
"""`mc_iterm_relax_cutoff` and `pid_iterm_limit_percent` as they come."""
FULL_THROTTLE = 2000.0


@dataclass(frozen=True, repr=False)
class InavLoop(BetaflightLoop):
    """One axis of INAV on a multicopter: output is the PID sum over 1000, the mixer's command.

    P and I act on the error, D on the filtered gyro's difference behind the D-term low-pass; the
    control derivative CD acts on the set-point behind three poles. Throttle (TPA) takes from P, D
    and CD of roll and pitch. P of yaw passes `yaw_lpf_hz`. In ANGLE the set-point is levelling's P
    on the angle's error behind a low-pass; tuning leaves it as it flew.

    Reference
    ---------
    INAV, src/main/flight/pid.c and pid.h, common/filter.c (3 to 9).

    Example
    -------
    >>> from flightid.control.autopilots import axis_loop
    >>> axis_loop("inav", "roll", loop_rate_hz=2000.0)
    AxisLoop(inav roll, 2000 Hz, P 40, I 75, D 25, FF 60)
    """

    era: BetaflightEra = ERA
    set_point_filter: FilterStage = pole_stage("mc_cd_lpf_hz", 0.0, "target", 1000.0)
    autopilot: ClassVar[str] = "inav"
    scales: ClassVar[Mapping[str, float]] = {
        "p": 1.0 / P_DIVISOR,
        "i": 1.0 / I_DIVISOR,
        "d": 1.0 / D_DIVISOR,
        "ff": 1.0 / CD_DIVISOR,
    }

    @property
    def angle_gain_1_s(self) -> float:
        """Gain of the angle controller, 1/s; 0 in yaw, which has none."""
        return self.values.get("level_p", 0.0) / LEVEL_DIVISOR

    def angle(self, omega_rad_s: ArrayLike) -> Response:
        """From angle error (rad) to rate set-point (rad/s), behind the low-pass of levelling."""
        omega = np.atleast_1d(np.asarray(omega_rad_s, dtype=np.float64))
        cutoff_hz = self.values.get("level_filter", 0.0)
        smooth = one_pole_response(cutoff_hz, omega, self.loop_rate_hz)
        return np.asarray(self.angle_gain_1_s * smooth)

    def _forward_terms(self, omega: Omega) -> dict[str, Response]:
        slope = difference_response(omega, self.loop_rate_hz)
        slope = slope * self.set_point_filter.response(omega)
        of_one = self.unit_of("ff") * self.throttle_shares[1]
        return self._error_terms(omega) | {"ff": np.asarray(of_one * slope)}

    def _slopes(self, setpoint: np.ndarray, rate: np.ndarray) -> dict[str, np.ndarray]:
        """Terms of slopes: D of the rate, CD of the set-point."""
        step = np.diff(setpoint, prepend=0.0) * self.loop_rate_hz
        for b0, b1, b2, a1, a2 in self.set_point_filter.sections:
            step = filtered([b0, b1, b2], [1.0, a1, a2], step)
        gain = self.unit_of("ff") * self.values["ff"] * self.throttle_shares[1]
        return {**super()._slopes(setpoint, rate), "FF": gain * step}


def inav_loop(
    found: AxisParameters,
    known: Mapping[str, float],
    shared: tuple[Axis, dict[str, float], dict[str, str], float, float, float],
    tracking: NotchTracking,
) -> InavLoop:
    """Loop of an axis from its parameters, at the throttle of a flight."""
    axis, rate_hz = shared[0], shared[3]
    throttle = 0.0 if tracking.throttle is None else tracking.throttle.middle
    share = _throttle_share(known, axis, throttle)
    limit = SUM_LIMIT * known.get("pid_iterm_limit_percent", 100.0 * I_SHARE) / 100.0
    return InavLoop(
        *shared,
        (),
        _unknown(known),
        found.assumed,
        _said(known, throttle, share),
        stages=_stages(known, rate_hz),
        throttle_shares=(share, share),
        integral_limit=limit / MIXER,
        relax=None if axis == "yaw" else IntegralRelax(RELAX_HZ),
        set_point_filter=_low_pass("mc_cd_lpf_hz", CD_LPF_HZ, CD_ORDER, "target", rate_hz),
    )


def _stages(known: Mapping[str, float], rate_hz: float) -> tuple[FilterStage, ...]:
    """The D-term's low-pass, which has Betaflight's kinds: 0 PT1, 1 biquad, 2 PT2, 3 PT3."""
    settings = {
        "dterm_lpf1_static_hz": known.get("dterm_lpf_hz", 0.0),
        "dterm_lpf1_type": known.get("dterm_lpf_type", 0.0),
    }
    found = betaflight_filters(settings, loop_rate_hz=rate_hz)
    return tuple(replace(each, name="dterm_lpf_hz") for each in found)


def _low_pass(
    name: str, cutoff_hz: float, order: int, path: FilterPath, rate_hz: float
) -> FilterStage:
    """Equal poles whose product takes 3 dB at the cut-off."""
    each = cutoff_hz / math.sqrt(2.0 ** (1.0 / order) - 1.0)
    return pole_stage(name, each, path, rate_hz, order)


def _throttle_share(known: Mapping[str, float], axis: str, throttle: float) -> float:
    """What TPA leaves of P, D and CD; of yaw it takes nothing."""
    begin = known.get("tpa_breakpoint", 1500.0)
    most = known.get("maxthrottle", FULL_THROTTLE)
    if axis == "yaw" or most <= begin:
        return 1.0
    beyond = min(max(1000.0 + 1000.0 * throttle - begin, 0.0) / (most - begin), 1.0)
    return 1.0 - known.get("tpa_rate", 0.0) / 100.0 * beyond


def _unknown(known: Mapping[str, float]) -> tuple[str, ...]:
    cutoff = known.get("gyro_main_lpf_hz", 0.0)
    told = f"gyro_main_lpf_hz {cutoff:g}, " if cutoff else ""
    return (
        f"the gyro's filters ({told}dynamic notches, Kalman filter) are not told in full: a plant "
        "from the logged rate holds them",
    )


def _said(known: Mapping[str, float], throttle: float, share: float) -> tuple[str, ...]:
    said = ["d_boost moves D with the motion, and the log tells none of its settings: D is at rest"]
    if known.get("tpa_rate"):
        said.append(
            f"TPA leaves {100.0 * share:.0f} % of P and D at the flight's throttle of "
            f"{100.0 * throttle:.0f} %: this view stays there"
        )
    said.append(
        "mc_iterm_relax, antigravity_gain, mc_cd_lpf_hz and pid_iterm_limit_percent are not "
        "logged: they are taken as they come"
    )
    return tuple(said)
