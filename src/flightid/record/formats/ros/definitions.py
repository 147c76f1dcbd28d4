"""Message definitions of ROS: text to fields. They are parsed, never turned into code."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Any

from flightid.errors import FileFormatError
from flightid.extras import extra_module
from flightid.frozen import dataclass

Definitions = Mapping[str, tuple["Field", ...]]
SECTION = re.compile(r"^={3,}\s*$", re.MULTILINE)
LINE = re.compile(
    r"(?P<type>\w[\w/]*)(?:<=\d+)?(?P<array>\[(?:<=\d+|(?P<count>\d{0,9}))\])?\s+"
    r"(?P<name>[A-Za-z]\w*)\s*(?P<rest>.*)"
)
LONGEST_DEFINITION = 1 << 18
OF_ROS1 = {"Header": "std_msgs/Header"}
STORES = ("LATEST", "ROS2_HUMBLE", "ROS2_FOXY")
"""Releases whose message types the extra brings, the newest first."""


@dataclass(frozen=True)
class Field:
    """A field of a message.

    Attributes
    ----------
    name : str
    type : str
        Such as "float64" or "geometry_msgs/Vector3".
    count : int or None
        Elements of an array; None: a single value; -1: as many as a message says.
    """

    name: str
    type: str
    count: int | None = None


def short_name(text: str) -> str:
    """Name of a type as both ROS write it.

    Example
    -------
    >>> short_name("sensor_msgs/msg/Imu")
    'sensor_msgs/Imu'
    """
    return text.replace("/msg/", "/")


def parsed(type_name: str, text: str) -> Definitions:
    """Fields of a message type and of those in it, from the text that a bag holds.

    Parameters
    ----------
    type_name : str
        As `short_name` gives it.
    text : str
        Definition, then those of the types in it, parted by lines of ``=``.

    Raises
    ------
    FileFormatError
        A line is no definition, or there are too many.

    Example
    -------
    >>> parsed("a/B", "float64 x  # m")
    {'a/B': (Field(name='x', type='float64', count=None),)}
    """
    if len(text) > LONGEST_DEFINITION:
        raise FileFormatError(
            f"the definition of {type_name[:60]} is too long",
            found=f"{len(text)} letters",
            needed=f"at most {LONGEST_DEFINITION}",
        )
    found: dict[str, tuple[Field, ...]] = {}
    for place, section in enumerate(SECTION.split(text)):
        name, body = type_name, section
        if place:
            head, _, body = section.strip().partition("\n")
            name = short_name(head.removeprefix("MSG:").strip())
        package = name.rpartition("/")[0]
        lines = (line.partition("#")[0].strip() for line in body.splitlines())
        fields = (_field(line, package) for line in lines if line and not line.startswith("@"))
        found.setdefault(name, tuple(field for field in fields if field is not None))
    return found


def _field(line: str, package: str) -> Field | None:
    """Field of a line; None for a constant."""
    match = LINE.fullmatch(line)
    if match is None:
        raise FileFormatError(
            "a message definition of the bag is not one",
            found=line[:60],
            needed="lines of a type and a name",
        )
    if match["rest"].startswith("=") and not match["array"]:
        return None
    kind = OF_ROS1.get(match["type"], match["type"])
    is_own = "/" not in kind and kind[0].isupper()
    kind = short_name(f"{package}/{kind}" if is_own else kind)
    count = None if not match["array"] else int(match["count"] or -1)
    return Field(match["name"], kind, count)


def shipped(type_name: str) -> Definitions | None:
    """Fields of a message type that ROS ships, for bags that hold no definitions.

    Raises
    ------
    OptionError
        The extra that brings them is not installed.
    """
    systems = extra_module("rosbags.typesys", "a bag without message definitions (before Iron)")
    for name in STORES:
        if (store := getattr(systems.Stores, name, None)) is None:
            continue
        fields = systems.get_typestore(store).fielddefs
        if _long_name(type_name) in fields:
            return {short_name(key): _converted(value[1]) for key, value in fields.items()}
    return None


def _long_name(type_name: str) -> str:
    package, _, name = type_name.partition("/")
    return f"{package}/msg/{name}"


def _converted(fields: list[tuple[str, Any]]) -> tuple[Field, ...]:
    """Fields as the library has them: nodes are 1 base, 2 named, 3 array, 4 sequence."""
    made = []
    for name, (outer, value) in fields:
        kind, content = (outer, value) if outer < 3 else value[0]
        count = None if outer < 3 else value[1] if outer == 3 else -1
        made.append(Field(name, short_name(content if kind == 2 else content[0]), count))
    return tuple(made)
