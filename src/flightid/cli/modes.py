"""``flightid modes``: natural frequencies, dampings and time constants of a model."""

from __future__ import annotations

import click

from flightid.cli.output import emit, json_option, level_option
from flightid.cli.sources import load_source, model_options


@click.command()
@click.argument("model")
@model_options
@level_option
@json_option
def command(
    model: str, axis: str | None, values: tuple[str, ...], level: float | None, as_json: bool
) -> None:
    """Modes of MODEL; of a fitted one with intervals.

    MODEL is a .toml file, the folder of a study with one model, the JSON of a fit, or the name of a
    library model.
    """
    from flightid import modes

    emit(modes(load_source(model, axis, values)), as_json=as_json, level=level)
