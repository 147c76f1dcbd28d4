"""``flightid compare``: models of several flights side by side, and what really changed."""

from __future__ import annotations

from pathlib import Path

import click

from flightid.cli.output import all_option, json_option, level_option
from flightid.cli.pages import show
from flightid.cli.sources import AXES, known_models, load_source


@click.command(short_help="Put models of several flights or conditions side by side.")
@click.argument(
    "models", nargs=-1, required=True, metavar="MODEL MODEL...", shell_complete=known_models
)
@click.option("--axis", type=AXES, help="Of a library model.")
@level_option
@all_option
@json_option
def command(models: tuple[str, ...], axis: str | None, level: float | None, as_json: bool) -> None:
    """Parameters and modes of MODELs with their ratios, and what is more than chance.

    The first is the base. Each is a .toml file, the folder of a study with one model, the JSON of a
    fit, or the name of a library model. To see which predicts better: `flightid verify MODEL
    RECORDS --against MODEL`.
    """
    from flightid import compare_conditions

    if len(set(models)) < len(models):
        raise click.UsageError("a model is named twice")
    short = [Path(name).stem for name in models]
    names = short if len(set(short)) == len(short) else list(models)
    sources = {n: load_source(model, axis) for n, model in zip(names, models, strict=True)}
    show(compare_conditions(sources), "Comparison", as_json=as_json, level=level)
