"""Options of a command read from the fields of options dataclasses; see `flightid.options`."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from typing import TYPE_CHECKING, Any

import click

if TYPE_CHECKING:
    from flightid.options import Option, Options

ALL, NONE = "all", "none"


class OptionsCommand(click.Command):
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

    def get_params(self, ctx: click.Context) -> list[click.Parameter]:
        """Options of the command, then those of the fields."""
        if self._made is None:
            taken = {param.name for param in self.params}
            self._made = list(click_options(self._fields_of(), taken))
        own = super().get_params(ctx)
        return [*own[:-1], *self._made, *own[-1:]]


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


def _click_option(name: str, uses: list[tuple[str, Option]], *, everywhere: bool) -> click.Option:
    from flightid.option_forms import BAND, FLAG, NAMES, NUMBER, NUMBERS, TABLE, WHOLE, WORD

    each = uses[0][1]
    words = list(dict.fromkeys(use.doc for _, use in uses))
    help_text = " / ".join(words)
    if each.unit:
        help_text += f" [{each.unit}]"
    if not everywhere:
        help_text += f" ({', '.join(dict.fromkeys(user for user, _ in uses))})"
    flag = "--" + name.replace("_", "-")
    forms = {form for _, use in uses for form in use.forms}
    choices = list(dict.fromkeys(word for _, use in uses for word in use.choices))
    if BAND in forms:
        return click.Option([flag, name], nargs=2, type=float, help=help_text)
    if NAMES in forms or TABLE in forms:
        extra = "repeat for several" if NAMES in forms else "or NAME=NUMBER, repeated"
        if FLAG in forms:
            extra += f"; '{ALL}' or '{NONE}'"
        return click.Option([flag, name], multiple=True, help=f"{help_text} ({extra})")
    if NUMBERS in forms:
        return click.Option([flag, name], multiple=True, type=float, help=help_text)
    if FLAG in forms:
        return click.Option([f"{flag}/--no-{flag[2:]}", name], default=None, help=help_text)
    if WORD in forms and choices and not {NUMBER, WHOLE} & forms:
        return click.Option([flag, name], type=click.Choice(choices), help=help_text)
    low, high = each.minimum, each.maximum
    if WHOLE in forms and WORD not in forms:
        kind: click.ParamType[Any] = click.IntRange(
            None if low is None else int(low), None if high is None else int(high)
        )
    elif NUMBER in forms and WORD not in forms:
        kind = click.FloatRange(
            low if each.above is None else each.above,
            high if each.below is None else each.below,
            min_open=each.above is not None,
            max_open=each.below is not None,
        )
    else:
        kind = click.STRING
    usual = {use.default for _, use in uses}
    if len(usual) == 1:
        help_text += f" default: {each.default}"
    return click.Option([flag, name], type=kind, help=help_text)


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
    from flightid.options import options_of

    known = {each.name: each for each in options_of(options)}
    given = {name: value for name, value in values.items() if value not in (None, ())}
    for name in given:
        if name not in known:
            flag = "--" + name.replace("_", "-")
            raise click.UsageError(f"{flag} is no option of {user}; it has {', '.join(known)}")
    return {name: _read(known[name], value) for name, value in given.items()}


def _read(each: Option, value: Any) -> Any:  # noqa: ANN401 — whatever the option is
    from flightid.option_forms import BAND, FLAG, TABLE, WORD

    if not isinstance(value, tuple) or BAND in each.forms:
        return value
    if FLAG in each.forms and value in ((ALL,), (NONE,)):
        return value == (ALL,)
    if TABLE in each.forms and any("=" in str(item) for item in value):
        return dict(_named(each.name, str(item)) for item in value)
    if WORD in each.forms and len(value) == 1:
        return value[0]
    return value


def _named(option: str, text: str) -> tuple[str, float | str]:
    name, _, value = text.partition("=")
    try:
        return name, float(value)
    except ValueError:
        if value:
            return name, value
        hint = f"--{option.replace('_', '-')}"
        raise click.BadParameter(f"{text!r} is not NAME=NUMBER", param_hint=hint) from None
