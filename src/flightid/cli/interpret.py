"""``flightid interpret``: what poles and zeros of a black box may stand for."""

from __future__ import annotations

import click

from flightid.cli.output import all_option, json_option, level_option
from flightid.cli.pages import show
from flightid.cli.sources import load_source, model_argument, model_options


@click.command()
@model_argument
@model_options
@level_option
@all_option
@json_option
def command(
    model: str, axis: str | None, values: tuple[str, ...], level: float | None, as_json: bool
) -> None:
    """Say what poles and zeros of MODEL, identified without equations, may stand for.

    MODEL is a .toml file, the folder of a study with one model, the JSON of a fit, or the name of a
    library model.
    """
    from flightid import interpret

    show(
        interpret(load_source(model, axis, values)), "Interpretation", as_json=as_json, level=level
    )
