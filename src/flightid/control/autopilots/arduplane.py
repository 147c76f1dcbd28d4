"""Rate and angle controllers of ArduPlane since 4.1."""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar

import numpy as np

from flightid.control.autopilots.ardupilot_loop import ArduPilotLoop
from flightid.control.autopilots.filters import Omega, Response, difference_response
from flightid.control.autopilots.loop_run import LoopFlags, LoopState
from flightid.errors import OptionError
from flightid.frozen import dataclass

DEGREES = float(np.degrees(1.0))
FULL_SERVO_DEG = 45.0


@dataclass(frozen=True, repr=False)
class ArduPlaneLoop(ArduPilotLoop):
    """One axis of an aeroplane: output in degrees of servo, 45 is full (PIDR sums to it).

    AC_PID runs on target and rate times the square of the airspeed scaling; feed-forward is scaled
    once and divided by EAS2TAS. As in the source, D_FF enters twice: with FF and by itself.

    Attributes
    ----------
    airspeed_scale : float
        SCALING_SPEED over airspeed, as the autopilot limits it.
    eas2tas : float
        True over equivalent airspeed.

    Example
    -------
    >>> from flightid.control.autopilots import axis_loop
    >>> loop = axis_loop("arduplane", "roll", loop_rate_hz=50.0)
    >>> float(abs(loop.forward([0.1])[0])) > float(abs(loop.feedback([0.1])[0]))
    True
    """

    airspeed_scale: float = 1.0
    eas2tas: float = 1.0
    autopilot: ClassVar[str] = "arduplane"
    output_unit: ClassVar[str] = "deg"
    full_output: ClassVar[float] = FULL_SERVO_DEG

    def __post_init__(self) -> None:
        super().__post_init__()
        if not (self.airspeed_scale > 0 and self.eas2tas > 0):
            raise OptionError(
                "the airspeed scaling has no meaning",
                found=f"{self.airspeed_scale} and EAS2TAS {self.eas2tas}",
                needed="positive numbers",
            )

    @property
    def angle_gain_1_s(self) -> float:
        """One over RLL2SRV_TCONST or PTCH2SRV_TCONST, 1/s.

        Raises
        ------
        OptionError
            The yaw axis has no angle controller.
        """
        if "angle_tc" not in self.values:
            raise OptionError(
                "no angle controller on this axis", found=self.axis, needed="roll, pitch"
            )
        return 1 / max(self.values["angle_tc"], 0.1)

    def state(self, logged: Mapping[str, float], setpoint_rad_s: float) -> LoopState:
        """State of the loop: PIDR holds its terms in degrees and an unfiltered target."""
        terms = {name: logged[name] / DEGREES for name in ("D", "I")}
        terms["Err"] = logged.get("Err", 0.0)
        return super().state(terms, setpoint_rad_s * self.airspeed_scale**2)

    def _feedback_terms(self, omega: Omega) -> dict[str, Response]:
        gain = DEGREES * self.airspeed_scale**2
        return {role: gain * term for role, term in self._pid_terms(omega).items()}

    def _forward_terms(self, omega: Omega) -> dict[str, Response]:
        target = self._target_filter(omega)
        terms = {role: target * term for role, term in self._feedback_terms(omega).items()}
        slope = difference_response(omega, self.loop_rate_hz)
        once = DEGREES * self.airspeed_scale / self.eas2tas
        twice = once + DEGREES * self.airspeed_scale**2
        return terms | {"ff": once * target, "d_ff": twice * target * slope}

    def _terms(
        self, setpoint: np.ndarray, rate: np.ndarray, flags: LoopFlags, single_precision: bool
    ) -> dict[str, np.ndarray]:
        square = self.airspeed_scale**2
        scaled = (setpoint * square, rate * square)
        terms = self._pid(*scaled, flags, single_precision, slew_scale=FULL_SERVO_DEG)
        for name in ("P", "I", "D", "FF", "DFF"):
            terms[name] = terms[name] * DEGREES
        terms["FF"] = (terms["FF"] + terms["DFF"]) / (self.airspeed_scale * self.eas2tas)
        terms["Tar"] = setpoint * DEGREES
        return terms
