"""Settings of the simulated ArduPilot controller, named after its parameters."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, replace
from typing import Any, Literal

from flightid.errors import OptionError, UnknownNameError
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
class Autopilot:
    """The autopilot: loop rate, filters, gains and motor outputs, with ArduCopter's defaults.

    Rate gains are reduced from ArduCopter's defaults to what a 450 mm frame on a heavy gimbal
    takes. Body-frame rate feed-forward is off (ATC_RATE_FF_ENAB 0), as is advised for sweeps.

    Attributes
    ----------
    loop_rate_hz : float
        SCHED_LOOP_RATE, Hz.
    gyro_filter_hz : float
        INS_GYRO_FILTER, Hz (two poles); 0 is off.
    rate : tuple of RateGains
        Rate controllers of roll, pitch and yaw.
    angle_p : tuple of float
        ATC_ANG_xxx_P, 1/s.
    acceleration_rad_s2 : tuple of float
        ATC_ACCEL_x_MAX, rad/s².
    thrust_expo, spin_min, spin_max : float
        MOT_THST_EXPO, MOT_SPIN_MIN, MOT_SPIN_MAX.
    pwm_min_us, pwm_max_us, pwm_step_us : float
        Range and step of the motor output, µs; a step of 0 is continuous.
    voltage_ratio : float
        Battery voltage over its full value; the mixer compensates for it.

    Raises
    ------
    OptionError
        A value without meaning.

    Example
    -------
    >>> Autopilot().parameters()["INS_GYRO_FILTER"]
    80.0
    """

    loop_rate_hz: float = 400.0
    gyro_filter_hz: float = 80.0
    rate: tuple[RateGains, RateGains, RateGains] = field(
        default_factory=lambda: (RateGains(), RateGains(), _yaw())
    )
    angle_p: Axes = (4.5, 4.5, 4.5)
    acceleration_rad_s2: Axes = (19.2, 19.2, 4.7)
    thrust_expo: float = 0.65
    spin_min: float = 0.15
    spin_max: float = 0.95
    pwm_min_us: float = 1000.0
    pwm_max_us: float = 2000.0
    pwm_step_us: float = 1.0
    voltage_ratio: float = 0.95

    def __post_init__(self) -> None:
        if not (self.loop_rate_hz > 0 and 0 <= self.gyro_filter_hz < self.loop_rate_hz / 2):
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
        return fields


@dataclass(frozen=True)
class SidActivation:
    """One activation of ArduPilot's system-identification mode.

    Attributes
    ----------
    axis : int
        SID_AXIS: 1–3 input angles, 4–6 recover, 7–9 rates, 10–12 mixer, 13 thrust.
    start_s : float
        When the pilot switches to the mode, s; the chirp starts one second later.
    magnitude : float
        SID_MAGNITUDE: deg or deg/s up to axis 9, fraction of the full command above.
    start_hz, stop_hz : float
        SID_F_START_HZ and SID_F_STOP_HZ, Hz.
    fade_in_s, record_s, fade_out_s : float
        SID_T_FADE_IN, SID_T_REC and SID_T_FADE_OUT, s.
    leave_after_s : float or None
        Time after the start at which the pilot leaves the mode, s; None: it ends by itself, after
        a silent tail as long as both fades and the dwell.

    Example
    -------
    >>> SidActivation(axis=10, start_s=5.0).duration_s
    181.0
    """

    axis: int
    start_s: float
    magnitude: float = 0.15
    start_hz: float = 0.05
    stop_hz: float = 5.0
    fade_in_s: float = 5.0
    record_s: float = 130.0
    fade_out_s: float = 5.0
    leave_after_s: float | None = None

    def __post_init__(self) -> None:
        if not 1 <= self.axis <= 13:
            raise OptionError("SID_AXIS cannot be flown", found=self.axis, needed="1 to 13")

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
class PilotDoublet:
    """The pilot moves a stick one way, then the other, then back to the middle.

    Attributes
    ----------
    axis : {"roll", "pitch", "yaw"}
        Which stick.
    start_s : float
        Start, s.
    amplitude : float
        Roll or pitch angle, rad, or yaw rate, rad/s.
    width_s : float
        Length of each half, s.

    Example
    -------
    >>> PilotDoublet("roll", start_s=10.0, amplitude=0.2, width_s=0.8).end_s
    11.6
    """

    axis: Literal["roll", "pitch", "yaw"]
    start_s: float
    amplitude: float
    width_s: float = 0.8

    @property
    def end_s(self) -> float:
        """End of the second half, s."""
        return self.start_s + 2 * self.width_s
