"""Sensors away from the centre of gravity: what they would have read at it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from flightid.conditioning.smoothing import local_derivative
from flightid.errors import DataError, OptionError
from flightid.record import Record, Step
from flightid.record.unit_changes import unit_changes
from flightid.units import convert, require_match

Triad = tuple[str, str, str]
RATES: Triad = ("p", "q", "r")


def accelerations_at_cg(
    record: Record,
    position_m: tuple[float, float, float],
    *,
    accelerations: Triad = ("ax", "ay", "az"),
    rates: Triad = RATES,
    half_width: int = 2,
) -> Record:
    """Move accelerometers to the centre of gravity: a_cg = a_s − ω̇ × r − ω × (ω × r).

    Angular accelerations come from a local quadratic fit to the rates.

    Biased when: rates are so noisy that their derivative times the lever arm exceeds the
    accelerometers' own noise; then filter all channels first.

    Parameters
    ----------
    record : Record
        Data; rates as rad/s, accelerations (specific forces) as m/s², or in units that convert
        to them.
    position_m : (float, float, float)
        Position of the sensor relative to the centre of gravity, m; forward, right, down.
    accelerations, rates : (str, str, str)
        Channels along x, y, z.
    half_width : int
        Neighbours on each side of the derivative's parabola.

    Raises
    ------
    UnitError
        A channel in a unit of another dimension.
    UnknownNameError
        There is no such channel.
    OptionError
        A position that is not three finite numbers.

    Reference
    ---------
    Klein & Morelli, Aircraft System Identification, chapter 10 (accelerometer position
    corrections).

    Example
    -------
    >>> spin = Record.from_arrays(range(6), outputs={"p": [0] * 6, "q": [0] * 6, "r": [2] * 6,
    ...     "ax": [-4] * 6, "ay": [0] * 6, "az": [0] * 6}, units={"p": "rad/s", "q": "rad/s",
    ...     "r": "rad/s", "ax": "m/s^2", "ay": "m/s^2", "az": "m/s^2"})
    >>> float(accelerations_at_cg(spin, (1.0, 0.0, 0.0))["ax"][0])
    0.0
    """
    arm = _arm(position_m)
    known = _in_units(record, {"rad/s": rates, "m/s^2": accelerations})
    omega = known.matrix(rates)
    change = np.array(
        [local_derivative(rate, record.sample_time_s, half_width=half_width) for rate in omega]
    )
    lever = arm[:, None]
    moved = (
        known.matrix(accelerations)
        - np.cross(change, lever, axis=0)
        - np.cross(omega, np.cross(omega, lever, axis=0), axis=0)
    )
    return _replaced(record, known, accelerations, moved, "accelerations_at_cg", arm)


def velocities_at_cg(
    record: Record,
    position_m: tuple[float, float, float],
    *,
    velocities: Triad = ("u", "v", "w"),
    rates: Triad = RATES,
) -> Record:
    """Move measured body-axes velocities to the centre of gravity: v_cg = v_s − ω × r.

    Parameters
    ----------
    record : Record
        Data; rates as rad/s, velocities as m/s, or in units that convert to them.
    position_m : (float, float, float)
        Position of the sensor relative to the centre of gravity, m; forward, right, down.
    velocities, rates : (str, str, str)
        Channels along x, y, z.

    Raises
    ------
    UnitError
        A channel in a unit of another dimension.
    UnknownNameError
        There is no such channel.
    OptionError
        A position that is not three finite numbers.

    Reference
    ---------
    Klein & Morelli, Aircraft System Identification, chapter 10; Mettler, Tischler & Kanade
    (2002), on a vertical offset of the velocity sensor.

    Example
    -------
    >>> units = {"p": "rad/s", "q": "rad/s", "r": "rad/s", "u": "m/s", "v": "m/s", "w": "m/s"}
    >>> roll = Record.from_arrays([0, 1], units=units, outputs={"p": [1, 1], "q": [0, 0],
    ...     "r": [0, 0], "u": [5, 5], "v": [-2, -2], "w": [0, 0]})
    >>> velocities_at_cg(roll, (0.0, 0.0, 2.0))["v"].tolist()
    [0.0, 0.0]
    """
    arm = _arm(position_m)
    known = _in_units(record, {"rad/s": rates, "m/s": velocities})
    moved = known.matrix(velocities) - np.cross(known.matrix(rates), arm[:, None], axis=0)
    return _replaced(record, known, velocities, moved, "velocities_at_cg", arm)


def air_data_at_cg(
    record: Record,
    position_m: tuple[float, float, float],
    *,
    air_data: Triad = ("V", "alpha", "beta"),
    rates: Triad = RATES,
) -> Record:
    """Move airspeed and flow angles from a boom to the centre of gravity.

    The air velocity at the boom, ``V (cos α cos β, sin β, sin α cos β)``, less ω × r gives the
    velocity at the centre of gravity, and from it the speed, α = atan(w/u) and β = asin(v/V).

    Assumes: vanes that point exactly along the local flow; upwash and boom bending are not
    corrected (estimate them as scale factors by `check_consistency`).

    Parameters
    ----------
    record : Record
        Data; rates as rad/s, airspeed as m/s, angles as rad, or in units that convert to them.
    position_m : (float, float, float)
        Position of the vanes relative to the centre of gravity, m; forward, right, down.
    air_data, rates : (str, str, str)
        Channels of airspeed, angle of attack and sideslip; of p, q and r.

    Raises
    ------
    UnitError
        A channel in a unit of another dimension.
    UnknownNameError
        There is no such channel.
    DataError
        The airspeed is not positive everywhere.
    OptionError
        A position that is not three finite numbers.

    Reference
    ---------
    Klein & Morelli, Aircraft System Identification, chapter 10 (airflow angle corrections);
    Jategaonkar, Flight Vehicle System Identification, chapter 10.

    Example
    -------
    >>> units = {"p": "rad/s", "q": "rad/s", "r": "rad/s", "V": "m/s", "alpha": "rad",
    ...          "beta": "rad"}
    >>> pitch = Record.from_arrays([0, 1], units=units, outputs={"p": [0, 0], "q": [0.1, 0.1],
    ...     "r": [0, 0], "V": [20, 20], "alpha": [0, 0], "beta": [0, 0]})
    >>> air_data_at_cg(pitch, (2.0, 0.0, 0.0))["alpha"].round(4).tolist()
    [0.01, 0.01]
    """
    arm = _arm(position_m)
    speed_name, alpha_name, beta_name = air_data
    angles = (alpha_name, beta_name)
    known = _in_units(record, {"rad/s": rates, "m/s": (speed_name,), "rad": angles})
    speed, alpha, beta = known.matrix(air_data)
    if np.any(speed <= 0):
        raise DataError(
            f"airspeed {speed_name!r} is not positive everywhere",
            found=f"{float(speed.min()):.4g} m/s",
            needed="above 0 m/s: flow angles have no meaning at rest",
            action="take a segment in flight",
        )
    at_boom = speed * np.array(
        [np.cos(alpha) * np.cos(beta), np.sin(beta), np.sin(alpha) * np.cos(beta)]
    )
    u, v, w = at_boom - np.cross(known.matrix(rates), arm[:, None], axis=0)
    moved_speed = np.sqrt(u**2 + v**2 + w**2)
    moved = np.array([moved_speed, np.arctan2(w, u), np.arcsin(v / moved_speed)])
    return _replaced(record, known, air_data, moved, "air_data_at_cg", arm)


def _arm(position_m: tuple[float, float, float]) -> NDArray[np.float64]:
    arm = np.asarray(position_m, dtype=np.float64)
    if arm.shape != (3,) or not np.all(np.isfinite(arm)):
        raise OptionError(
            "position is not three finite numbers", found=position_m, needed="(x, y, z) in m"
        )
    return arm


def _in_units(record: Record, needed: Mapping[str, Sequence[str]]) -> Record:
    """The record with channels in the units that the equations need, converted where they differ.

    Raises
    ------
    UnitError
    """
    units = {name: unit for unit, names in needed.items() for name in names}
    changes = unit_changes(record, units)
    for name, unit in units.items():
        if name not in changes:
            require_match(name, record.unit(name), unit, record=str(record.name))
    return record.to_units(**changes) if changes else record


def _replaced(
    record: Record,
    known: Record,
    names: Triad,
    values: NDArray[np.float64],
    verb: str,
    arm: NDArray[np.float64],
) -> Record:
    """The record with channels moved, in its own units; values are in those of `known`."""
    x, y, z = arm.tolist()
    step = Step(f"conditioning.{verb}", {"channels": " ".join(names), "x_m": x, "y_m": y, "z_m": z})
    moved = {
        name: row
        if known.unit(name) == record.unit(name)
        else convert(row, known.unit(name), record.unit(name))
        for name, row in zip(names, values, strict=True)
    }
    return record.replace(moved, step=step)
