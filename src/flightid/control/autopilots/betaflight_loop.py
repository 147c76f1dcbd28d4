"""Betaflight's rate controller as a loop."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import ClassVar

import numpy as np
from numpy.typing import ArrayLike

from flightid.control.autopilots.axis_loop import AxisLoop
from flightid.control.autopilots.betaflight_era import (
    BetaflightEra,
    era_of,
    has_gyro_mean,
    throttle_shares,
)
from flightid.control.autopilots.betaflight_filters import betaflight_filters
from flightid.control.autopilots.filter_stages import FilterStage
from flightid.control.autopilots.filters import (
    Omega,
    Response,
    difference_response,
    one_pole_response,
    one_pole_weight,
)
from flightid.control.autopilots.loop_run import LoopFlags, LoopRun, samples
from flightid.control.autopilots.notch_tracking import NotchTracking
from flightid.control.autopilots.parameter_files import GainChange
from flightid.control.autopilots.parameter_table import Axis, AxisParameters, GainRange
from flightid.control.gyro import Gyro
from flightid.errors import DataError, OptionError
from flightid.frozen import dataclass
from flightid.recursive_filter import filtered

P_SCALE, I_SCALE, D_SCALE = 0.032029, 0.244381, 0.000529
"""PTERM_SCALE, ITERM_SCALE and DTERM_SCALE: PID sum over deg/s for a gain of one."""
MIXER = 1000.0
"""PID sum of a full command."""
SUM_LIMIT, I_SHARE = 500.0, 85.0
RELAX_HZ, RELAX_DEG_S = 15.0, 40.0
"""iterm_relax_cutoff as it comes, and the fast part of a set-point at which I stands still."""
RELAX_YAW, RELAX_RISING = (2, 4), (3, 4)
"""Numbers of iterm_relax that hold in yaw too, and that let I go back."""
SLIDERS = "simplified_pids_mode"


@dataclass(frozen=True)
class IntegralRelax:
    """Betaflight's iterm_relax.

    Attributes
    ----------
    cutoff_hz : float
        Of the low-pass that tells a fast set-point from a slow one.
    by_setpoint : bool
        True: the error counts less; False: what the slow set-point leaves of it.
    rising_only : bool
        Whether I may always go back towards zero.
    """

    cutoff_hz: float
    by_setpoint: bool = True
    rising_only: bool = False


@dataclass(frozen=True, repr=False)
class BetaflightLoop(AxisLoop):
    """One axis of Betaflight: output is the PID sum over 1000, the mixer's command.

    P and I act on the error, D on the filtered gyro's difference behind the D-term filters. I takes
    the error of the loop itself, and has 2.5 times its weight in yaw, where P passes a low-pass.
    Feed-forward acts on the sticks, not on the set-point, and has no part in this view. Versions
    before 4 had no D in yaw, and D took its share of the set-point; `era` tells.

    Attributes
    ----------
    stages : tuple of FilterStage
        Filters on the gyro and on the D-term, where throttle and motors have them.
    throttle_shares : tuple of float
        What TPA leaves of P and of D at the throttle of the flight.
    integral_limit : float
        Of I, in `output_unit`.
    relax : IntegralRelax or None
        How fast set-points hold I back in `run`; the linear view is of small signals.
    era : BetaflightEra
        What the version that flew makes of the gains.

    Reference
    ---------
    Betaflight, src/main/flight/pid.c, pid.h and pid_init.c (3.1 to 2025.12).

    Example
    -------
    >>> from flightid.control.autopilots import axis_loop
    >>> axis_loop("betaflight", "roll", loop_rate_hz=4000.0)
    AxisLoop(betaflight roll, 4000 Hz, P 45, I 80, D 30, FF 120)
    """

    stages: tuple[FilterStage, ...] = ()
    throttle_shares: tuple[float, float] = (1.0, 1.0)
    integral_limit: float = math.inf
    relax: IntegralRelax | None = None
    era: BetaflightEra = BetaflightEra()
    autopilot: ClassVar[str] = "betaflight"
    scales: ClassVar[Mapping[str, float]] = {"p": P_SCALE, "i": I_SCALE, "d": D_SCALE}
    """PID sum over deg/s, deg and deg/s² for a gain of one."""
    full_output: ClassVar[float] = SUM_LIMIT / MIXER
    gains_are_whole: ClassVar[bool] = True

    @property
    def angle_gain_1_s(self) -> float:
        """No angle controller is modelled.

        Raises
        ------
        OptionError
            Always.
        """
        raise OptionError(
            "the angle controller of Betaflight is not modelled",
            found="an angle loop",
            needed="its rate loop",
        )

    def unit_of(self, role: str) -> float:
        """Of P, I and D: what one count is worth, in output per rad/s, per rad, per rad/s²."""
        scale = self.scales.get(role)
        if scale is None:
            return 1.0
        if (role, self.axis) == ("i", "yaw"):
            scale *= self.era.yaw_integral
        return math.degrees(scale) / MIXER

    @property
    def ranges(self) -> dict[str, GainRange]:
        """What a designer may move, by parameter name."""
        found = super().ranges
        if not self._has_d:
            found.pop(self.names["d"], None)
        return found

    @property
    def _has_d(self) -> bool:
        return self.axis != "yaw" or self.era.has_yaw_d

    def written(self, value: float) -> float:
        """The whole number that the command line takes."""
        return float(round(value))

    def gyro_response(self, omega_rad_s: ArrayLike) -> Response:
        """Filters between the gyro's samples and the rate that the controller takes."""
        return self._along("gyro", np.atleast_1d(np.asarray(omega_rad_s, dtype=np.float64)))

    def plant_gyro_response(self, omega_rad_s: ArrayLike) -> Response:
        """Filters of the gyro that a plant identified from the filtered rate holds."""
        return self.gyro_response(omega_rad_s)

    def _along(self, path: str, omega: Omega) -> Response:
        product = np.ones(omega.size, dtype=np.complex128)
        for stage in self.stages:
            if stage.path == path:
                product = product * stage.response(omega)
        return product

    def _stages(self) -> tuple[FilterStage, ...]:
        return self.stages

    def _error_terms(self, omega: Omega) -> dict[str, Response]:
        share, rate_hz = self.throttle_shares[0], self.loop_rate_hz
        smooth = one_pole_response(self.values.get("p_filter", 0.0), omega, rate_hz)
        return {
            "p": self.unit_of("p") * share * smooth,
            "i": self.unit_of("i") / difference_response(omega, rate_hz),
        }

    def _feedback_terms(self, omega: Omega) -> dict[str, Response]:
        if not self._has_d:
            return self._error_terms(omega)
        return self._error_terms(omega) | {"d": self._slope(omega, is_filtered=True)}

    def _forward_terms(self, omega: Omega) -> dict[str, Response]:
        if not (self._has_d and self.era.setpoint_weight):
            return self._error_terms(omega)
        slope = self._slope(omega, is_filtered=self.era.weight_is_filtered)
        return self._error_terms(omega) | {"d": self.era.setpoint_weight * slope}

    def _slope(self, omega: Omega, *, is_filtered: bool) -> Response:
        """D of one, at the throttle of the flight."""
        slope = difference_response(omega, self.loop_rate_hz)
        if is_filtered:
            slope = slope * self._along("derivative", omega)
        return np.asarray(self.unit_of("d") * self.throttle_shares[1] * slope)

    def _integrated(self, setpoint: np.ndarray, rate: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Error that I counts away from zero and towards it: fast set-points hold it back."""
        error = setpoint - rate
        if self.relax is None:
            return error, error
        weight = one_pole_weight(self.relax.cutoff_hz, self.loop_rate_hz)
        slow = filtered([weight], [1.0, weight - 1.0], setpoint)
        fast = np.abs(setpoint - slow)
        if self.relax.by_setpoint:
            relaxed = error * np.maximum(0.0, 1.0 - fast / math.radians(RELAX_DEG_S))
        else:
            left = slow - rate
            relaxed = np.sign(left) * np.maximum(np.abs(left) - fast, 0.0)
        return relaxed, error if self.relax.rising_only else relaxed

    def run(
        self,
        setpoint_rad_s: ArrayLike,
        rate_rad_s: ArrayLike,
        flags: LoopFlags | None = None,
        *,
        gyro: Gyro = "filtered",
        single_precision: bool = True,
    ) -> LoopRun:
        """See `AxisLoop.run`; in double precision, from the filtered rate."""
        if gyro == "raw":
            raise OptionError(
                "Betaflight's gyro filters are not run",
                found="gyro='raw'",
                needed="the filtered rate, gyroADC of the blackbox",
            )
        del flags, single_precision
        setpoint, rate = samples(setpoint_rad_s, rate_rad_s, 1)
        error, rate_hz = setpoint - rate, self.loop_rate_hz
        weight = one_pole_weight(self.values.get("p_filter", 0.0), rate_hz)
        gain = self.unit_of("p") * self.values["p"] * self.throttle_shares[0]
        step = self.unit_of("i") * self.values["i"] / rate_hz
        counted, freely = self._integrated(setpoint, rate)
        terms = {
            "P": filtered([weight], [1.0, weight - 1.0], gain * error),
            "I": _clamped_sum(step * counted, step * freely, self.integral_limit),
            **self._slopes(setpoint, rate),
        }
        return LoopRun(sum(terms.values(), np.zeros(rate.size)), terms, rate)

    def _slopes(self, setpoint: np.ndarray, rate: np.ndarray) -> dict[str, np.ndarray]:
        """Terms of slopes: D."""
        if not self._has_d:
            return {"D": np.zeros(rate.size)}
        weight, is_filtered = self.era.setpoint_weight, self.era.weight_is_filtered
        smooth = self._smoothed(rate - weight * setpoint if is_filtered else rate)
        if weight and not is_filtered:
            smooth = smooth - weight * setpoint
        slope = np.diff(smooth, prepend=0.0) * self.loop_rate_hz
        return {"D": -self.unit_of("d") * self.values["d"] * self.throttle_shares[1] * slope}

    def _smoothed(self, values: np.ndarray) -> np.ndarray:
        """Behind the D-term filters."""
        for stage in self.stages:
            if stage.path == "derivative":
                for b0, b1, b2, a1, a2 in stage.sections:
                    values = filtered([b0, b1, b2], [1.0, a1, a2], values)
        return values


def _clamped_sum(steps: np.ndarray, freely: np.ndarray, limit: float) -> np.ndarray:
    """Sum within a limit; towards zero it goes by the second kind of steps."""
    total = np.cumsum(steps)
    if freely is steps and np.abs(total).max(initial=0.0) <= limit:
        return np.asarray(total)
    made, held = np.empty_like(steps), 0.0
    for place, (relaxed, free) in enumerate(zip(steps.tolist(), freely.tolist(), strict=True)):
        held = min(max(held + (free if held * free < 0.0 else relaxed), -limit), limit)
        made[place] = held
    return made


def betaflight_loop(
    found: AxisParameters,
    known: Mapping[str, float],
    shared: tuple[Axis, dict[str, float], dict[str, str], float, float, float],
    tracking: NotchTracking,
) -> BetaflightLoop:
    """Loop of an axis from its parameters, at the throttle and the motors' turns of a flight.

    Raises
    ------
    DataError
        Yaw is controlled in another form.
    """
    axis, rate_hz, gyro_hz = shared[0], shared[3], shared[4]
    if axis == "yaw" and known.get("use_integrated_yaw"):
        raise DataError(
            "yaw integrates its whole PID sum, which is another controller",
            found="use_integrated_yaw 1",
            needed="use_integrated_yaw OFF",
        )
    era = era_of(known)
    throttle = 0.0 if tracking.throttle is None else min(max(tracking.throttle.middle, 0.0), 1.0)
    motors_hz = [each.middle for each in tracking.motors]
    stages = betaflight_filters(
        {**known, "gyro_lpf1_static_hz": 0.0} if has_gyro_mean(known) else known,
        loop_rate_hz=rate_hz,
        gyro_rate_hz=gyro_hz,
        throttle=throttle,
        motors_hz=motors_hz,
        gyro_at_once=era.gyro_at_once,
    )
    limit = known.get("pidsum_limit_yaw" if axis == "yaw" else "pidsum_limit", SUM_LIMIT)
    share = limit * known.get("iterm_windup", I_SHARE) / 100.0
    return BetaflightLoop(
        *shared,
        (),
        tuple(_unknown(known, motors_hz)),
        found.assumed,
        tuple(_said(known, axis, throttle, era)),
        stages=stages,
        throttle_shares=throttle_shares(known, throttle, era),
        integral_limit=(share if math.isnan(era.integral_limit) else era.integral_limit) / MIXER,
        relax=_relax(known, axis),
        era=era,
        beside_gains=tuple(_beside(known, axis)),
    )


def _relax(known: Mapping[str, float], axis: str) -> IntegralRelax | None:
    mode = round(known.get("iterm_relax", 0.0))
    if not mode or (axis == "yaw" and mode not in RELAX_YAW):
        return None
    return IntegralRelax(
        known.get("iterm_relax_cutoff", RELAX_HZ),
        bool(known.get("iterm_relax_type", 1.0)),
        mode in RELAX_RISING,
    )


def _unknown(known: Mapping[str, float], motors_hz: list[float]) -> list[str]:
    said = []
    if has_gyro_mean(known):
        said.append("the gyro's moving mean (FIR) is not in this view")
    if known.get("dyn_notch_count"):
        said.append("dynamic notches follow peaks that the log does not tell: not in this view")
    if known.get("rpm_filter_harmonics") and not motors_hz:
        said.append("notches at the motors' turns, which the log does not tell: not in this view")
    return said


def _said(known: Mapping[str, float], axis: str, throttle: float, era: BetaflightEra) -> list[str]:
    """What a view of small signals at one throttle leaves out."""
    said = []
    shares = throttle_shares(known, throttle, era)
    if known.get("tpa_rate"):
        said.append(
            f"TPA leaves {100.0 * shares[0]:.0f} % of P and {100.0 * shares[1]:.0f} % of D at the "
            f"flight's throttle of {100.0 * throttle:.0f} %: this view stays there"
        )
    if known.get("tpa_rate") and era.gyro_at_once and era.tpa_of_d and "tpa_mode" not in known:
        said.append("this version's header does not tell tpa_mode: TPA is taken as of D alone")
    if era.gyro_at_once and {"gyro_lpf1_dyn_max_hz", "dterm_lpf1_dyn_max_hz"} & {*known}:
        said.append("low-passes that move with throttle stand by the curve of version 4.2")
    if era.setpoint_weight and known.get("setpoint_relax_ratio", 100.0) < 100.0:
        said.append("D's share of the set-point falls with the stick: here it is whole")
    if _relax(known, axis) is not None:
        said.append("iterm_relax holds I back in fast set-points: steps are without it")
    if known.get("anti_gravity_gain"):
        said.append("anti_gravity raises P and I while the throttle moves: not in this view")
    if known.get(f"f_{axis}"):
        said.append(f"f_{axis} acts on the sticks: steps of the set-point are without it")
    if known.get("abs_control_gain"):
        said.append("abs_control corrects the set-point: not in this view")
    least, most = _boost(known, axis)
    if most > least:
        said.append(
            f"D moved between {least:g} and {most:g} with the motion: as flown stands "
            f"{known[f'd_{axis}']:g}"
        )
    return said


def _boost(known: Mapping[str, float], axis: str) -> tuple[float, float]:
    """Between what D moves: up to d_max since 2025.12, from d_min before."""
    own = known.get(f"d_{axis}", 0.0)
    least = known.get(f"d_min_{axis}", 0.0)
    return (least if 0.0 < least < own else own), max(own, known.get(f"d_max_{axis}", 0.0))


def _beside(known: Mapping[str, float], axis: str) -> list[GainChange]:
    """Off, so that D is what was tuned; and no slider may write over the gains."""
    found = []
    least, most = _boost(known, axis)
    name = f"d_min_{axis}" if least < known.get(f"d_{axis}", 0.0) else f"d_max_{axis}"
    if most > least:
        found.append(GainChange(name, 0.0, known[name], "D stays what it is tuned to"))
    if known.get(SLIDERS):
        found.append(GainChange(SLIDERS, 0.0, known[SLIDERS], "no slider writes over the gains"))
    return found
