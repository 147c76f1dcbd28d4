"""Channel maps: from an autopilot's names to channels, as data (`channels/*.toml`)."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import replace
from functools import cache
from importlib.resources import files
from pathlib import Path
from typing import Any

from flightid.conventions import Role
from flightid.errors import DataError, FileFormatError, FlightidError, UnknownNameError
from flightid.frozen import dataclass
from flightid.reading import DOCUMENT_BYTES, bounded_bytes, parse_toml
from flightid.record.hold import HOLDS, InputHold, require_hold

# Kind of log and vehicle -> map.
DEFAULTS = {
    ("ardupilot", "copter"): "arducopter",
    ("ardupilot", "plane"): "arduplane",
    ("px4", "copter"): "px4_multicopter",
    ("px4", "plane"): "px4_fixed_wing",
    ("betaflight", "copter"): "betaflight",
    ("inav", "copter"): "inav",
    ("mavlink", "copter"): "mavlink",
    ("mavlink", "plane"): "mavlink",
    ("mavros", ""): "mavros",
}
ANGLES = ("roll", "pitch", "yaw")
_SOURCE_KEYS = {
    "message", "field", "instance", "unit", "factor", "stamp", "quaternion", "angle", "phase_scale",
    "frame", "note", "zero", "cut",
}  # fmt: skip
_CHANNEL_KEYS = {"unit", "role", "unwrap", "sets_rate", "on_request", "sources"}


@dataclass(frozen=True)
class ChannelSource:
    """One place where a log may hold a channel.

    Attributes
    ----------
    message : str
        Message or topic.
    fields : tuple of str
        Fields whose sum is the channel; for a quaternion its four elements.
    instance : int or None
        Instance; None takes the lowest.
    unit : str or None
        Unit of the stored numbers where the log declares none.
    factor : float
        Multiplies the numbers: sign and scale.
    stamp : str or None
        Field with a better stamp than the message's own, in µs; used where it exists.
    angle : str or None
        ``"roll"``, ``"pitch"`` or ``"yaw"`` of a quaternion; None for plain numbers.
    frame : str or None
        ``"enu"`` where a quaternion turns axes of ROS (x forward, y left, z up) to east, north, up;
        the angle is then that of an aircraft's axes to north, east, down. None: it is already.
    phase_scale : float or None
        Counts of a radian where the field is a phase, whose cosine is the channel: zero where the
        field is. None for plain numbers.
    zero : float
        What is logged where the channel is zero, in the log's own numbers.
    cut : bool
        Whether the firmware logs whole numbers cut towards zero: half a one is given back.
    note : str
        What the source is.

    Example
    -------
    >>> str(ChannelSource("RATE", ("ROut",)))
    'RATE.ROut'
    """

    message: str
    fields: tuple[str, ...]
    instance: int | None = None
    unit: str | None = None
    factor: float = 1.0
    stamp: str | None = None
    angle: str | None = None
    frame: str | None = None
    phase_scale: float | None = None
    zero: float = 0.0
    cut: bool = False
    note: str = ""

    def __str__(self) -> str:
        """Message and fields in the log's own names."""
        if self.angle is not None:
            return f"{self.message}.{self.fields[0].removesuffix('[0]')} ({self.angle})"
        return f"{self.message}." + "+".join(self.fields)


@dataclass(frozen=True)
class MappedChannel:
    """A channel and where it may be found.

    Attributes
    ----------
    name, unit : str
        Channel in a record and its unit there.
    role : Role
        Role in a record.
    unwrap : bool
        Whether it is an angle that jumps at the end of its range.
    sets_rate : bool
        Whether a record must not be sampled faster than this channel is logged.
    sources : tuple of ChannelSource
        The first that the log holds is taken.
    on_request : bool
        Whether a record holds it only where it is named: it may pause in flight.
    """

    name: str
    unit: str
    role: Role
    unwrap: bool
    sets_rate: bool
    sources: tuple[ChannelSource, ...]
    on_request: bool = False


@dataclass(frozen=True)
class ChannelMap:
    """Channels of a kind of vehicle and firmware, with ordered candidate sources.

    Attributes
    ----------
    title : str
        Vehicle and firmware.
    kind, vehicle : str
        Logs that it is meant for.
    channels : tuple of MappedChannel
        Channels in the order of the record.
    hold : {"zero", "first", "band_limited"} or None
        How inputs move between the stamps of the message they come from, where the firmware tells;
        a record keeps it only on those very stamps.

    Example
    -------
    >>> channel_map("arducopter")
    ChannelMap('ArduCopter', 20 channels)
    >>> [str(source) for source in channel_map("arducopter")["p"].sources]
    ['RATE.R', 'PIDR.Act', 'IMU.GyrX']
    """

    title: str
    kind: str
    vehicle: str
    channels: tuple[MappedChannel, ...]
    hold: InputHold | None = None

    def __getitem__(self, name: str) -> MappedChannel:
        """Channel of a name.

        Raises
        ------
        UnknownNameError
            The map has no such channel.
        """
        for channel in self.channels:
            if channel.name == name:
                return channel
        raise UnknownNameError(
            f"the channel map {self.title!r} has no such channel",
            found=name,
            needed="one of " + ", ".join(channel.name for channel in self.channels),
        )

    def select(self, names: Iterable[str]) -> ChannelMap:
        """Copy with the named channels only, in that order."""
        return replace(self, channels=tuple(self[name] for name in names))

    def with_roles(self, roles: Mapping[str, Role | str]) -> ChannelMap:
        """Copy in which the named channels have other roles."""
        for name in roles:
            self[name]
        changed = (replace(c, role=Role(roles.get(c.name, c.role))) for c in self.channels)
        return replace(self, channels=tuple(changed))

    def __repr__(self) -> str:
        """Title and number of channels."""
        return f"ChannelMap({self.title!r}, {len(self.channels)} channels)"


def default_map(kind: str, vehicle: str | None) -> ChannelMap:
    """The shipped map for a kind of log and vehicle.

    Raises
    ------
    DataError
        There is none, or the log does not tell its vehicle.

    Example
    -------
    >>> default_map("px4", "copter")
    ChannelMap('PX4 multicopter', 19 channels)
    """
    name = DEFAULTS.get((kind, vehicle or ""))
    if name is None:
        raise DataError(
            "no channel map is known for this log",
            found=f"kind {kind}, vehicle {vehicle or 'not told'}",
            needed=" or ".join(f"{k} {v}" for k, v in DEFAULTS),
            action="name a map, or hand in your own as a ChannelMap or a TOML file",
        )
    return channel_map(name)


def channel_map(name: str | Path) -> ChannelMap:
    """Load a channel map.

    Parameters
    ----------
    name : str or Path
        Shipped map (``"arducopter"``, ``"arduplane"``, ``"px4_multicopter"``,
        ``"px4_fixed_wing"``, ``"betaflight"``, ``"inav"``, ``"mavlink"``, ``"mavros"``), or a TOML
        file of the same form.

    Raises
    ------
    UnknownNameError
        There is no such map or file.
    FileFormatError
        The file is not a channel map.
    """
    shipped = files("flightid.logs").joinpath("channels")
    if str(name) in DEFAULTS.values():
        text: bytes | str = shipped.joinpath(f"{name}.toml").read_text(encoding="utf-8")
    elif Path(name).is_file():
        text = bounded_bytes(Path(name), DOCUMENT_BYTES)
    else:
        raise UnknownNameError(
            "there is no such channel map",
            found=name,
            needed="one of " + ", ".join(dict.fromkeys(DEFAULTS.values())) + ", or a TOML file",
        )
    try:
        return _parse(text)
    except FlightidError:
        raise
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        raise FileFormatError(
            f"{name} is not a channel map", found=f"{type(error).__name__}: {error}"
        ) from error


@cache
def _parse(text: bytes | str) -> ChannelMap:
    """The map that a text says: kept by the text, for a file may be edited while we run."""
    content = parse_toml(text, "a channel map", "the file")
    channels = tuple(_channel(name, item) for name, item in content["channels"].items())
    hold = content.get("hold")
    known = None if hold is None else require_hold(hold, HOLDS)
    return ChannelMap(content["title"], content["kind"], content["vehicle"], channels, known)


def _channel(name: str, item: dict[str, Any]) -> MappedChannel:
    _refuse_unknown(name, item, _CHANNEL_KEYS)
    return MappedChannel(
        name,
        item["unit"],
        Role(item["role"]),
        bool(item.get("unwrap", False)),
        bool(item.get("sets_rate", False)),
        tuple(_source(name, source) for source in item["sources"]),
        bool(item.get("on_request", False)),
    )


def _source(name: str, item: dict[str, Any]) -> ChannelSource:
    _refuse_unknown(name, item, _SOURCE_KEYS)
    angle = item.get("angle")
    if angle is not None:
        ANGLES.index(angle)
        named = item["quaternion"]
        whole = isinstance(named, str)
        fields = tuple(f"{named}[{i}]" for i in range(4)) if whole else tuple(named)
    else:
        fields = (item["field"],) if isinstance(item["field"], str) else tuple(item["field"])
    return ChannelSource(
        item["message"],
        fields,
        item.get("instance"),
        item.get("unit"),
        float(item.get("factor", 1.0)),
        item.get("stamp"),
        angle,
        item.get("frame"),
        item.get("phase_scale"),
        float(item.get("zero", 0.0)),
        bool(item.get("cut", False)),
        item.get("note", ""),
    )


def _refuse_unknown(name: str, item: dict[str, Any], known: set[str]) -> None:
    if unknown := set(item) - known:
        raise ValueError(f"channel {name!r} has unknown keys {sorted(unknown)}")
