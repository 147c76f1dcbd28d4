"""Parameters of the simulated quadrotor, with units and where their values come from."""

from __future__ import annotations

from dataclasses import asdict
from typing import Any

from flightid.conventions import STANDARD_GRAVITY_M_S2
from flightid.errors import OptionError
from flightid.frozen import dataclass
from flightid.options import Options, option

Axes = tuple[float, float, float]


@dataclass(frozen=True)
class QuadrotorParameters(Options):
    """Physical parameters of an X-frame quadrotor; the defaults are a 450 mm frame.

    Where the values come from: arm, frame, motor (57 g), propeller (13 g) and speed-controller
    (27 g) masses are the published table of the rig study (Khudairi et al.), with 0.55 kg of
    battery and autopilot; the inertias are those of these masses as points at the hubs, rods along
    the arms and a box in the middle. Thrust is that of a 920 kV motor on three cells with a 24 cm
    propeller. Axial damping and in-plane drag are blade-element values at hover for that propeller
    (Leishman, Principles of Helicopter Aerodynamics, 2nd ed., sections 3.5 and 5.4: thrust against
    axial speed at constant rotor speed, with induced flow).

    Raises
    ------
    OptionError
        A value without meaning.

    Example
    -------
    >>> round(QuadrotorParameters().hover_throttle, 3)
    0.403
    """

    mass_kg: float = option(1.25, unit="kg", above=0.0, doc="Mass.")
    inertia_kg_m2: Axes = option(
        (0.0135, 0.0138, 0.0252), unit="kg m^2", above=0.0, doc="Moments of inertia about x, y, z."
    )
    arm_m: float = option(0.225, unit="m", above=0.0, doc="Centre to rotor axis.")
    rotor_height_m: float = option(0.0, unit="m", doc="Rotor plane above the c.g.")
    maximum_thrust_n: float = option(
        7.6, unit="N", above=0.0, doc="Thrust of one motor at full throttle and battery."
    )
    thrust_expo: float = option(
        0.65, doc="Curve of thrust T against drive x: T/T_max = (1 - e) x + e x^2."
    )
    torque_per_thrust_m: float = option(
        0.016, unit="m", doc="Drag torque of a rotor over its thrust."
    )
    thrust_per_speed_n_s2: float = option(
        1.0e-5, unit="N s^2", above=0.0, doc="Thrust over rotor speed squared."
    )
    rotor_inertia_kg_m2: float = option(
        4.0e-5, unit="kg m^2", doc="Of a propeller and the rotating part of its motor."
    )
    motor_lag_s: float = option(0.045, unit="s", above=0.0, doc="Time constant of thrust.")
    motor_delay_s: float = option(
        0.006, unit="s", doc="Pure delay from the autopilot to the motor."
    )
    axial_damping_n_s_m: float = option(
        0.37, unit="N s/m", doc="Loss of a rotor's thrust per speed along its axis."
    )
    in_plane_drag_n_s_m: float = option(
        0.05, unit="N s/m", doc="Drag of a rotor per speed in its plane."
    )
    on_rig: bool = option(True, doc="Held at the c.g. in a gimbal, or free.")
    rig_inertia_kg_m2: Axes = option(
        (0.0035, 0.0052, 0.0080), unit="kg m^2", doc="Inertia that the gimbal adds about x, y, z."
    )
    rig_friction_n_m_s: Axes = option(
        (0.020, 0.026, 0.012), unit="N m s", doc="Viscous friction of the gimbal about x, y, z."
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.hover_throttle >= 1:
            raise OptionError(
                "the motors cannot lift the vehicle",
                found=f"hover at {100.0 * self.hover_throttle:.0f} % of full thrust",
                needed="below 100 %",
            )

    @property
    def hover_throttle(self) -> float:
        """Thrust at hover over full thrust."""
        return self.mass_kg * STANDARD_GRAVITY_M_S2 / (4 * self.maximum_thrust_n)

    @property
    def total_inertia_kg_m2(self) -> Axes:
        """Moments of inertia with the gimbal where there is one, kg m²."""
        x, y, z = self.inertia_kg_m2
        if not self.on_rig:
            return (x, y, z)
        gx, gy, gz = self.rig_inertia_kg_m2
        return (x + gx, y + gy, z + gz)

    def to_native(self) -> dict[str, Any]:
        """Fields by name, as the native half reads them."""
        return asdict(self)


@dataclass(frozen=True)
class Sensors(Options):
    """Errors of the inertial sensors.

    Defaults: white noise of a consumer gyro on a vibrating frame sampled at 400 Hz (about ten
    times the data-sheet density 0.005 deg/s/√Hz of an MPU-6000).

    Example
    -------
    >>> Sensors(gyro_noise_rad_s=0.0).gyro_noise_rad_s
    0.0
    """

    gyro_noise_rad_s: float = option(
        0.012, unit="rad/s", doc="Standard deviation of a gyro's sample."
    )
    gyro_bias_rad_s: Axes = option(
        (0.002, -0.001, 0.0015), unit="rad/s", doc="Bias after the autopilot's calibration."
    )
    accelerometer_noise_m_s2: float = option(
        0.3, unit="m/s^2", doc="Standard deviation of a sample of acceleration."
    )
    accelerometer_bias_m_s2: Axes = option(
        (0.05, -0.03, 0.1), unit="m/s^2", doc="Bias of the accelerometers."
    )


@dataclass(frozen=True)
class Turbulence(Options):
    """Gusts as Gauss–Markov velocity and rotation of the air (Dryden's longitudinal form).

    The defaults are a hall, with the rotors' own stirred air; outdoors take ten times as much. The
    air's rotation acts through the vehicle's own aerodynamic damping.

    Example
    -------
    >>> Turbulence(rate_rad_s=0.0).rate_rad_s
    0.0
    """

    velocity_m_s: float = option(
        0.1, unit="m/s", doc="Standard deviation of each velocity component."
    )
    velocity_time_s: float = option(1.5, unit="s", doc="Correlation time L/V of the velocity.")
    rate_rad_s: float = option(
        0.03, unit="rad/s", doc="Standard deviation of the air's rotation about each body axis."
    )
    rate_time_s: float = option(0.3, unit="s", doc="Correlation time of the rotation.")
