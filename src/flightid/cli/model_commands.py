"""Commands of one verb on one model: its options are the fields of the verb's dataclass."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from flightid.cli.lists import ListsCommand
from flightid.cli.option_fields import OptionsCommand, given_options
from flightid.cli.output import all_option, json_option, level_option
from flightid.cli.pages import html_option, show
from flightid.cli.sources import load_source, model_argument, model_options

if TYPE_CHECKING:
    from flightid.options import Options
    from flightid.result import Result

KINDS_OF_FILE = (
    "MODEL is a .toml file, the folder of a study with one model, the JSON of a fit, or the name of"
    " a library model."
)


Around = Callable[[Any, dict[str, dict[str, float]], dict[str, Any]], tuple["Result", ...]]
feedback_option = click.option(
    "--feedback",
    multiple=True,
    metavar="INPUT=OUTPUT:GAIN",
    help="Close these gains around MODEL, and look at the loops that they make.",
)


def model_command(
    verb: str,
    title: str,
    text: str,
    fields_of: Callable[[], type[Options]] | None = None,
    around: Around | None = None,
) -> click.Command:
    """A command that calls a verb of `flightid` with a model and the fields of its options.

    Parameters
    ----------
    verb : str
    title : str
        Of its page.
    text : str
        Help; what MODEL may be is added.
    fields_of : callable, optional
        Gives the dataclass of the verb's options, when they are asked for.
    around : callable, optional
        Results for MODEL with the gains of ``--feedback``, then an option, closed around it.
    """

    def call(
        model: str,
        axis: str | None,
        values: tuple[str, ...],
        level: float | None,
        html: Path | None,
        as_json: bool,
        feedback: tuple[str, ...] = (),
        **options: Any,  # noqa: ANN401 — read from the fields
    ) -> None:
        import flightid

        asked = {} if fields_of is None else given_options(fields_of(), options, title.lower())
        source = load_source(model, axis, values)
        if around is None or not feedback:
            first, *others = (getattr(flightid, verb)(source, **asked),)
        else:
            first, *others = around(source, gains_of(feedback), asked)
        show(first, title, *others, as_json=as_json, html=html, level=level)

    call.__doc__ = f"{text}\n\n    {KINDS_OF_FILE}"
    function: Any = call
    closing = [] if around is None else [feedback_option]
    common = (json_option, all_option, html_option, level_option)
    decorators = (*common, *closing, model_options, model_argument)
    for decorate in decorators:
        function = decorate(function)
    if fields_of is None:
        return click.command(cls=ListsCommand)(function)
    made = fields_of
    return click.command(cls=OptionsCommand, fields_of=lambda: {title.lower(): made()})(function)


def gains_of(feedback: tuple[str, ...]) -> dict[str, dict[str, float]]:
    """Gains by input and output, as ``--feedback`` says them."""
    from flightid.simulation.fly_options import FlyOptions

    return FlyOptions(**given_options(FlyOptions, {"feedback": feedback}, "feedback")).gains
