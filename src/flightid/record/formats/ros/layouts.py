"""How messages of a type are walked: their definition as runs of numbers and repeats."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import field

from flightid.errors import FileFormatError
from flightid.frozen import dataclass
from flightid.record.formats.ros.definitions import Definitions, Field

LETTERS = {
    **{"bool": "?", "byte": "B", "char": "b", "float32": "f", "float64": "d"},
    **{"int8": "b", "int16": "h", "int32": "i", "int64": "q"},
    **{"uint8": "B", "uint16": "H", "uint32": "I", "uint64": "Q"},
}
"""Letter of `struct` by plain type."""
TIMES = {"time": "II", "duration": "ii", "builtin_interfaces/Time": "iI"}
TIMES["builtin_interfaces/Duration"] = "iI"
TEXTS = {"string": 1, "wstring": 2}
MOST_ELEMENTS = 64
"""Elements of an array that become columns; longer ones are passed over."""
MOST_VALUES, DEEPEST = 4096, 32
VECTORS = ("geometry_msgs/Vector3", "geometry_msgs/Point", "geometry_msgs/Point32")
"""Types whose numbers have the unit of the field that they stand in."""


@dataclass(frozen=True)
class NumberRun:
    """Numbers that follow one another: letters of `struct`, and the column of each, "" for none."""

    letters: str
    columns: tuple[str, ...]


@dataclass(frozen=True)
class Repeat:
    """Several of one thing: numbers of a letter, texts of some width, or steps.

    Attributes
    ----------
    count : int or None
        None: as many as the message says.
    letter, text_width, steps
        One of them says of what.
    column : str
        Of numbers that become columns, "" for none.
    """

    count: int | None = None
    letter: str = ""
    text_width: int = 0
    steps: tuple[NumberRun | Repeat, ...] = ()
    column: str = ""


@dataclass(eq=False)
class FieldLayout:
    """How messages of a type are walked.

    Attributes
    ----------
    steps : tuple of NumberRun or Repeat
    origins : dict of str to str
        Type and field by column, such as "sensor_msgs/Imu.angular_velocity".
    stamp : tuple of str
        Columns of the stamp: s and ns of a header, µs of PX4; empty where there is none.
    """

    steps: tuple[NumberRun | Repeat, ...]
    origins: dict[str, str]
    stamp: tuple[str, ...]


def layout_of(type_name: str, known: Definitions) -> FieldLayout:
    """FieldLayout of a message type.

    Raises
    ------
    FileFormatError
        A type is not defined, contains itself, or is too wide.
    """
    walk = _LayoutDraft(type_name, known)
    walk.fields(type_name, "", "", 0)
    stamp = walk.stamp
    if type_name.startswith("px4_msgs/") and "timestamp" in walk.origins:
        stamp = ("timestamp",)
    return FieldLayout(walk.taken(), walk.origins, stamp)


@dataclass(eq=False)
class _LayoutDraft:
    """A walk through a definition, depth first."""

    subject: str
    known: Definitions
    origins: dict[str, str] = field(default_factory=dict)
    stamp: tuple[str, ...] = ()
    steps: list[NumberRun | Repeat] = field(default_factory=list)
    letters: str = ""
    columns: list[str] = field(default_factory=list)
    n_values: int = 0

    def taken(self) -> tuple[NumberRun | Repeat, ...]:
        """Steps so far, the open run closed."""
        if self.letters:
            self.steps.append(NumberRun(self.letters, tuple(self.columns)))
            self.letters, self.columns = "", []
        return tuple(self.steps)

    def repeat(self, step: Repeat) -> None:
        self.taken()
        self.steps.append(step)

    def fields(self, kind: str, path: str, origin: str, depth: int) -> None:
        if kind not in self.known:
            raise self.refusal(f"{kind or 'its type'} is not defined")
        if depth > DEEPEST:
            raise self.refusal("it contains itself")
        for each in self.known[kind]:
            place = f"{path}.{each.name}" if path else each.name
            source = origin if kind in VECTORS else f"{kind}.{each.name}"
            self.field(each, place, source, depth)

    def field(self, each: Field, place: str, source: str, depth: int) -> None:
        """One field, single or many."""
        self.count()
        if each.count == 0:
            return
        if each.count is None:
            self.value(each.type, place, source, depth)
        elif 0 < each.count <= MOST_ELEMENTS and each.type not in TEXTS:
            for index in range(each.count):
                self.value(each.type, f"{place}[{index}]", source, depth)
        elif (letter := LETTERS.get(each.type)) is not None:
            column = place if each.count < 0 else ""
            if column:
                self.origins[column] = source
            self.repeat(Repeat(max(each.count, 0) or None, letter, column=column))
        else:
            self.repeat(self.many(each, depth))

    def many(self, each: Field, depth: int) -> Repeat:
        """Texts or messages that become no column."""
        count = None if each.count is None or each.count < 0 else each.count
        if each.type in TEXTS:
            return Repeat(count, text_width=TEXTS[each.type])
        inner = _LayoutDraft(self.subject, self.known, n_values=self.n_values)
        inner.value(each.type, "", "", depth + 1)
        self.n_values = inner.n_values
        steps = inner.taken()
        if not steps:
            raise self.refusal(f"many of {each.type}, which holds nothing")
        return Repeat(count, steps=_nameless(steps))

    def value(self, kind: str, place: str, source: str, depth: int) -> None:
        """One value: a number, a time, a text or a message."""
        self.count()
        if kind in TIMES:
            names = [f"{place}.s", f"{place}.ns"]
            self.letters += TIMES[kind]
            self.columns += names
            if place == "header.stamp":
                self.stamp = tuple(names)
        elif kind in LETTERS:
            self.letters += LETTERS[kind]
            self.columns.append(place)
            self.origins[place] = source
        elif kind in TEXTS:
            self.repeat(Repeat(1, text_width=TEXTS[kind]))
        else:
            self.fields(kind, place, source, depth + 1)

    def count(self) -> None:
        """Count a field or a value: a walk is bounded whatever it takes of a message."""
        self.n_values += 1
        if self.n_values > 2 * MOST_VALUES:
            raise self.refusal("thousands of fields")

    def refusal(self, found: str) -> FileFormatError:
        """No layout can be made."""
        return FileFormatError(
            f"messages of type {self.subject[:60] or '?'} cannot be told apart into fields",
            found=found[:80],
            needed="a whole definition in the bag",
        )


def _nameless(steps: Sequence[NumberRun | Repeat]) -> tuple[NumberRun | Repeat, ...]:
    return tuple(
        NumberRun(step.letters, ("",) * len(step.letters))
        if isinstance(step, NumberRun)
        else Repeat(step.count, step.letter, step.text_width, step.steps)
        for step in steps
    )
