"""Parameters of the simulated twin-rotor rig, with units and where their values come from."""

from __future__ import annotations

import math
from dataclasses import asdict
from typing import Any

from flightid.errors import OptionError
from flightid.frozen import dataclass

Pair = tuple[float, float]


@dataclass(frozen=True)
class TwinRotorParameters:
    """Physical parameters; pairs are (pitch, yaw) for axes and (main, tail) for rotors.

    Where the values come from: inertias, thrust curves, gravity, pitch friction, gyroscopic and
    reaction moments and motors are the manufacturer's (Feedback Instruments 33-949S, tabulated in
    many papers, e.g. Sci. Rep. 12, 17884 (2022), table 2). Three values are ours and chosen so
    that the rig has the modes that Ahmad, Chipperfield & Tokhi report for theirs: the beam hangs
    0.3 rad nose down with the rotors at rest (pitch mode 0.34 Hz when level), and cable stiffness
    and yaw friction give the yaw pair of their equation (5) (0.087 Hz, damping ratio 0.40). The
    manufacturer's yaw friction (0.1 N m s, without a cable) gives no yaw mode at all.

    Attributes
    ----------
    inertia_kg_m2 : tuple of float
        Moments of inertia about pitch and yaw, kg m².
    thrust_square_n_m, thrust_linear_n_m : tuple of float
        Moment M = a τ|τ| + b τ of each rotor against the state τ of its motor, N m.
    gravity_moment_n_m : float
        Moment of gravity with the beam a right angle from rest, N m.
    rest_angle_rad : float
        Pitch at which the beam rests with both rotors stopped, rad.
    centrifugal_kg_m2 : float
        Factor of the moment that yawing puts on pitch, kg m².
    viscous_friction_n_m_s : tuple of float
        Viscous friction of pitch and yaw, N m s.
    coulomb_friction_n_m : tuple of float
        Coulomb friction of pitch and yaw, N m.
    cable_stiffness_n_m : float
        Stiffness of the cable against yaw, N m/rad.
    gyroscopic_s : float
        Moment on pitch per main thrust moment and yaw rate, s.
    reaction_gain : float
        Yaw moment per main thrust moment in the steady state.
    reaction_lead_s, reaction_lag_s : float
        Time constants of the reaction, s.
    motor_gain_per_v : tuple of float
        State τ of each motor per volt.
    motor_lag_s : tuple of float
        Time constant of each motor, s.
    maximum_voltage_v : float
        Limit of the amplifiers either side of zero, V.
    yaw_locked : bool
        True: one degree of freedom.

    Raises
    ------
    OptionError
        A value without meaning.

    Example
    -------
    >>> TwinRotorParameters().motor_lag_s
    (1.1, 1.0)
    """

    inertia_kg_m2: Pair = (0.068, 0.02)
    thrust_square_n_m: Pair = (0.0135, 0.02)
    thrust_linear_n_m: Pair = (0.0924, 0.09)
    gravity_moment_n_m: float = 0.32
    rest_angle_rad: float = -0.3
    centrifugal_kg_m2: float = 0.0326
    viscous_friction_n_m_s: Pair = (0.006, 0.0087)
    coulomb_friction_n_m: Pair = (0.001, 0.0005)
    cable_stiffness_n_m: float = 0.006
    gyroscopic_s: float = 0.05
    reaction_gain: float = -0.2
    reaction_lead_s: float = 3.5
    reaction_lag_s: float = 2.0
    motor_gain_per_v: Pair = (1.1, 0.8)
    motor_lag_s: Pair = (1.1, 1.0)
    maximum_voltage_v: float = 2.5
    yaw_locked: bool = False

    def __post_init__(self) -> None:
        for name in ("inertia_kg_m2", "thrust_linear_n_m", "motor_gain_per_v", "motor_lag_s"):
            self._require(name, min(getattr(self, name)) > 0, "positive")
        for name in ("gravity_moment_n_m", "reaction_lag_s", "maximum_voltage_v"):
            self._require(name, getattr(self, name) > 0, "positive")
        for name in ("thrust_square_n_m", "viscous_friction_n_m_s", "coulomb_friction_n_m"):
            self._require(name, min(getattr(self, name)) >= 0, "zero or more")
        self._require("cable_stiffness_n_m", self.cable_stiffness_n_m >= 0, "zero or more")
        self._require("rest_angle_rad", abs(self.rest_angle_rad) < math.pi / 2, "within ±π/2")
        lift = self.gravity_moment_n_m * math.sin(-self.rest_angle_rad)
        needed_v = self.speed_for(0, lift) / self.motor_gain_per_v[0]
        if abs(needed_v) > self.maximum_voltage_v:
            raise OptionError(
                "the main rotor cannot hold the beam level",
                found=f"{needed_v:.3g} V needed",
                needed=f"at most {self.maximum_voltage_v:g} V",
            )

    def _require(self, name: str, holds: bool, needed: str) -> None:
        if not holds:
            raise OptionError(f"{name} has no meaning", found=getattr(self, name), needed=needed)

    def speed_for(self, rotor: int, moment_n_m: float) -> float:
        """State τ of a motor at which its rotor gives a moment (N m): root of a τ|τ| + b τ = M."""
        a, b = self.thrust_square_n_m[rotor], self.thrust_linear_n_m[rotor]
        size = abs(moment_n_m)
        # This form of the root stays accurate as a goes to zero.
        return math.copysign(2 * size / (b + math.sqrt(b * b + 4 * a * size)), moment_n_m)

    def thrust_slope(self, rotor: int, tau: float) -> float:
        """Slope 2 a |τ| + b of a rotor's moment, N m."""
        return 2 * self.thrust_square_n_m[rotor] * abs(tau) + self.thrust_linear_n_m[rotor]

    def to_native(self) -> dict[str, Any]:
        """Fields by name, as the native half reads them."""
        return asdict(self)


@dataclass(frozen=True)
class Encoders:
    """Position sensors of the rig.

    Attributes
    ----------
    step_rad : float
        Angle of one count, rad; the default is that of 2048 lines counted in quadrature.
    noise_rad : float
        Standard deviation of white noise before quantisation, rad.

    Raises
    ------
    OptionError
        A negative value.

    Example
    -------
    >>> round(Encoders().step_rad, 6)
    0.000767
    """

    step_rad: float = 2 * math.pi / 8192
    noise_rad: float = 0.0002

    def __post_init__(self) -> None:
        if min(self.step_rad, self.noise_rad) < 0:
            raise OptionError("an encoder has no such error", found=self, needed="zero or more")


@dataclass(frozen=True)
class Draught:
    """Moving air as Gauss–Markov moments on the beam; the default is a quiet laboratory.

    Attributes
    ----------
    moment_n_m : tuple of float
        Standard deviation of the moment on pitch and on yaw, N m.
    time_s : float
        Correlation time, s.

    Raises
    ------
    OptionError
        A negative value.

    Example
    -------
    >>> Draught(moment_n_m=(0.0, 0.0)).time_s
    0.5
    """

    moment_n_m: Pair = (0.0005, 0.0002)
    time_s: float = 0.5

    def __post_init__(self) -> None:
        if min(*self.moment_n_m, self.time_s) < 0:
            raise OptionError("the air cannot move so", found=self, needed="zero or more")
