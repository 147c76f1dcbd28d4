"""``flightid modes``: natural frequencies, dampings and time constants of a model."""

from __future__ import annotations

import click

from flightid.cli.output import emit, json_option
from flightid.cli.pairs import numbers


@click.command()
@click.argument("model")
@click.option("--axis", type=click.Choice(["roll", "pitch", "yaw"]), help="Of a library model.")
@click.option("--value", "values", multiple=True, help="NAME=NUMBER: another parameter value.")
@json_option
def command(model: str, axis: str | None, values: tuple[str, ...], as_json: bool) -> None:
    """Modes of MODEL, a .toml file or a library name; a fitted model's file gives intervals too."""
    from flightid import load_model, modes
    from flightid.models import load_structure

    changed = numbers("--value", values)
    chosen = (
        load_structure(model, axis=axis).with_values(changed)
        if changed
        else load_model(model, axis=axis)
    )
    emit(modes(chosen), as_json=as_json)
