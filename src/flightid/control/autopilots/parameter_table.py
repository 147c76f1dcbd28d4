"""Names, units, ranges and defaults of an autopilot's parameters, as data (`metadata/*.toml`)."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from functools import cache
from importlib.resources import files
from typing import Any, Literal

from flightid.errors import DataError, OptionError
from flightid.frozen import dataclass

Axis = Literal["roll", "pitch", "yaw"]
AXES: tuple[Axis, ...] = ("roll", "pitch", "yaw")


@dataclass(frozen=True)
class GainRange:
    """What a parameter may be.

    Attributes
    ----------
    low, high : float
        Range that the autopilot's documentation gives.
    unit : str
        Unit of the parameter.
    increment : float
        Step in which a ground station changes it; 0 where there is none.
    default : float
        Value of a fresh vehicle; 0 where there is none.
    note : str
        What else is to be known.

    Example
    -------
    >>> gain_ranges("arducopter", "roll")["ATC_RAT_RLL_P"]
    GainRange(0.01 to 0.5 1/(rad/s) by 0.005, default 0.135)
    """

    low: float
    high: float
    unit: str
    increment: float = 0.0
    default: float = 0.0
    note: str = ""

    def __repr__(self) -> str:
        """Range, unit, step and default on one line."""
        return (
            f"GainRange({self.low:g} to {self.high:g} {self.unit} by {self.increment:g}, "
            f"default {self.default:g})"
        )

    def __contains__(self, value: float) -> bool:
        """Tell whether a value is inside."""
        return self.low <= value <= self.high


@dataclass(frozen=True)
class ParameterEntry:
    """One parameter of one axis.

    Attributes
    ----------
    role : str
        What the controller uses it for.
    name : str
        The autopilot's name.
    older : tuple of str
        Earlier names of the same thing.
    absent : float or None
        Value that a firmware without the parameter acts by; None: it must be there.
    tune : bool
        Whether a designer may move it.
    range : GainRange
        What it may be.
    """

    role: str
    name: str
    older: tuple[str, ...]
    absent: float | None
    tune: bool
    range: GainRange


@cache
def parameter_entries(autopilot: str, axis: str) -> tuple[ParameterEntry, ...]:
    """Parameters of an axis of an autopilot.

    Parameters
    ----------
    autopilot : str
        ``"arducopter"``, ``"arduheli"``, ``"arduplane"``, ``"px4_multicopter"`` or
        ``"px4_fixed_wing"``.
    axis : {"roll", "pitch", "yaw"}
        Axis.

    Returns
    -------
    tuple of ParameterEntry

    Raises
    ------
    OptionError
        No such axis.

    Example
    -------
    >>> [entry.name for entry in parameter_entries("px4_multicopter", "roll")][:3]
    ['MC_ROLLRATE_P', 'MC_ROLLRATE_I', 'MC_ROLLRATE_D']
    """
    if axis not in AXES:
        raise OptionError("axis is not known", found=axis, needed=f"one of {list(AXES)}")
    source = files("flightid.control.autopilots").joinpath("metadata", f"{autopilot}.toml")
    content = tomllib.loads(source.read_text(encoding="utf-8"))
    letters = {"axis": content["axes"][axis], "short": content.get("short", {}).get(axis, "")}
    entries = (
        _entry(role, {**item, **item.get(axis, {})}, letters)
        for role, item in content["parameters"].items()
    )
    return tuple(entry for entry in entries if entry.name)


def _entry(role: str, item: Mapping[str, Any], letters: dict[str, str]) -> ParameterEntry:
    return ParameterEntry(
        role,
        item["name"].format(**letters),
        tuple(name.format(**letters) for name in item.get("older", ())),
        item.get("absent"),
        bool(item["tune"]),
        GainRange(
            float(item["low"]),
            float(item["high"]),
            item["unit"],
            float(item["increment"]),
            float(item["default"]),
            item.get("note", ""),
        ),
    )


def gain_ranges(autopilot: str, axis: str) -> dict[str, GainRange]:
    """Ranges of the parameters that a designer may move, by name."""
    return {e.name: e.range for e in parameter_entries(autopilot, axis) if e.tune}


def defaults(autopilot: str, axis: str) -> dict[str, float]:
    """Values of a fresh vehicle, by name."""
    return {e.name: e.range.default for e in parameter_entries(autopilot, axis)}


@dataclass(frozen=True)
class AxisParameters:
    """Parameters of an axis as found: values and names by role, and what was taken as absent."""

    values: dict[str, float]
    names: dict[str, str]
    assumed: tuple[str, ...]


def resolve(autopilot: str, axis: str, parameters: Mapping[str, float]) -> AxisParameters:
    """Take the parameters of an axis out of all parameters of a vehicle.

    Raises
    ------
    DataError
        Parameters that the controller cannot do without are missing; all are named.
    """
    values, names = {}, {}
    missing, assumed = [], []
    for entry in parameter_entries(autopilot, axis):
        name = next((n for n in (entry.name, *entry.older) if n in parameters), None)
        names[entry.role] = name or entry.name
        if name is not None:
            values[entry.role] = float(parameters[name])
        elif entry.absent is not None:
            values[entry.role] = entry.absent
            assumed.append(entry.name)
        else:
            missing.append(entry.name)
    if missing:
        raise DataError(
            f"the parameters do not hold the {axis} controller of {autopilot}",
            found=f"no {', '.join(missing)}",
            needed="all of them",
            action="add them to the parameters; firmware before ArduCopter 3.4, ArduPlane 4.1 and "
            "PX4 1.3 has other controllers and is not supported",
        )
    return AxisParameters(values, names, tuple(assumed))
