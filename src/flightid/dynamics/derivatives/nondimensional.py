"""Derivatives without dimensions: fixed-wing coefficients, and a rotor's scaling."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Protocol

from flightid.errors import OptionError
from flightid.frozen import dataclass

FORCES, MOMENTS = "XYZ", "LMN"
SPEEDS = {"u": "u", "V": "u", "v": "v", "w": "w"}
"""Letter of the coefficient by speed."""
RATES = ("p", "q", "r")
FIXED_WING = "Klein and Morelli, Aircraft System Identification, 2006, sec. 3.7 and 5.1"
ROTOR = "Johnson, Helicopter Theory (1980): by air density, rotor speed and radius"


class Normalisation(Protocol):
    """How dimensional derivatives, per mass or inertia and in SI, are made free of dimensions."""

    @property
    def source(self) -> str:
        """Whose convention it is."""

    def factor(self, axis: str, variable: str) -> float | None:
        """What the dimensional derivative is divided by; None for one that has no convention."""

    def symbol(self, axis: str, variable: str) -> str:
        """Name of the coefficient."""


def _check(values: dict[str, float]) -> None:
    for name, value in values.items():
        if not (math.isfinite(value) and value > 0.0):
            raise OptionError(
                f"{name} of a normalisation is not positive", found=value, needed="above 0, in SI"
            )


@dataclass(frozen=True)
class FixedWing:
    """Geometry, mass and flight condition of an aeroplane.

    Attributes
    ----------
    mass_kg : float
    inertia_x_kg_m2, inertia_y_kg_m2, inertia_z_kg_m2 : float
    area_m2, chord_m, span_m : float
        Of the wing.
    airspeed_m_s, density_kg_m3 : float

    Raises
    ------
    OptionError
        A number that is not positive.

    Example
    -------
    >>> navion = FixedWing(1247.4, 1420.9, 4067.5, 4786.0, 17.094, 1.7374, 10.18, 53.645)
    >>> round(navion.dynamic_pressure_pa)
    1763
    >>> round(-8.402 / navion.factor("L", "p"), 3)  # Clp of the Navion
    -0.41
    """

    mass_kg: float
    inertia_x_kg_m2: float
    inertia_y_kg_m2: float
    inertia_z_kg_m2: float
    area_m2: float
    chord_m: float
    span_m: float
    airspeed_m_s: float
    density_kg_m3: float = 1.225

    def __post_init__(self) -> None:
        _check(vars(self))

    @property
    def source(self) -> str:
        """Whose convention it is."""
        return FIXED_WING

    @property
    def dynamic_pressure_pa(self) -> float:
        """ρ V²/2, Pa."""
        return 0.5 * self.density_kg_m3 * self.airspeed_m_s**2

    def _loads(self) -> dict[str, float]:
        force = self.dynamic_pressure_pa * self.area_m2
        return {
            **dict.fromkeys(FORCES, force / self.mass_kg),
            "L": force * self.span_m / self.inertia_x_kg_m2,
            "M": force * self.chord_m / self.inertia_y_kg_m2,
            "N": force * self.span_m / self.inertia_z_kg_m2,
        }

    def factor(self, axis: str, variable: str) -> float | None:
        """What the derivative is divided by, SI.

        Parameters
        ----------
        axis : {"X", "Y", "Z", "L", "M", "N"}
        variable : str
            State, state with ``dot``, or control.

        Returns
        -------
        float or None
            q̄S/m or q̄S l/I times what the variable is scaled by: speeds by V, pitch rate and
            α̇ by c/(2V), roll and yaw rate by b/(2V), angles and controls by one.
        """
        load = self._loads().get(axis)
        if load is None:
            return None
        speed = self.airspeed_m_s
        if variable in SPEEDS:
            return load / speed
        if variable in ("wdot", "vdot"):
            length = self.chord_m if variable == "wdot" else self.span_m
            return load * length / (2.0 * speed**2)
        if variable in ("q", "alphadot"):
            return load * self.chord_m / (2.0 * speed)
        if variable in ("p", "r", "betadot"):
            return load * self.span_m / (2.0 * speed)
        return load

    def symbol(self, axis: str, variable: str) -> str:
        """Coefficient, such as ``"Cmalpha"``; speeds w and v are the angles of the air.

        Example
        -------
        >>> FixedWing(1, 1, 1, 1, 1, 1, 1, 1).symbol("M", "w")
        'Cmalpha'
        """
        letter = axis if axis in FORCES else axis.lower()
        angle = {"w": "alpha", "v": "beta", "wdot": "alphadot", "vdot": "betadot", "V": "u"}
        return f"C{letter}{angle.get(variable, variable)}"


@dataclass(frozen=True)
class Rotorcraft:
    """Mass and rotor of a helicopter or multirotor.

    Attributes
    ----------
    mass_kg : float
    inertia_x_kg_m2, inertia_y_kg_m2, inertia_z_kg_m2 : float
    radius_m : float
        Of the rotor.
    rotor_speed_rad_s : float
        Ω.
    density_kg_m3 : float

    Raises
    ------
    OptionError
        A number that is not positive.

    Example
    -------
    >>> Rotorcraft(44.0, 1.0, 2.0, 2.0, 1.535, 89.0).symbol("X", "u")
    'CXu'
    """

    mass_kg: float
    inertia_x_kg_m2: float
    inertia_y_kg_m2: float
    inertia_z_kg_m2: float
    radius_m: float
    rotor_speed_rad_s: float
    density_kg_m3: float = 1.225

    def __post_init__(self) -> None:
        _check(vars(self))

    @property
    def source(self) -> str:
        """Whose convention it is."""
        return ROTOR

    @property
    def tip_speed_m_s(self) -> float:
        """ΩR, m/s."""
        return self.rotor_speed_rad_s * self.radius_m

    def factor(self, axis: str, variable: str) -> float | None:
        """What the derivative is divided by, SI.

        Parameters
        ----------
        axis : {"X", "Y", "Z", "L", "M", "N"}
        variable : str

        Returns
        -------
        float or None
            ρA(ΩR)²/m or ρA(ΩR)²R/I times what the variable is scaled by: speeds by ΩR, rates by Ω,
            angles and controls by one.
        """
        disk = math.pi * self.radius_m**2
        force = self.density_kg_m3 * disk * self.tip_speed_m_s**2
        inertias = dict(
            zip(
                MOMENTS,
                (self.inertia_x_kg_m2, self.inertia_y_kg_m2, self.inertia_z_kg_m2),
                strict=True,
            )
        )
        if axis in FORCES:
            load = force / self.mass_kg
        elif axis in inertias:
            load = force * self.radius_m / inertias[axis]
        else:
            return None
        if variable in SPEEDS:
            return load / self.tip_speed_m_s
        if variable in RATES or variable in ("alphadot", "betadot"):
            return load / self.rotor_speed_rad_s
        if variable in ("wdot", "vdot"):
            return load / (self.tip_speed_m_s * self.rotor_speed_rad_s)
        return load

    def symbol(self, axis: str, variable: str) -> str:
        """Coefficient, such as ``"CMq"``."""
        return f"C{axis}{variable}"


def stability_axes_forces(coefficients: dict[str, float]) -> dict[str, float]:
    """Derivatives of CX and CZ from those of lift and drag, in stability axes.

    Parameters
    ----------
    coefficients : dict of str to float
        ``CL0`` and ``CD0`` of the trim, and derivatives ``CLalpha``, ``CDalpha``, ``CLq``, …

    Returns
    -------
    dict of str to float
        ``CXalpha`` = CL0 − CDα, ``CZalpha`` = −CLα − CD0, and for any other variable the negative
        derivatives of drag and lift.

    Reference
    ---------
    Klein & Morelli, *Aircraft System Identification*, 2006, sec. 3.7, linearised about the trim.

    Example
    -------
    >>> found = stability_axes_forces({"CL0": 0.41, "CD0": 0.05, "CLalpha": 4.44, "CDalpha": 0.33})
    >>> round(found["CZalpha"], 2), round(found["CXalpha"], 2)
    (-4.49, 0.08)
    """
    found = {}
    lift, drag = coefficients.get("CL0", 0.0), coefficients.get("CD0", 0.0)
    for name, value in coefficients.items():
        variable = name[2:]
        if variable == "0" or name[:2] not in ("CL", "CD"):
            continue
        if name.startswith("CL"):
            found[f"CZ{variable}"] = -value - (drag if variable == "alpha" else 0.0)
        else:
            found[f"CX{variable}"] = (lift if variable == "alpha" else 0.0) - value
    if "CXalpha" not in found and "CZalpha" in found:
        found["CXalpha"] = lift
    return found


def to_dimensional(coefficients: Mapping[str, float], scale: FixedWing) -> dict[str, float]:
    """Dimensional derivatives, per mass or inertia and in SI, of an aeroplane's coefficients.

    Parameters
    ----------
    coefficients : mapping of str to float
        By names such as ``CYbeta``, ``Clp``, ``Cmelevator``, ``CZalpha``. Lift and drag are turned
        into forces along the axes first; their trim values ``CL0`` and ``CD0`` help with that.
    scale : FixedWing

    Returns
    -------
    dict of str to float
        By names such as ``Ybeta``, ``Lp``, ``Melevator``, ``Zalpha``.

    Raises
    ------
    OptionError
        A name that does not begin with C and one of X, Y, Z, L, D, l, m, n.

    Example
    -------
    >>> navion = FixedWing(1247.4, 1420.9, 4067.5, 4786.0, 17.094, 1.7374, 10.18, 53.645)
    >>> {name: round(value, 1) for name, value in to_dimensional({"Clp": -0.41}, navion).items()}
    {'Lp': -8.4}
    """
    lift_and_drag = {n: v for n, v in coefficients.items() if n[:2] in ("CL", "CD")}
    rest = {n: v for n, v in coefficients.items() if n not in lift_and_drag}
    found = {}
    for name, value in {**rest, **stability_axes_forces(lift_and_drag)}.items():
        letter, variable = name[1:2], name[2:]
        axis = letter if letter in FORCES else letter.upper()
        known = letter in (*FORCES, *MOMENTS.lower()) and name.startswith("C")
        if not known:
            raise OptionError(
                "name of a coefficient", found=repr(name), needed="C and one of X Y Z L D l m n"
            )
        if variable == "0":
            continue
        factor = scale.factor(axis, variable) or 0.0
        found[axis + variable] = value * factor
    return found
