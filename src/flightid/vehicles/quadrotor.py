"""Parameters of the simulated quadrotor, with units and where their values come from."""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass
from typing import Any

from flightid.conventions import STANDARD_GRAVITY_M_S2
from flightid.errors import OptionError

Axes = tuple[float, float, float]


@dataclass(frozen=True)
class QuadrotorParameters:
    """Physical parameters of an X-frame quadrotor; the defaults are a 450 mm frame.

    Where the values come from: arm, frame, motor (57 g), propeller (13 g) and speed-controller
    (27 g) masses are the published table of the rig study (Khudairi et al.), with 0.55 kg of
    battery and autopilot; the inertias are those of these masses as points at the hubs, rods along
    the arms and a box in the middle. Thrust is that of a 920 kV motor on three cells with a 24 cm
    propeller. Axial damping and in-plane drag are blade-element values at hover for that propeller
    (Leishman, Principles of Helicopter Aerodynamics, 2nd ed., sections 3.5 and 5.4: thrust against
    axial speed at constant rotor speed, with induced flow).

    Attributes
    ----------
    mass_kg : float
        Mass, kg.
    inertia_kg_m2 : tuple of float
        Moments of inertia about x, y, z, kg m².
    arm_m : float
        Centre to rotor axis, m.
    rotor_height_m : float
        Rotor plane above the c.g., m.
    maximum_thrust_n : float
        Thrust of one motor at full throttle and full battery, N.
    thrust_expo : float
        Curve of thrust T against drive x: T/T_max = (1 − e) x + e x².
    torque_per_thrust_m : float
        Drag torque of a rotor over its thrust, m.
    thrust_per_speed_n_s2 : float
        Thrust over rotor speed squared, N s².
    rotor_inertia_kg_m2 : float
        Moment of inertia of propeller and rotating part of the motor, kg m².
    motor_lag_s : float
        Time constant of thrust, s.
    motor_delay_s : float
        Pure delay from the autopilot's output to the motor, s.
    axial_damping_n_s_m : float
        Loss of thrust of one rotor per speed along its axis, N s/m.
    in_plane_drag_n_s_m : float
        Drag of one rotor per speed in its plane, N s/m.
    on_rig : bool
        True: held at the c.g. in a gimbal; False: free flight.
    rig_inertia_kg_m2 : tuple of float
        Inertia that the gimbal adds about x, y, z, kg m².
    rig_friction_n_m_s : tuple of float
        Viscous friction of the gimbal about x, y, z, N m s.

    Raises
    ------
    OptionError
        A value without meaning.

    Example
    -------
    >>> round(QuadrotorParameters().hover_throttle, 3)
    0.403
    """

    mass_kg: float = 1.25
    inertia_kg_m2: Axes = (0.0135, 0.0138, 0.0252)
    arm_m: float = 0.225
    rotor_height_m: float = 0.0
    maximum_thrust_n: float = 7.6
    thrust_expo: float = 0.65
    torque_per_thrust_m: float = 0.016
    thrust_per_speed_n_s2: float = 1.0e-5
    rotor_inertia_kg_m2: float = 4.0e-5
    motor_lag_s: float = 0.045
    motor_delay_s: float = 0.006
    axial_damping_n_s_m: float = 0.37
    in_plane_drag_n_s_m: float = 0.05
    on_rig: bool = True
    rig_inertia_kg_m2: Axes = (0.0035, 0.0052, 0.0080)
    rig_friction_n_m_s: Axes = (0.020, 0.026, 0.012)

    def __post_init__(self) -> None:
        positive = ("mass_kg", "arm_m", "maximum_thrust_n", "thrust_per_speed_n_s2", "motor_lag_s")
        for name in positive:
            value = getattr(self, name)
            if not (value > 0 and math.isfinite(value)):
                raise OptionError(f"{name} has no meaning", found=value, needed="positive")
        if min(self.inertia_kg_m2) <= 0:
            raise OptionError(
                "inertia_kg_m2 has no meaning", found=self.inertia_kg_m2, needed="positive"
            )
        if self.hover_throttle >= 1:
            raise OptionError(
                "the motors cannot lift the vehicle",
                found=f"hover at {self.hover_throttle:.0%} of full thrust",
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
class Sensors:
    """Errors of the inertial sensors.

    Defaults: white noise of a consumer gyro on a vibrating frame sampled at 400 Hz (about ten
    times the data-sheet density 0.005 deg/s/√Hz of an MPU-6000).

    Attributes
    ----------
    gyro_noise_rad_s : float
        Standard deviation of one gyro sample, rad/s.
    gyro_bias_rad_s : tuple of float
        Bias after the autopilot's calibration, rad/s.
    accelerometer_noise_m_s2 : float
        Standard deviation of one accelerometer sample, m/s².
    accelerometer_bias_m_s2 : tuple of float
        Bias, m/s².

    Example
    -------
    >>> Sensors(gyro_noise_rad_s=0.0).gyro_noise_rad_s
    0.0
    """

    gyro_noise_rad_s: float = 0.012
    gyro_bias_rad_s: Axes = (0.002, -0.001, 0.0015)
    accelerometer_noise_m_s2: float = 0.3
    accelerometer_bias_m_s2: Axes = (0.05, -0.03, 0.1)


@dataclass(frozen=True)
class Turbulence:
    """Gusts as Gauss–Markov velocity and rotation of the air (Dryden's longitudinal form).

    The defaults are a hall, with the rotors' own stirred air; outdoors take ten times as much.

    Attributes
    ----------
    velocity_m_s : float
        Standard deviation of each velocity component, m/s.
    velocity_time_s : float
        Correlation time L/V of the velocity, s.
    rate_rad_s : float
        Standard deviation of the air's rotation about each body axis, rad/s; it acts through the
        vehicle's own aerodynamic damping.
    rate_time_s : float
        Correlation time of the rotation, s.

    Example
    -------
    >>> Turbulence(rate_rad_s=0.0).rate_rad_s
    0.0
    """

    velocity_m_s: float = 0.1
    velocity_time_s: float = 1.5
    rate_rad_s: float = 0.03
    rate_time_s: float = 0.3
