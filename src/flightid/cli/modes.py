"""``flightid modes``: natural frequencies, dampings and time constants of a model."""

from __future__ import annotations

from pathlib import Path

import click

from flightid.cli.output import all_option, json_option, level_option
from flightid.cli.pages import html_option, show
from flightid.cli.sources import load_source, model_argument, model_options


@click.command()
@model_argument
@model_options
@level_option
@html_option
@all_option
@json_option
def command(
    model: str,
    axis: str | None,
    values: tuple[str, ...],
    level: float | None,
    html: Path | None,
    as_json: bool,
) -> None:
    """Modes of MODEL; of a fitted one with intervals.

    MODEL is a .toml file, the folder of a study with one model, the JSON of a fit, or the name of a
    library model.
    """
    from flightid import modes

    found = modes(load_source(model, axis, values))
    show(found, "Modes", as_json=as_json, html=html, level=level)
