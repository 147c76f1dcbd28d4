"""PX4's rate controllers as loops (native side: `px4_rate_control.rs`)."""

from __future__ import annotations

from typing import ClassVar

import numpy as np
from numpy.typing import ArrayLike

from flightid import _native
from flightid.control.autopilots.axis_loop import AxisLoop
from flightid.control.autopilots.filter_stages import FilterStage, pole_stage
from flightid.control.autopilots.filters import (
    Omega,
    Response,
    delay_operator,
    difference_response,
    one_pole_response,
)
from flightid.control.autopilots.loop_run import LoopFlags, LoopRun, samples
from flightid.control.gyro import Gyro
from flightid.errors import OptionError, ShapeError
from flightid.frozen import dataclass


@dataclass(frozen=True, repr=False)
class Px4Loop(AxisLoop):
    """An axis whose rate controller is PX4's RateControl.

    Attributes
    ----------
    old : bool
        True for the controller until 2017: the rate is differenced between loops, unfiltered, and
        the integrator stops outside ±0.3.
    """

    old: bool = False

    @property
    def _gains(self) -> dict[str, float]:
        """Gains as the native controller takes them."""
        return {role: self.values[role] for role in ("p", "i", "d", "ff", "int_limit")}

    @property
    def _derivative_cutoff_hz(self) -> float:
        """The firmware leaves the filter off at half the sample rate and above."""
        cutoff = self.values["derivative_filter"]
        return cutoff if cutoff < self.gyro_rate_hz / 2 else 0.0

    @property
    def _output_cutoff_hz(self) -> float:
        return self.values.get("output_cutoff", 0.0)

    def _stages(self) -> tuple[FilterStage, ...]:
        slope = 0.0 if self.old else self._derivative_cutoff_hz
        name = self.names["derivative_filter"]
        output = self.names.get("output_cutoff", "output")
        return (
            *self._gyro_stages(),
            pole_stage(name, slope, "derivative", self.gyro_rate_hz),
            pole_stage(output, self._output_cutoff_hz, "output", self.loop_rate_hz),
        )

    def _output_response(self, omega: Omega) -> Response:
        return one_pole_response(self._output_cutoff_hz, omega, self.loop_rate_hz)

    def _slope(self, omega: Omega) -> Response:
        if self.old:
            return difference_response(omega, self.loop_rate_hz)
        rate_hz = self.gyro_rate_hz
        low_pass = one_pole_response(self._derivative_cutoff_hz, omega, rate_hz)
        return difference_response(omega, rate_hz) * low_pass

    def _error_terms(self, omega: Omega) -> dict[str, Response]:
        # The output holds the integral of the loop before.
        rate_hz = self.loop_rate_hz
        integral = delay_operator(omega, rate_hz) / difference_response(omega, rate_hz)
        return {"p": np.ones(omega.size, dtype=np.complex128), "i": integral}

    def _acceleration(self, rate: np.ndarray, single_precision: bool) -> np.ndarray:
        """Angular acceleration from the filtered rate of each loop."""
        cutoff = self._derivative_cutoff_hz
        return _native.gyro_filters(rate, self.loop_rate_hz, [], 0.0, cutoff, 1, single_precision)[
            1
        ]

    def _controller(
        self,
        setpoint: np.ndarray,
        rate: np.ndarray,
        acceleration: np.ndarray,
        flags: LoopFlags,
        single_precision: bool,
    ) -> dict[str, np.ndarray]:
        n = setpoint.size
        thrust = np.ones(n) if flags.thrust is None else flags.thrust
        marks = np.zeros((n, 3), dtype=bool)
        if flags.limited is not None:
            marks[:, :2] = flags.limited if flags.limited.ndim == 2 else flags.limited[:, None]
        if flags.landed is not None:
            marks[:, 2] = flags.landed
        gains = self._gains | {"output_cutoff_hz": self._output_cutoff_hz, "old": self.old}
        if any(len(signal) != n for signal in (acceleration, thrust)):
            raise ShapeError("acceleration and thrust need a value for each loop", needed=n)
        start = None if flags.start is None else (flags.start.integrator, flags.start.rate)
        signals = np.ascontiguousarray([setpoint, rate, acceleration, thrust], dtype=np.float64)
        rows = _native.px4_rate_control(
            gains, 1 / self.loop_rate_hz, signals, marks, start, single_precision
        )
        return dict(zip(("P", "I", "D", "FF", "output"), rows.T, strict=True))

    def run(
        self,
        setpoint_rad_s: ArrayLike,
        rate_rad_s: ArrayLike,
        flags: LoopFlags | None = None,
        *,
        gyro: Gyro = "filtered",
        single_precision: bool = True,
    ) -> LoopRun:
        """See `AxisLoop.run`."""
        flags = flags or LoopFlags()
        per_loop = self._samples_per_loop if gyro == "raw" else 1
        setpoint, rate = samples(setpoint_rad_s, rate_rad_s, per_loop)
        if gyro == "raw":
            rate, acceleration = _native.gyro_filters(
                rate,
                self.gyro_rate_hz,
                list(self.gyro_notches),
                self.values["gyro_filter"],
                self._derivative_cutoff_hz,
                per_loop,
                single_precision,
            )
        elif flags.acceleration is not None:
            acceleration = np.asarray(flags.acceleration, dtype=np.float64)
        else:
            acceleration = self._acceleration(rate, single_precision)
        terms = self._controller(setpoint, rate, acceleration, flags, single_precision)
        output = terms.pop("output")
        return self._scaled(LoopRun(output, terms, rate), setpoint)

    def _scaled(self, run: LoopRun, _setpoint: np.ndarray) -> LoopRun:
        return run


@dataclass(frozen=True, repr=False)
class Px4MulticopterLoop(Px4Loop):
    """One axis of a multicopter: output is the normalised torque set-point.

    P, I and D are multiplied by K, feed-forward is not. The derivative acts on the measured angular
    acceleration, which is the difference of the filtered gyro behind IMU_DGYRO_CUTOFF, so a step of
    the set-point does not reach it. The rate set-point waits at least one loop (the attitude
    controller runs on the estimator's output; its own rate is not modelled).

    Example
    -------
    >>> from flightid.control.autopilots import axis_loop
    >>> axis_loop("px4_multicopter", "pitch", loop_rate_hz=400.0)
    AxisLoop(px4_multicopter pitch, 400 Hz, P 0.15, I 0.2, D 0.003, FF 0)
    """

    autopilot: ClassVar[str] = "px4_multicopter"
    set_point_delay_loops: ClassVar[int] = 1

    @property
    def angle_gain_1_s(self) -> float:
        """MC_ROLL_P, MC_PITCH_P or MC_YAW_P, 1/s."""
        return self.values["angle_p"]

    @property
    def _gains(self) -> dict[str, float]:
        k = self.values["k"]
        return {role: k * self.values[role] for role in ("p", "i", "d")} | {
            role: self.values[role] for role in ("ff", "int_limit")
        }

    def _feedback_terms(self, omega: Omega) -> dict[str, Response]:
        terms = self._error_terms(omega) | {"d": self._slope(omega)}
        return {role: self.values["k"] * term for role, term in terms.items()}

    def _forward_terms(self, omega: Omega) -> dict[str, Response]:
        terms = {r: self.values["k"] * term for r, term in self._error_terms(omega).items()}
        return terms | {"ff": np.ones(omega.size, dtype=np.complex128)}


@dataclass(frozen=True, repr=False)
class Px4FixedWingLoop(Px4Loop):
    """One axis of an aeroplane: output is the normalised torque set-point without trim.

    P, I and D are scaled by the square of trim airspeed over airspeed, feed-forward by its first
    power.

    Attributes
    ----------
    airspeed_scale : float
        FW_AIRSPD_TRIM over airspeed, as the autopilot limits it; 1 with FW_ARSP_SCALE_EN 0.

    Example
    -------
    >>> from flightid.control.autopilots import axis_loop
    >>> axis_loop("px4_fixed_wing", "roll", loop_rate_hz=200.0).angle_gain_1_s
    2.5
    """

    airspeed_scale: float = 1.0
    autopilot: ClassVar[str] = "px4_fixed_wing"

    def __post_init__(self) -> None:
        super().__post_init__()
        if not self.airspeed_scale > 0:
            raise OptionError(
                "the airspeed scaling has no meaning",
                found=self.airspeed_scale,
                needed="a positive number",
            )

    @property
    def angle_gain_1_s(self) -> float:
        """One over FW_R_TC or FW_P_TC, 1/s.

        Raises
        ------
        OptionError
            The yaw axis has no angle controller.
        """
        if "angle_tc" not in self.values:
            raise OptionError(
                "no angle controller on this axis", found=self.axis, needed="roll, pitch"
            )
        return 1 / self.values["angle_tc"]

    @property
    def _gains(self) -> dict[str, float]:
        return super()._gains | {"ff": 0.0}

    def _feedback_terms(self, omega: Omega) -> dict[str, Response]:
        terms = self._error_terms(omega) | {"d": self._slope(omega)}
        return {role: self.airspeed_scale**2 * term for role, term in terms.items()}

    def _forward_terms(self, omega: Omega) -> dict[str, Response]:
        square = self.airspeed_scale**2
        terms = {role: square * term for role, term in self._error_terms(omega).items()}
        return terms | {"ff": np.full(omega.size, self.airspeed_scale, dtype=np.complex128)}

    def _scaled(self, run: LoopRun, setpoint: np.ndarray) -> LoopRun:
        terms = {name: self.airspeed_scale**2 * values for name, values in run.terms.items()}
        terms["FF"] = self.values["ff"] * self.airspeed_scale * setpoint
        return LoopRun(sum(terms.values(), np.zeros(setpoint.size)), terms, run.rate)
