"""Blades and paddles: Lock numbers and the time constants that follow from them."""

from __future__ import annotations

import math

from flightid.errors import OptionError
from flightid.frozen import dataclass


@dataclass(frozen=True)
class Blade:
    """A blade, or the paddle of a stabilizer bar.

    Attributes
    ----------
    radius_m, root_m : float
        Where the aerodynamic part ends and begins.
    chord_m : float
    flapping_inertia_kg_m2 : float
        About the flapping hinge.
    lift_slope : float
        1/rad.

    Raises
    ------
    OptionError
        A number without meaning.

    Example
    -------
    >>> round(Blade(1.535, 0.1, 0.107, 0.34).lock_number(1.225), 2)
    12.2
    """

    radius_m: float
    root_m: float
    chord_m: float
    flapping_inertia_kg_m2: float
    lift_slope: float = 5.7

    def __post_init__(self) -> None:
        positive = min(self.radius_m, self.chord_m, self.flapping_inertia_kg_m2, self.lift_slope)
        if not positive > 0.0 or not 0.0 <= self.root_m < self.radius_m:
            raise OptionError(
                "a blade has a number without meaning",
                found=self,
                needed="all above 0, the root inside the radius",
            )

    def lock_number(self, density_kg_m3: float = 1.225) -> float:
        """γ = (R⁴ − r⁴) ρ c a / I_b: aerodynamic over inertial forces.

        Parameters
        ----------
        density_kg_m3 : float

        Reference
        ---------
        Mettler, Tischler & Kanade, *J. American Helicopter Society* 47(1), 2002, eq. 29.
        """
        span = self.radius_m**4 - self.root_m**4
        load = span * density_kg_m3 * self.chord_m * self.lift_slope
        return load / self.flapping_inertia_kg_m2


def effective_lock_number(
    lock_number: float, solidity: float, thrust_coefficient: float, lift_slope: float = 5.7
) -> float:
    """Lock number with the inflow that follows flapping, in hover: γ / (1 + a σ / (16 ν₀)).

    Parameters
    ----------
    lock_number : float
        γ of the blade.
    solidity, thrust_coefficient : float
        σ, and C_T by ρA(ΩR)², which gives the inflow ratio ν₀ = √(C_T/2).
    lift_slope : float
        a, 1/rad.

    Returns
    -------
    float

    Raises
    ------
    OptionError
        A number that is not positive.

    Reference
    ---------
    Mettler, Tischler & Kanade, *J. American Helicopter Society* 47(1), 2002, eq. 30.

    Example
    -------
    >>> round(effective_lock_number(8.0, 0.08, 0.005, 5.7), 4)
    5.0955
    """
    given = (lock_number, solidity, thrust_coefficient, lift_slope)
    if not min(given) > 0.0:
        raise OptionError("inflow correction", found=given, needed="numbers above 0")
    inflow = math.sqrt(thrust_coefficient / 2.0)
    return lock_number / (1.0 + lift_slope * solidity / (16.0 * inflow))


def flapping_time_constant(lock_number: float, rotor_speed_rad_s: float) -> float:
    """τ = 16 / (γ Ω), s.

    Parameters
    ----------
    lock_number : float
        Effective, where inflow counts.
    rotor_speed_rad_s : float

    Reference
    ---------
    Mettler, Tischler & Kanade, *J. American Helicopter Society* 47(1), 2002, eq. 28.

    Example
    -------
    >>> flapping_time_constant(8.0, 40.0)
    0.05
    """
    return 16.0 / (lock_number * rotor_speed_rad_s)
