"""Augmentation of limited authority: high-passed stick, washed-out rate and attitude, as data."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields
from pathlib import Path
from typing import Any

from flightid.errors import OptionError
from flightid.frozen import dataclass
from flightid.options import Options, option
from flightid.reading import read_toml

FOLDER = Path(__file__).parent
Table = dict[str, Any]


@dataclass(frozen=True, kw_only=True)
class LawAxis(Options):
    """One axis of an augmentation: stick, rate and attitude to a series actuator.

    Reference
    ---------
    Schroeder, Watson, Tischler & Eshow, *J. Guidance, Control, and Dynamics* 18(1), 1995: the form
    (shaped, high-passed stick; angular rates; a tenth of the authority), not the numbers.
    """

    input: str = option(doc="The model's input that the law moves, and the stick that it reads.")
    unit: str = option("rad", doc="Unit of that input.")
    half_travel: float = option(above=0.0, doc="From trim to the stop, in that unit.")
    authority: float = option(0.1, above=0.0, maximum=1.0, doc="Part of the travel for the law.")
    rate: str = option(doc="Output that is damped, rad/s.")
    rate_gain: float = option(doc="Input's unit for a rad/s; positive opposes the rate.")
    rate_washout_rad_s: float = option(0.25, unit="rad/s", above=0.0, doc="Below: forgotten.")
    attitude: str | None = option(None, doc="Output that is held for a while, rad.")
    attitude_gain: float = option(0.0, doc="Input's unit for a rad; positive opposes it.")
    attitude_washout_rad_s: float = option(0.05, unit="rad/s", above=0.0, doc="Below: forgotten.")
    stick_gain: float = option(0.0, doc="Quickening: of the stick's fast part.")
    stick_high_pass_rad_s: float = option(1.0, unit="rad/s", above=0.0, doc="Below: none.")
    stick_shaping_rad_s: float = option(10.0, unit="rad/s", above=0.0, doc="Low-pass behind it.")
    gyro_rad_s: float = option(60.0, unit="rad/s", above=0.0, doc="Low-pass on the rate.")
    delay_s: float = option(0.02, unit="s", minimum=0.0, doc="Of computation.")

    @property
    def limit(self) -> float:
        """The most that the law moves the input, in its unit."""
        return self.authority * self.half_travel

    def tables(self) -> list[Table]:
        """The axis as tables ``[[block]]``."""
        moved = self.input
        name = {
            part: f"{moved}_{part}" for part in ("fast", "stick", "gyro", "rate", "angle", "law")
        }
        late = f"{moved}_late"
        filters = [
            _filter("low_pass", self.rate, name["gyro"], self.gyro_rad_s),
            _filter("washout", name["gyro"], name["rate"], self.rate_washout_rad_s),
            _filter("high_pass", moved, name["fast"], self.stick_high_pass_rad_s),
            _filter("low_pass", name["fast"], name["stick"], self.stick_shaping_rad_s),
        ]
        read, gains = [name["rate"], name["stick"]], [-self.rate_gain, self.stick_gain]
        units = {name["rate"]: "rad/s", name["law"]: self.unit}
        if self.attitude is not None:
            filters.append(
                _filter("washout", self.attitude, name["angle"], self.attitude_washout_rad_s)
            )
            read, gains = [*read, name["angle"]], [*gains, -self.attitude_gain]
            units[name["angle"]] = "rad"
        gain = {"kind": "gain", "inputs": read, "outputs": name["law"], "value": [gains]}
        return [
            *filters,
            {**gain, "units": units},
            {"kind": "delay", "inputs": name["law"], "outputs": late, "delay_s": self.delay_s},
            {"kind": "limiter", "inputs": late, "outputs": moved, "high": self.limit},
        ]


@dataclass(frozen=True)
class AugmentationLaw:
    """Axes of an augmentation.

    Attributes
    ----------
    name : str
    axes : tuple of LawAxis
        No two of them move one input.

    Raises
    ------
    OptionError
        No axis, or two for one input.

    Example
    -------
    >>> law = augmentation_law("dase")
    >>> [(axis.input, axis.limit) for axis in law.axes]
    [('lon', 0.5), ('lat', 0.45), ('ped', 0.30000000000000004)]
    """

    name: str
    axes: tuple[LawAxis, ...]

    def __post_init__(self) -> None:
        moved = [axis.input for axis in self.axes]
        if not moved or len(set(moved)) < len(moved):
            raise OptionError(
                "an augmentation needs axes of different inputs",
                found=", ".join(moved) or "none",
                needed="one [[axis]] or more",
            )

    @property
    def sensors(self) -> tuple[str, ...]:
        """Outputs that the law reads."""
        named = [each for axis in self.axes for each in (axis.rate, axis.attitude) if each]
        return tuple(dict.fromkeys(named))

    def tables(self) -> list[Table]:
        """The law as tables ``[[block]]`` of a study."""
        return [table for axis in self.axes for table in axis.tables()]


def augmentation_law(source: str | Path | Mapping[str, Any]) -> AugmentationLaw:
    """A law by its name in the library (``dase``), from a TOML file, or from the file's tables.

    Raises
    ------
    OptionError
        There is no such law, or a key is unknown or does not fit.

    Example
    -------
    >>> augmentation_law("dase").sensors
    ('q', 'theta', 'p', 'phi', 'r')
    """
    if isinstance(source, Mapping):
        content, where = source, "law"
    else:
        path = FOLDER / f"{source}.toml" if str(source) in law_names() else Path(source)
        if not path.is_file():
            raise OptionError(
                "there is no such augmentation law",
                found=str(source),
                needed=f"{', '.join(law_names())}, or a TOML file with [[axis]] tables",
            )
        content, where = read_toml(path, "an augmentation law"), path.name
    axes = content.get("axis", [])
    known = {each.name for each in fields(LawAxis)}
    for number, axis in enumerate(axes if isinstance(axes, list) else [axes]):
        strange = set(axis) - known if isinstance(axis, Mapping) else {repr(axis)}
        missing = {"input", "rate", "rate_gain", "half_travel"} - set(axis)
        if strange or missing:
            raise OptionError(
                f"{where}, [[axis]] {number + 1}: its keys do not fit",
                found=", ".join(sorted(strange)) or f"no {', '.join(sorted(missing))}",
                needed=", ".join(each.name for each in fields(LawAxis)),
            )
    return AugmentationLaw(str(content.get("name", where)), tuple(LawAxis(**a) for a in axes))


def law_names() -> tuple[str, ...]:
    """Laws of the library."""
    return tuple(sorted(path.stem for path in FOLDER.glob("*.toml")))


def _filter(kind: str, source: str, made: str, corner_rad_s: float) -> Table:
    return {"kind": kind, "inputs": source, "outputs": made, "corner_rad_s": corner_rad_s}
