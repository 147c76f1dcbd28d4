"""Rate and angle controllers of ArduCopter: multicopters and helicopters."""

from __future__ import annotations

from typing import ClassVar

import numpy as np
from numpy.typing import ArrayLike

from flightid import _native
from flightid.control.autopilots.angle_law import planned_acceleration
from flightid.control.autopilots.ardupilot_loop import ArduPilotLoop
from flightid.control.autopilots.filters import Omega, Response, delay_operator, difference_response
from flightid.control.autopilots.loop_run import LoopFlags
from flightid.frozen import dataclass

LEAK_SHARE = 0.02
"""Part of the excess over ILMI that a helicopter's integrator loses in each loop."""


@dataclass(frozen=True, repr=False)
class ArduCopterLoop(ArduPilotLoop):
    """One axis of a multicopter: output is the mixer's command, −1…1 (RATE.ROut).

    Filters and limits are those of AC_PID: target filter FLTT with notch NTF, error filter FLTE
    with notch NEF, derivative on error behind FLTD, IMAX, PDMX, SMAX; feed-forward FF and D_FF of
    the filtered target. Rate targets wait one loop: the flight mode and the angle controller run
    after the rate controller.

    Example
    -------
    >>> from flightid.control.autopilots import axis_loop
    >>> axis_loop("arducopter", "roll", loop_rate_hz=400.0)
    AxisLoop(arducopter roll, 400 Hz, P 0.135, I 0.135, D 0.0036, FF 0)
    """

    autopilot: ClassVar[str] = "arducopter"
    set_point_delay_loops: ClassVar[int] = 1

    @property
    def angle_gain_1_s(self) -> float:
        """ATC_ANG_xxx_P, 1/s; the square-root law takes over at large errors."""
        return self.values["angle_p"]

    def rate_setpoint(self, angle_error_rad: ArrayLike) -> np.ndarray:
        """Rate set-point of an angle error: proportional, and its square root where that brakes.

        The law plans with half of ATC_ACCEL_x_MAX, not below 40 nor above 720 deg/s² (yaw: 10 and
        120); without the parameter it stays proportional.

        Parameters
        ----------
        angle_error_rad : array_like, shape (n,)
            Component of the attitude error's rotation vector, rad.

        Returns
        -------
        ndarray, shape (n,)
            rad/s.
        """
        error = np.ascontiguousarray(np.atleast_1d(angle_error_rad), dtype=np.float64)
        most = np.radians(self.values["acceleration"] / 100.0)
        planned = planned_acceleration(self.axis, most)
        return _native.square_root_law(error, self.angle_gain_1_s, planned)

    def _feedback_terms(self, omega: Omega) -> dict[str, Response]:
        return self._pid_terms(omega)

    def _forward_terms(self, omega: Omega) -> dict[str, Response]:
        target = self._target_filter(omega)
        terms = {role: target * term for role, term in self._pid_terms(omega).items()}
        slope = difference_response(omega, self.loop_rate_hz)
        return terms | {"ff": target, "d_ff": target * slope}

    def _terms(
        self, setpoint: np.ndarray, rate: np.ndarray, flags: LoopFlags, single_precision: bool
    ) -> dict[str, np.ndarray]:
        return self._pid(setpoint, rate, flags, single_precision)


@dataclass(frozen=True, repr=False)
class ArduHeliLoop(ArduCopterLoop):
    """One axis of a helicopter: as a multicopter's, with a leaking integrator.

    Before each loop the integrator loses 2 % of what it holds beyond ILMI. The linear view is exact
    for ILMI = 0 (the leak is linear then) and, for ILMI > 0, while the integrator stays inside.
    """

    autopilot: ClassVar[str] = "arduheli"

    def _integrator(self, omega: Omega) -> Response:
        if self.values["ilmi"] > 0:
            return super()._integrator(omega)
        kept = (1 - LEAK_SHARE) * delay_operator(omega, self.loop_rate_hz)
        return np.asarray(1 / (self.loop_rate_hz * (1 - kept)))

    def _terms(
        self, setpoint: np.ndarray, rate: np.ndarray, flags: LoopFlags, single_precision: bool
    ) -> dict[str, np.ndarray]:
        leak = (LEAK_SHARE, self.values["ilmi"])
        return self._pid(setpoint, rate, flags, single_precision, leak=leak)
