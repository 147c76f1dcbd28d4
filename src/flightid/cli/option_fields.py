"""Options of a command read from the fields of options dataclasses; see `flightid.options`."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import MISSING
from functools import partial
from typing import TYPE_CHECKING, Any

import click

from flightid.cli.figures import FIGURE, QuotientRange, quotient
from flightid.cli.lists import ListOption, ListsCommand
from flightid.cli.pairs import pairs
from flightid.options import OFF

if TYPE_CHECKING:
    from flightid.option_forms import Form
    from flightid.options import Option, Options

ALL, NONE = "all", OFF
SHORT = {
    "attitude_feedback_per_s": "attitude-feedback",
    "attitude_rad": "attitude-limit",
    "band_rad_s": "band",
    "column_names": "columns",
    "control": "control-limit",
    "control_rate_per_s": "control-rate-limit",
    "duration_s": "duration",
    "excitations": "excitation",
    "gusts": "gust",
    "inertia_kg_m2": "inertia",
    "inputs": "input",
    "interfaces": "interface",
    "mass_kg": "mass",
    "noise_rad_s": "noise",
    "properties": "property",
    "rate_rad_s": "rate-limit",
    "sample_rate_hz": "rate",
    "record_column": "experiment",
    "sid_run": "run",
    "span_s": "span",
    "time_column": "time",
    "time_constant_s": "time-constant",
    "window_s": "window",
}
"""What may be typed for a long name, in every command alike."""


IN_HERTZ = (
    "band_rad_s",
    "crossover_rad_s",
    "disturbance_bandwidth_rad_s",
    "angle_crossover_rad_s",
)
"""Frequencies that may be typed in hertz too, in every command alike."""


def hertz(name: str) -> str:
    """A frequency's option in hertz.

    Example
    -------
    >>> hertz("band_rad_s")
    'band_hz'
    """
    return name.removesuffix("_rad_s") + "_hz"


def _in_hertz(one: click.Option) -> click.Option:
    name = hertz(str(one.name))
    text = f"{one.opts[-1]} in Hz, in place of rad/s."
    return click.Option(
        [f"--{name.replace('_', '-')}", name], nargs=one.nargs, type=FIGURE, help=text
    )


class OptionsCommand(ListsCommand):
    """A command whose options are those of its own and the fields of some dataclasses.

    The dataclasses are loaded when the options are asked for, so that the list of all commands
    costs nothing.

    Parameters
    ----------
    fields_of : callable
        The dataclasses, by the name of what takes them.
    """

    def __init__(
        self,
        *args: Any,  # noqa: ANN401 — as click takes them
        fields_of: Callable[[], Mapping[str, type[Options]]],
        **kwargs: Any,  # noqa: ANN401
    ) -> None:
        super().__init__(*args, **kwargs)
        self._fields_of = fields_of
        self._made: list[click.Parameter] | None = None

    def invoke(self, ctx: click.Context) -> Any:  # noqa: ANN401 — as click has it
        """Run the command, frequencies in hertz turned to rad/s."""
        for name in IN_HERTZ:
            given = ctx.params.pop(hertz(name), None)
            if given is None:
                continue
            if ctx.params.get(name) is not None:
                raise click.UsageError(f"give the frequency in rad/s or in Hz, not both: {name}")
            many = isinstance(given, tuple)
            ctx.params[name] = tuple(math.tau * f for f in given) if many else math.tau * given
        return super().invoke(ctx)

    @property
    def is_read(self) -> bool:
        """Whether the fields have been read."""
        return self._made is not None

    def get_params(self, ctx: click.Context) -> list[click.Parameter]:
        """Options of the command, then those of the fields."""
        if self._made is None:
            taken = {param.name for param in self.params}
            made = list(click_options(self._fields_of(), taken))
            self._made = [*made, *(_in_hertz(one) for one in made if one.name in IN_HERTZ)]
        # Help stays last.
        *own, last = super().get_params(ctx)
        return [*own, *self._made, last]


def click_options(
    fields_of: Mapping[str, type[Options]], taken: Iterable[str | None] = ()
) -> Iterable[click.Option]:
    """Options for the fields of several dataclasses; one of each name.

    Parameters
    ----------
    fields_of : mapping of str to type
        Dataclasses by the name of what takes them.
    taken : iterable of str
        Names that the command has already.

    Yields
    ------
    click.Option
    """
    from flightid.options import options_of

    users: dict[str, list[tuple[str, Option]]] = {}
    for user, options in fields_of.items():
        for each in options_of(options):
            users.setdefault(each.name, []).append((user, each))
    for name, uses in users.items():
        if name not in taken:
            yield _click_option(name, uses, everywhere=len(uses) == len(fields_of))


def flags_of(name: str) -> list[str]:
    """How an option is typed: the field's name with dashes, and a short form where it has one.

    Example
    -------
    >>> flags_of("band_rad_s"), flags_of("seed")
    (['--band-rad-s', '--band'], ['--seed'])
    """
    short = [f"--{SHORT[name]}"] if name in SHORT else []
    return ["--" + name.replace("_", "-"), *short]


def _click_option(name: str, uses: list[tuple[str, Option]], *, everywhere: bool) -> click.Option:
    from flightid.option_forms import (
        BAND,
        FIGURES,
        FLAG,
        NAMES,
        NUMBER,
        NUMBERS,
        TABLE,
        WHOLE,
        WHOLES,
        WORD,
        WORDS,
    )  # fmt: skip

    each = uses[0][1]
    words = list(dict.fromkeys(use.doc for _, use in uses))
    help_text = " / ".join(words)
    if each.unit:
        help_text += f" [{each.unit}]"
    if not everywhere:
        help_text += f" ({', '.join(dict.fromkeys(user for user, _ in uses))})"
    usual = {repr(use.default): use.default for _, use in uses}
    default = next(iter(usual.values())) if len(usual) == 1 else None
    if default is MISSING:
        help_text += " needed"
    elif default not in (None, (), {}):
        help_text += f" default: {_shown(default)}"
    made = partial(click.Option, [*flags_of(name), name])
    forms = {form for _, use in uses for form in use.forms}
    choices = list(dict.fromkeys(word for _, use in uses for word in use.choices))
    if BAND in forms:
        return made(nargs=2, type=FIGURE, help=help_text)
    if {NAMES, FIGURES, TABLE, WORDS} & forms:
        extra = "several with commas, or repeated"
        if {FIGURES, TABLE, WORDS} & forms:
            extra = f"NAME={'TEXT' if WORDS in forms else 'NUMBER'}, …"
            extra = f"{', '.join(choices)} or {extra}" if WORD in forms else extra
        if FLAG in forms:
            extra += f"; '{ALL}' or '{NONE}'"
        return made(multiple=True, help=f"{help_text} ({extra})")
    if {NUMBERS, WHOLES} & forms:
        return ListOption(
            [*flags_of(name), name],
            multiple=True,
            type=int if WHOLE in forms else FIGURE,
            help=f"{help_text} (several with commas, or repeated)",
        )
    if FLAG in forms:
        both = "/".join((flags_of(name)[0], f"--no-{name.replace('_', '-')}"))
        return click.Option([both, name], default=None, help=help_text)
    if WORD in forms and choices and not {NUMBER, WHOLE} & forms:
        return made(type=click.Choice(choices), help=help_text)
    return made(type=_kind(each, forms), help=help_text)


def _shown(default: object) -> str:
    if isinstance(default, bool):
        return "on" if default else "off"
    if isinstance(default, float):
        return f"{default:g}"
    return ", ".join(map(str, default)) if isinstance(default, tuple) else str(default)


def _kind(each: Option, forms: set[Form]) -> click.ParamType[Any]:
    """What click checks of one number; words beside numbers are left to the field."""
    from flightid.option_forms import NOTHING

    kind = _numbers(each, forms)
    return _OrNone(kind) if NOTHING in forms and kind is not click.STRING else kind


class _OrNone(click.ParamType[Any]):
    """A number, or the word that switches it off."""

    def __init__(self, kind: click.ParamType[Any]) -> None:
        self.kind, self.name = kind, f"{kind.name} or {NONE}"

    def convert(
        self,
        value: Any,  # noqa: ANN401 — as click hands it over
        param: click.Parameter | None,
        ctx: click.Context | None,
    ) -> Any:  # noqa: ANN401
        """The number, or the word."""
        return value if value == NONE else self.kind.convert(value, param, ctx)


def _numbers(each: Option, forms: set[Form]) -> click.ParamType[Any]:
    from flightid.option_forms import NUMBER, WHOLE, WORD

    low, high = each.minimum, each.maximum
    if WORD in forms:
        return click.STRING
    bounds = (low, high, each.above, each.below)
    if not any(bound is not None for bound in bounds):
        return click.INT if WHOLE in forms else FIGURE if NUMBER in forms else click.STRING
    if WHOLE in forms:
        return click.IntRange(
            None if low is None else int(low), None if high is None else int(high)
        )
    if NUMBER not in forms:
        return click.STRING
    return QuotientRange(
        low if each.above is None else each.above,
        high if each.below is None else each.below,
        min_open=each.above is not None,
        max_open=each.below is not None,
    )


def given_options(options: type[Options], values: Mapping[str, Any], user: str) -> dict[str, Any]:
    """What was given of a dataclass's options, as it takes them.

    Parameters
    ----------
    options : type
        Dataclass.
    values : mapping of str to object
        Values of the command's options by name; None or nothing where one was not given.
    user : str
        What takes the options, for the message.

    Returns
    -------
    dict of str to object

    Raises
    ------
    click.UsageError
        An option that belongs to something else was given.
    """
    (found,) = parted(values, {user: options})
    return found


def parted(
    values: Mapping[str, Any], fields_of: Mapping[str, type[Options]]
) -> list[dict[str, Any]]:
    """What was given, for each of several dataclasses; a name counts for all that have it.

    Parameters
    ----------
    values : mapping of str to object
        Values of the command's options by name; None or nothing where one was not given.
    fields_of : mapping of str to type
        Dataclasses by the name of what takes them.

    Returns
    -------
    list of dict of str to object
        One for each dataclass, in their order.

    Raises
    ------
    click.UsageError
        An option that belongs to none of them was given, or one that is needed was not.
    """
    from flightid.options import options_of

    known = [{each.name: each for each in options_of(options)} for options in fields_of.values()]
    given = {name: value for name, value in values.items() if value not in (None, ())}
    for name in given:
        if not any(name in one for one in known):
            user = " or ".join(filter(None, fields_of))
            names = ", ".join(dict.fromkeys(name for one in known for name in one))
            raise click.UsageError(f"{flags_of(name)[0]} is no option of {user}; it has {names}")
    for user, one in zip(fields_of, known, strict=True):
        for name, each in one.items():
            if each.default is MISSING and name not in given:
                choices = f" Choose of {', '.join(each.choices)}." if each.choices else ""
                raise click.UsageError(f"{user} needs {flags_of(name)[-1]}: {each.doc}{choices}")
    return [
        {name: _read(one[name], value) for name, value in given.items() if name in one}
        for one in known
    ]


def _read(each: Option, value: Any) -> Any:  # noqa: ANN401 — whatever the option is
    from flightid.option_forms import BAND, FLAG, NOTHING, NUMBER, WHOLE, WORD

    if value in (NONE, (NONE,)) and NOTHING in each.forms and FLAG not in each.forms:
        return value if NONE in each.choices else None
    if isinstance(value, str) and WORD in each.forms and {NUMBER, WHOLE} & set(each.forms):
        return _number_or_word(value)
    return _several(each, value) if isinstance(value, tuple) and BAND not in each.forms else value


def _several(each: Option, value: tuple[Any, ...]) -> Any:  # noqa: ANN401
    """Values of an option that may be repeated: all or none, by name, one word, or a list."""
    from flightid.option_forms import FIGURES, FLAG, TABLE, WORD, WORDS

    flag = flags_of(each.name)[-1]
    if FLAG in each.forms and value in ((ALL,), (NONE,)):
        return value == (ALL,)
    if WORDS in each.forms and (WORD not in each.forms or any("=" in v for v in value)):
        return pairs(flag, value)
    named = {FIGURES, TABLE} & set(each.forms)
    if named and (WORD not in each.forms or any("=" in str(v) for v in value)):
        return {name: _number(flag, text) for name, text in pairs(flag, value).items()}
    return value[0] if WORD in each.forms and len(value) == 1 else value


def _number_or_word(text: str) -> float | str:
    for read in (int, lambda text: float(quotient(text))):
        try:
            return read(text)
        except ValueError:
            continue
    return text


def _number(flag: str, text: str) -> float | str | tuple[float | str, ...]:
    """A number, several with colons between them, or a word."""
    if not text:
        raise click.UsageError(f"{flag} must be NAME=NUMBER")
    parts = tuple(map(_number_or_word, text.split(":")))
    return parts[0] if len(parts) == 1 else parts
