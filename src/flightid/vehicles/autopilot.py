"""Settings of the simulated ArduPilot controller, named after its parameters."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from dataclasses import asdict, field, replace
from typing import Any

from flightid.control.autopilots.angle_law import planned_acceleration
from flightid.control.autopilots.parameter_table import AXES, Axis
from flightid.errors import OptionError, UnknownNameError
from flightid.frozen import dataclass
from flightid.options import Options, option
from flightid.vehicles.quadrotor import Axes

AXIS_LETTERS = ("RLL", "PIT", "YAW")


@dataclass(frozen=True)
class RateGains:
    """ATC_RAT_xxx parameters of one axis (AC_PID; notches off).

    Attributes
    ----------
    p, i, d : float
        P in 1/(rad/s), I in 1/rad, D in 1/(rad/s²).
    ff, d_ff : float
        Feed-forward of the target, 1/(rad/s), and of its derivative, 1/(rad/s²).
    imax, pdmx : float
        Bounds of the integrator and of |P + D| (0 is off).
    fltt, flte, fltd : float
        Cut-offs of target, error and derivative filters, Hz (0 is off).
    smax : float
        Slew rate of P + D beyond which both are lowered, 1/s (0 is off).

    Example
    -------
    >>> RateGains(p=0.2).p
    0.2
    """

    p: float = 0.09
    i: float = 0.09
    d: float = 0.0024
    ff: float = 0.0
    d_ff: float = 0.0
    imax: float = 0.5
    pdmx: float = 0.0
    fltt: float = 20.0
    flte: float = 0.0
    fltd: float = 20.0
    smax: float = 0.0

    def to_native(self) -> dict[str, Any]:
        """Fields by name, as the native half reads them."""
        off = (0.0, 0.0, 0.0)
        return asdict(self) | {"target_notch": off, "error_notch": off}


def _yaw() -> RateGains:
    return RateGains(p=0.25, i=0.02, d=0.0, flte=2.5)


@dataclass(frozen=True)
class Autopilot(Options):
    """The autopilot: loop rate, filters, gains and motor outputs, with ArduCopter's defaults.

    Rate gains (`rate`: of roll, pitch and yaw) are reduced from ArduCopter's defaults to what a
    450 mm frame on a heavy gimbal takes. Body-frame rate feed-forward is off (ATC_RATE_FF_ENAB 0),
    as is advised for sweeps.

    Raises
    ------
    OptionError
        A value without meaning.

    Example
    -------
    >>> Autopilot().parameters()["INS_GYRO_FILTER"]
    80.0
    """

    loop_rate_hz: float = option(400.0, unit="Hz", above=0.0, doc="SCHED_LOOP_RATE.")
    gyro_filter_hz: float = option(
        80.0, unit="Hz", minimum=0.0, doc="INS_GYRO_FILTER, two poles; 0 is off."
    )
    rate: tuple[RateGains, RateGains, RateGains] = field(
        default_factory=lambda: (RateGains(), RateGains(), _yaw())
    )
    angle_p: Axes = option((4.5, 4.5, 4.5), unit="1/s", doc="ATC_ANG_xxx_P.")
    acceleration_rad_s2: Axes = option((19.2, 19.2, 4.7), unit="rad/s^2", doc="ATC_ACCEL_x_MAX.")
    thrust_expo: float = option(0.65, doc="MOT_THST_EXPO.")
    spin_min: float = option(0.15, doc="MOT_SPIN_MIN.")
    spin_max: float = option(0.95, doc="MOT_SPIN_MAX.")
    pwm_min_us: float = option(1000.0, unit="us", doc="Least motor output.")
    pwm_max_us: float = option(2000.0, unit="us", doc="Largest motor output.")
    pwm_step_us: float = option(
        1.0, unit="us", minimum=0.0, doc="Step of the motor output; 0 is continuous."
    )
    voltage_ratio: float = option(
        0.95, doc="Battery voltage over its full value; the mixer compensates for it."
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.gyro_filter_hz >= self.loop_rate_hz / 2:
            raise OptionError(
                "the gyro filter does not fit the loop",
                found=f"{self.gyro_filter_hz} Hz at {self.loop_rate_hz} Hz",
                needed="a cut-off from 0 to below half the loop rate",
            )

    def parameters(self) -> dict[str, float]:
        """The same settings under ArduPilot's parameter names and units."""
        named = {
            "SCHED_LOOP_RATE": self.loop_rate_hz,
            "INS_GYRO_FILTER": self.gyro_filter_hz,
            "ATC_RATE_FF_ENAB": 0.0,
            "MOT_THST_EXPO": self.thrust_expo,
            "MOT_SPIN_MIN": self.spin_min,
            "MOT_SPIN_MAX": self.spin_max,
            "MOT_PWM_MIN": self.pwm_min_us,
            "MOT_PWM_MAX": self.pwm_max_us,
            "FRAME_CLASS": 1.0,
            "FRAME_TYPE": 1.0,
        }
        for index, letters in enumerate(AXIS_LETTERS):
            for key, value in asdict(self.rate[index]).items():
                named[f"ATC_RAT_{letters}_{key.upper()}"] = value
            named[f"ATC_ANG_{letters}_P"] = self.angle_p[index]
            centidegrees = math.degrees(self.acceleration_rad_s2[index]) * 100
            named[f"ATC_ACCEL_{letters[0]}_MAX"] = round(centidegrees)
        return named

    def with_parameters(self, values: Mapping[str, float]) -> Autopilot:
        """With other rate gains, angle gains or gyro filter, by ArduPilot's names.

        Raises
        ------
        UnknownNameError
            A parameter that the simulated controller does not take from a file.
        """
        rate, angle = list(self.rate), list(self.angle_p)
        gyro_filter_hz = self.gyro_filter_hz
        for name, value in values.items():
            match = re.fullmatch(r"ATC_(RAT|ANG)_(RLL|PIT|YAW)_(\w+)", name)
            kind, letters, key = match.groups() if match else ("", AXIS_LETTERS[0], "")
            place = AXIS_LETTERS.index(letters)
            if kind == "RAT" and key.lower() in asdict(rate[place]):
                rate[place] = replace(rate[place], **{key.lower(): value})
            elif kind == "ANG" and key == "P":
                angle[place] = value
            elif name == "INS_GYRO_FILTER":
                gyro_filter_hz = value
            else:
                raise UnknownNameError(
                    "the simulated autopilot does not take this parameter",
                    found=name,
                    needed="ATC_RAT_xxx_…, ATC_ANG_xxx_P or INS_GYRO_FILTER",
                )
        return replace(
            self,
            rate=(rate[0], rate[1], rate[2]),
            angle_p=(angle[0], angle[1], angle[2]),
            gyro_filter_hz=gyro_filter_hz,
        )

    def to_native(self) -> dict[str, Any]:
        """Fields by name, as the native half reads them."""
        fields = asdict(self)
        fields["rate"] = [gains.to_native() for gains in self.rate]
        most = zip(AXES, self.acceleration_rad_s2, strict=True)
        fields["acceleration_rad_s2"] = tuple(planned_acceleration(*each) for each in most)
        return fields


@dataclass(frozen=True)
class SidActivation(Options):
    """One activation of ArduPilot's system-identification mode.

    Example
    -------
    >>> SidActivation(axis=10, start_s=5.0).duration_s
    181.0
    """

    axis: int = option(
        minimum=1,
        maximum=13,
        doc="SID_AXIS: 1-3 angles, 4-6 recover, 7-9 rates, 10-12 mixer, 13 thrust.",
    )
    start_s: float = option(
        unit="s", doc="When the pilot switches to it; the chirp starts a second later."
    )
    magnitude: float = option(
        0.15, doc="SID_MAGNITUDE: deg or deg/s up to axis 9, fraction of the full command above."
    )
    start_hz: float = option(0.05, unit="Hz", above=0.0, doc="SID_F_START_HZ.")
    stop_hz: float = option(5.0, unit="Hz", above=0.0, doc="SID_F_STOP_HZ.")
    fade_in_s: float = option(5.0, unit="s", minimum=0.0, doc="SID_T_FADE_IN.")
    record_s: float = option(130.0, unit="s", above=0.0, doc="SID_T_REC.")
    fade_out_s: float = option(5.0, unit="s", minimum=0.0, doc="SID_T_FADE_OUT.")
    leave_after_s: float | None = option(
        None,
        unit="s",
        doc="When the pilot leaves the mode; default: it ends by itself, after a silent tail.",
    )

    @property
    def duration_s(self) -> float:
        """Time in the mode: a second's wait, the chirp and the silent tail, s."""
        by_itself = 1.0 + self.fade_in_s + 2.0 / self.start_hz + self.record_s + self.fade_out_s
        return by_itself if self.leave_after_s is None else min(self.leave_after_s, by_itself)

    @property
    def end_s(self) -> float:
        """End of the mode, s."""
        return self.start_s + self.duration_s

    def to_native(self) -> dict[str, Any]:
        """Fields by name, as the native half reads them."""
        fields = asdict(self)
        left = fields.pop("leave_after_s") is not None
        return fields | {"leave_s": self.end_s if left else math.inf}

    def parameters(self) -> dict[str, float]:
        """The SID_ parameters."""
        return {
            "SID_AXIS": float(self.axis),
            "SID_MAGNITUDE": self.magnitude,
            "SID_F_START_HZ": self.start_hz,
            "SID_F_STOP_HZ": self.stop_hz,
            "SID_T_FADE_IN": self.fade_in_s,
            "SID_T_REC": self.record_s,
            "SID_T_FADE_OUT": self.fade_out_s,
        }


@dataclass(frozen=True)
class PilotDoublet(Options):
    """The pilot moves a stick one way, then the other, then back to the middle.

    Example
    -------
    >>> PilotDoublet("roll", start_s=10.0, amplitude=0.2, width_s=0.8).end_s
    11.6
    """

    axis: Axis = option(choices=AXES, doc="Which stick.")
    start_s: float = option(unit="s", doc="Start.")
    amplitude: float = option(doc="Roll or pitch angle, rad, or yaw rate, rad/s.")
    width_s: float = option(0.8, unit="s", above=0.0, doc="Length of each half.")

    @property
    def end_s(self) -> float:
        """End of the second half, s."""
        return self.start_s + 2 * self.width_s
