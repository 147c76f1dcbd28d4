"""A rate axis under the controllers that stay on while it is swept, in the air that it flew in."""

from __future__ import annotations

from typing import Literal

import numpy as np
from numpy.typing import NDArray

from flightid.control.autopilots.axis_loop import AxisLoop
from flightid.excitation import RateAxis
from flightid.frozen import dataclass

Array = NDArray[np.float64]
Entry = Literal["mixer", "rate", "angle"]
"""Where a sweep enters: behind the controllers, or as a set-point of rate or of angle."""
AT_REST_RAD_S = 1e-4
"""Stands for rest, where an integrator has no response."""


@dataclass(frozen=True, eq=False)
class FlownAxis(RateAxis):
    """A rate axis with its autopilot's exact loops, and the motion that is there without a sweep.

    Attributes
    ----------
    loop : AxisLoop or None
        Controllers that stay on; None: those of `RateAxis`.
    enters : {"mixer", "rate", "angle"}
        Where the sweep is added.
    still_omega_rad_s, still_density : ndarray, shape (n,)
        One-sided density of the rate without a sweep, (rad/s)²/Hz; empty: `noise_rad_s` alone.

    Example
    -------
    >>> import flightid as fid
    >>> loop = fid.axis_loop("arducopter", "roll", loop_rate_hz=400.0)
    >>> axis = FlownAxis(gain=40.0, time_constant_s=0.3, motor_lag_s=0.05, loop=loop)
    >>> abs(axis.feedback_slope(np.array([10.0]))).round(2)
    array([1.48])
    """

    loop: AxisLoop | None = None
    enters: Entry = "mixer"
    still_omega_rad_s: tuple[float, ...] = ()
    still_density: tuple[float, ...] = ()

    @property
    def full_command(self) -> float:
        """A full command, in the unit of the controllers' outputs."""
        return 1.0 if self.loop is None else self.loop.full_output

    def entry(self, omega_rad_s: Array) -> NDArray[np.complex128]:
        """From what is injected to the controller's output."""
        if self.loop is None or self.enters == "mixer":
            return super().entry(omega_rad_s)
        omega = np.maximum(omega_rad_s, AT_REST_RAD_S)
        forward = self.loop.forward(omega, with_hold=False)
        return forward if self.enters == "rate" else forward * self.loop.angle(omega)

    def feedback_slope(self, omega_rad_s: Array) -> NDArray[np.complex128]:
        """Feedback of rate and attitude, times s, as the autopilot computes it."""
        if self.loop is None:
            return super().feedback_slope(omega_rad_s)
        omega = np.maximum(omega_rad_s, AT_REST_RAD_S)
        rate = self.loop.feedback(omega, gyro="filtered", with_hold=False)
        angle = self.loop.forward(omega, with_hold=False) * self.loop.angle(omega)
        return np.asarray(1j * omega * rate + angle)

    def noise_density(self, omega_rad_s: Array, sample_time_s: float) -> Array:
        """What the rate did without a sweep, or white noise where no log tells it."""
        if not self.still_omega_rad_s:
            return super().noise_density(omega_rad_s, sample_time_s)
        logs = np.log(self.still_omega_rad_s), np.log(self.still_density)
        return np.asarray(np.exp(np.interp(np.log(omega_rad_s), *logs)))
