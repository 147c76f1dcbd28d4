"""Options as data: a field with its unit, range and meaning, written once.

A method's options are one frozen dataclass that derives from `Options`, its fields made by
`option`. Checks, command line, study keys, provenance and the page of all options read the fields,
so that a new option is one line in one file.
"""

from __future__ import annotations

import dataclasses
import typing
from collections.abc import Callable, Hashable, Iterable, Mapping
from dataclasses import field
from difflib import get_close_matches
from functools import cache
from typing import Any, TypeVar

from flightid.errors import FlightidError, OptionError
from flightid.frozen import dataclass
from flightid.option_forms import (
    BAND,
    FIGURES,
    FLAG,
    NAMES,
    NOTHING,
    NUMBER,
    NUMBERS,
    SPAN,
    TRIPLE,
    WHOLE,
    WHOLES,
    WORD,
    WORDS,
    Form,
    forms_of,
)

Made = TypeVar("Made", bound="Options")
_KEY = "flightid"
_WORDS = (NAMES, WORDS)
_NUMBERS = (FIGURES, BAND, SPAN, TRIPLE, WHOLES, NUMBERS)
OFF = "none"
"""How files and commands write None, for options that may be switched off."""


@dataclass(frozen=True)
class Option:
    """What is known of one option.

    Attributes
    ----------
    name : str
    default : object
    forms : tuple of Form
        What a value may be.
    unit : str
        Of a number; empty where it has none.
    minimum, maximum : float or None
        Least and greatest number that has a meaning.
    above, below : float or None
        Bounds that a number stays off.
    choices : tuple of str
        Words that a value may be; empty where any will do.
    doc : str
        Meaning, in one sentence.

    Example
    -------
    >>> Option("draws", 300, (WHOLE,), minimum=10, doc="Vehicles drawn.").needed
    'a whole number from 10 on'
    """

    name: str
    default: object
    forms: tuple[Form, ...]
    unit: str = ""
    minimum: float | None = None
    maximum: float | None = None
    above: float | None = None
    below: float | None = None
    choices: tuple[str, ...] = ()
    doc: str = ""

    @property
    def range_words(self) -> str:
        """Range in words, empty where there is none."""
        low = f"from {self.minimum:.15g}" if self.minimum is not None else ""
        low = f"above {self.above:.15g}" if self.above is not None else low
        high = f"to {self.maximum:.15g}" if self.maximum is not None else ""
        high = f"below {self.below:.15g}" if self.below is not None else high
        if low.startswith("from") and not high:
            return f"{low} on"
        return " ".join(part for part in (low, "and" if low and high and "b" in high[0] else "",
                                          high) if part)  # fmt: skip

    @property
    def part(self) -> Form | None:
        """The form that is a dataclass of options of its own; None where there is none."""
        return next((form for form in self.forms if form.part is not None), None)

    @property
    def needed(self) -> str:
        """What a value may be, in words."""
        parts = []
        for form in self.forms:
            if form is WORD and self.choices:
                parts += [repr(word) for word in self.choices]
            elif form is NAMES and self.choices:
                parts.append("a list of " + ", ".join(map(repr, self.choices)))
            elif form in (WHOLE, NUMBER, *_NUMBERS):
                unit = f"[{self.unit}]" if self.unit else ""
                words = (form.words, self.range_words, unit)
                parts.append(" ".join(word for word in words if word))
            else:
                parts.append(form.words)
        return " or ".join(parts)

    def problem(self, value: object) -> str | None:
        """What is wrong with a value: a clause that begins with the name; None where nothing is."""
        forms = [form for form in self.forms if form.fits(value)]
        if not forms:
            return f"{self.name} has no meaning"
        form = forms[0]
        inside = value.values() if isinstance(value, Mapping) else value
        several: list[Any] = (
            list(typing.cast("Any", inside)) if form in (*_WORDS, *_NUMBERS) else [value]
        )
        if form in (WORD, *_WORDS) and self.choices and not {*several} <= {*self.choices}:
            holds = "is not known" if form is WORD else "holds a word that is not known"
            return f"{self.name} {holds}"
        if form is NAMES and len({*several}) < len(several):
            return f"{self.name} holds a name twice"
        if form in (WHOLE, NUMBER, *_NUMBERS):
            return next(filter(None, map(self._outside, several)), None)
        return None

    def _outside(self, number: float) -> str | None:
        too_small = (self.minimum is not None and number < self.minimum) or (
            self.above is not None and number <= self.above
        )
        too_large = (self.maximum is not None and number > self.maximum) or (
            self.below is not None and number >= self.below
        )
        if not (too_small or too_large):
            return None
        return f"{self.name} is too {'small' if too_small else 'large'}"


def option(
    default: Any = dataclasses.MISSING,  # noqa: ANN401 — a default of any type
    *,
    default_factory: Callable[[], Any] | None = None,
    unit: str = "",
    minimum: float | None = None,
    maximum: float | None = None,
    above: float | None = None,
    below: float | None = None,
    choices: Iterable[str] = (),
    forms: Iterable[Form] = (),
    doc: str,
) -> Any:  # noqa: ANN401 — dataclasses.field is typed by its default
    """Field of an options dataclass.

    Parameters
    ----------
    default : object
        Left out where a value must be given.
    default_factory : callable, optional
        Makes a default that can be changed, such as an empty table.
    unit : str
        Of a number.
    minimum, maximum : float, optional
        Least and greatest number.
    above, below : float, optional
        Bounds that a number stays off.
    choices : iterable of str
        Words that a value may be.
    forms : iterable of Form
        What a value may be; by default what the annotation says.
    doc : str
        Meaning, in one sentence.

    Returns
    -------
    dataclasses.Field

    Example
    -------
    >>> @dataclass(frozen=True)
    ... class Search(Options):
    ...     starts: int = option(1, minimum=1, doc="Starts of the search.")
    >>> Search(starts=0)
    Traceback (most recent call last):
    flightid.errors.OptionError: starts is too small: found 0; needed a whole number from 1 on
    """
    facts = {
        "unit": unit,
        "minimum": minimum,
        "maximum": maximum,
        "above": above,
        "below": below,
        "choices": tuple(choices),
        "doc": doc,
    }
    metadata = {_KEY: (facts, tuple(forms))}
    if default_factory is not None:
        return field(default_factory=default_factory, metadata=metadata)
    return field(default=default, metadata=metadata)


@dataclass(frozen=True)
class Options:
    """Base of every dataclass of options: checked when it is made.

    Example
    -------
    >>> @dataclass(frozen=True)
    ... class Cut(Options):
    ...     cutoff_hz: float = option(10.0, unit="Hz", above=0.0, doc="Corner of the filter.")
    >>> Cut().to_dict()
    {'cutoff_hz': 10.0}
    """

    def __post_init__(self) -> None:
        for each in options_of(type(self)):
            value = getattr(self, each.name)
            problem = each.problem(value)
            if problem is not None:
                raise OptionError(problem, found=repr(value), needed=each.needed)

    def to_dict(self) -> dict[str, object]:
        """Plain values by name, for provenance."""
        return {each.name: _plain(getattr(self, each.name)) for each in options_of(type(self))}


def options_class(name: str, keys: list[tuple[str, object, Any]]) -> type[Options]:
    """Write a class of options whose keys are worked out: name, type and `option` of each."""
    body: dict[str, Any] = {key: each for key, _, each in keys}
    body["__annotations__"] = {key: kind for key, kind, _ in keys}
    return dataclass(frozen=True)(type(name, (Options,), body))


def _plain(value: object) -> object:
    if isinstance(value, Mapping):
        return {key: _plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(item) for item in value]
    return value


def options_of(options: type) -> tuple[Option, ...]:
    """Options of a dataclass, in the order of its fields.

    Fields that were not made by `option` are left out.
    """
    return _options_of(typing.cast(Hashable, options))


@cache
def _options_of(options: Hashable) -> tuple[Option, ...]:
    assert isinstance(options, type)
    hints = typing.get_type_hints(options)
    made = []
    for each in dataclasses.fields(options):
        if _KEY not in each.metadata:
            continue
        facts, forms = each.metadata[_KEY]
        kinds = forms or tuple(forms_of(hints[each.name]))
        made_here = each.default_factory
        usual = each.default if made_here is dataclasses.MISSING else made_here()
        made.append(Option(each.name, usual, kinds, **facts))
    return tuple(made)


def checked(options: type[Made], given: Mapping[str, object], subject: str = "this method") -> Made:
    """Options from what was given by name.

    Parameters
    ----------
    options : type
        Dataclass of the options.
    given : mapping of str to object
        Values by name.
    subject : str
        What has the options, for an error.

    Returns
    -------
    Options

    Raises
    ------
    OptionError
        A name that is none of its options, or a value outside its range.
    """
    known = [each.name for each in options_of(options)]
    for name in given:
        if name not in known:
            raise OptionError(
                f"{subject} has no such option", found=name,
                needed=", ".join(known) or "none", action=_nearest(name, known),
            )  # fmt: skip
    return options(**given)


def read_options(
    options: type[Made],
    table: Mapping[str, object],
    where: str,
    *,
    error: type[FlightidError] = OptionError,
) -> Made:
    """Options from a table of a TOML file.

    Parameters
    ----------
    options : type
        Dataclass of the options.
    table : mapping of str to object
        The parsed table; lists stand for tuples, whole numbers for numbers.
    where : str
        How the file names the table, for example ``"study file, [response]"``.
    error : type
        Error to raise.

    Returns
    -------
    Options

    Raises
    ------
    FlightidError
        Of type `error`: a key that has no meaning, with the nearest that has; a key that is
        missing; a value outside its range, with key, found and range.
    """
    values = option_values(options, table, where, error=error)
    for each in options_of(options):
        if each.default is dataclasses.MISSING and each.name not in values:
            raise error(f"{where}: {each.name} is missing", needed=each.needed)
    try:
        return options(**values)
    except OptionError as said:
        problem = f"{where}: {said.problem}"
        raise error(problem, found=said.found, needed=said.needed, action=said.action) from said


def option_values(
    options: type[Options],
    table: Mapping[str, object],
    where: str,
    *,
    error: type[FlightidError] = OptionError,
) -> dict[str, Any]:
    """What a table of a TOML file gives of a dataclass's options, each checked alone.

    Parameters and errors are those of `read_options`, but for options that are missing.
    """
    known = {each.name: each for each in options_of(options)}
    values = {}
    for name, given in table.items():
        if name not in known:
            raise unknown_key(where, name, known, error)
        value = read_value(known[name], given)
        problem = known[name].problem(value)
        if problem is not None:
            raise error(f"{where}: {problem}", found=repr(given), needed=known[name].needed)
        values[name] = value
    return values


def read_value(wanted: Option, value: object) -> object:
    """A value as its option takes it, from what TOML gives; as it is where it does not fit."""
    # TOML has no word for None.
    may_be_off = NOTHING in wanted.forms and FLAG not in wanted.forms
    # 0 equals False, and is a number.
    is_off = value is False or (isinstance(value, str) and value == OFF)
    if may_be_off and is_off and OFF not in wanted.choices:
        return None
    # One name or number alone may stand for a list of one.
    if isinstance(value, str) and NAMES in wanted.forms and WORD not in wanted.forms:
        return (value,)
    if NUMBERS in wanted.forms and NUMBER not in wanted.forms and NUMBER.fits(value):
        return (float(typing.cast(float, value)),)
    form = next((form for form in wanted.forms if form.fits(value)), None)
    return value if form is None or form.read is None else form.read(value)


def unknown_key(
    where: str, name: str, known: Iterable[str], error: type[FlightidError]
) -> FlightidError:
    """Error for a key that has no meaning in a table; names the nearest one that has."""
    names = list(dict.fromkeys(known))
    needed = "one of " + ", ".join(names) if names else "no key at all"
    problem = f"{where}: there is no key {name!r}"
    return error(problem, needed=needed, action=_nearest(name, names))


def _nearest(name: str, known: Iterable[str]) -> str | None:
    near = get_close_matches(name, list(known), n=1, cutoff=0.5)
    return f"write {near[0]!r}" if near else None
