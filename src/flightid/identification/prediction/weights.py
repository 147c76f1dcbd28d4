"""What the error of each output counts beside the others'."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np
from numpy.typing import NDArray

from flightid.record import Record
from flightid.units import conversion_factor, same_dimension

ANGULAR = {"rad": "deg", "deg": "deg", "rad/s": "deg/s", "deg/s": "deg/s"}
LINEAR = ("ft/s", "ft/s^2")
"""One deg, deg/s, ft/s and ft/s² count the same in J_rms (Tischler & Remple, section 14.4)."""
GUIDE = ("deg", "deg/s", *LINEAR)


def guide_weights(record: Record, outputs: tuple[str, ...]) -> NDArray[np.float64]:
    """Guide weights; by the deviation of the channel where it is of another kind."""
    weights = []
    for name in outputs:
        factor = guide_factor(record.unit(name))
        if factor is None:
            spread = float(np.std(record[name]))
            factor = 1.0 / spread if spread > 0 else 1.0
        weights.append(factor**2)
    return np.array(weights)


def weighted_error(j_rms: float, units: Iterable[str]) -> str:
    """J_rms in words: by kind of the outputs that it counts, what of it counts one.

    Example
    -------
    >>> weighted_error(1.1, ["rad/s", "m/s^2"])
    'weighted error J_rms 1.1, in which 1 deg/s and 1 ft/s² count one each'
    >>> weighted_error(0.2, ["rad"])
    'weighted error J_rms 0.2, in which 1 deg counts one'
    """
    found = {guide_unit(unit) for unit in units}
    *first, last = (f"1 {each}".replace("^2", "²") for each in GUIDE if each in found)
    words = f"{', '.join(first)} and {last} count one each" if first else f"{last} counts one"
    return f"weighted error J_rms {j_rms:.3g}, in which {words}"


def is_vehicle(units: Sequence[str]) -> bool:
    """Whether outputs are of the kinds that the guide of J_rms was made from.

    It speaks of aircraft, whose angles and rates stand beside speeds and accelerations. An angle of
    a rig that moves by a radian is none of its business.

    Example
    -------
    >>> is_vehicle(["deg/s", "ft/s^2"]), is_vehicle(["rad"])
    (True, False)
    """
    turning = [unit in ANGULAR for unit in units]
    return any(turning) and not all(turning)


def guide_factor(unit: str) -> float | None:
    """What one of `unit` counts in J_rms; None where the guide does not name its kind."""
    guide = guide_unit(unit)
    return None if guide is None else conversion_factor(unit, guide)


def guide_unit(unit: str) -> str | None:
    """Unit of J_rms for the kind of `unit`; None where the guide does not name that."""
    # Angles have no dimension, so they go by name: a percentage is not an angle.
    if unit in ANGULAR:
        return ANGULAR[unit]
    return next((guide for guide in LINEAR if same_dimension(unit, guide)), None)
