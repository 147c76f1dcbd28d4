"""Where autopilots log what an inspection looks at: data, ordered best first."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Source:
    """One place of a signal in a log.

    Attributes
    ----------
    message : str
        Message or topic.
    fields : tuple of str
        Fields, summed.
    unit : str
        Unit where the log declares none.
    sign : int
        Sign that brings it to flightid's axes.
    """

    message: str
    fields: tuple[str, ...]
    unit: str = "1"
    sign: int = 1

    @property
    def label(self) -> str:
        """Message and fields, for example ``"PIDR.P+I+D"``."""
        return f"{self.message}.{'+'.join(self.fields)}"


AXES = {"roll": ("tau_phi", "p"), "pitch": ("tau_theta", "q"), "yaw": ("tau_psi", "r")}
"""Input and output that belong to each axis."""
SET_POINTS = {"roll": "p_ref", "pitch": "q_ref", "yaw": "r_ref"}
_PID = ("P", "I", "D", "FF", "DFF")

ARDUPILOT: dict[str, tuple[Source, ...]] = {
    "thrust": (Source("RATE", ("AOut",)), Source("CTUN", ("ThO",))),
    "phi": (Source("ATT", ("Roll",), "deg"), Source("AHR2", ("Roll",), "deg")),
    "theta": (Source("ATT", ("Pitch",), "deg"), Source("AHR2", ("Pitch",), "deg")),
    "speed": (Source("ARSP", ("Airspeed",), "m/s"), Source("GPS", ("Spd",), "m/s")),
    "excitation": (Source("SIDD", ("Targ",)),),
}
for _letter, _pid, _gyro, _axis in (
    ("R", "PIDR", "GyrX", "roll"),
    ("P", "PIDP", "GyrY", "pitch"),
    ("Y", "PIDY", "GyrZ", "yaw"),
):
    _tau, _rate = AXES[_axis]
    ARDUPILOT[_rate] = (
        Source("RATE", (_letter,), "deg/s"),
        Source(_pid, ("Act",), "rad/s"),
        Source("IMU", (_gyro,), "rad/s"),
    )
    ARDUPILOT[_tau] = (Source("RATE", (f"{_letter}Out",)), Source(_pid, _PID))
    ARDUPILOT[SET_POINTS[_axis]] = (
        Source("RATE", (f"{_letter}Des",), "deg/s"),
        Source(_pid, ("Tar",), "rad/s"),
    )

PX4: dict[str, tuple[Source, ...]] = {
    "thrust": (
        Source("vehicle_thrust_setpoint", ("xyz[2]",), sign=-1),
        Source("actuator_controls_0", ("control[3]",)),
    ),
    "speed": (
        Source("airspeed_validated", ("true_airspeed_m_s",), "m/s"),
        Source("airspeed", ("indicated_airspeed_m_s",), "m/s"),
    ),
}
for _number, (_axis, _old) in enumerate(
    (("roll", "rollspeed"), ("pitch", "pitchspeed"), ("yaw", "yawspeed"))
):
    _tau, _rate = AXES[_axis]
    PX4[_rate] = (
        Source("vehicle_angular_velocity", (f"xyz[{_number}]",), "rad/s"),
        Source("vehicle_attitude", (_old,), "rad/s"),
        Source("sensor_combined", (f"gyro_rad[{_number}]",), "rad/s"),
    )
    PX4[_tau] = (
        Source("vehicle_torque_setpoint", (f"xyz[{_number}]",)),
        Source("actuator_controls_0", (f"control[{_number}]",)),
    )
    PX4[SET_POINTS[_axis]] = (Source("vehicle_rates_setpoint", (_axis,), "rad/s"),)

BY_KIND = {"ardupilot": ARDUPILOT, "px4": PX4}
