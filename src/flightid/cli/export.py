"""``flightid export``: a model for another tool."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from flightid.cli.option_fields import OptionsCommand, given_options
from flightid.cli.output import WRITTEN, emit, json_option
from flightid.cli.sources import load_source, model_argument, model_options

if TYPE_CHECKING:
    from flightid.options import Options


def _fields() -> dict[str, type[Options]]:
    from flightid.export.options import FORMATS

    return {f"format {name}": FORMATS[name] for name in ("c", "fmu", "jsbsim")}


@click.command(cls=OptionsCommand, fields_of=_fields)
@model_argument
@click.argument("file", type=WRITTEN)
@click.option("--format", help="Left out: by the suffix of FILE.")
@click.option("--name", help="Of the model in FILE; left out: the file's name.")
@model_options
@json_option
def command(
    model: str,
    file: Path,
    format: str | None,
    name: str | None,
    axis: str | None,
    values: tuple[str, ...],
    as_json: bool,
    **options: Any,  # noqa: ANN401 — read from the fields
) -> None:
    """Write MODEL to FILE.

    MODEL is a .toml file, the folder of a study with one model, the JSON of a fit, or the name of a
    library model. The suffix of FILE chooses: .toml (flightid), .mat (MATLAB), .json, .npz
    (matrices), .c (portable C99), .fmu (FMI 3.0), .xml (JSBSim aerodynamics).
    """
    from flightid import export
    from flightid.export.options import FORMATS
    from flightid.export.to_file import format_of

    chosen = format_of(file, format)
    given = given_options(FORMATS[chosen], options, f"format {chosen}")
    source = load_source(model, axis, values)
    emit(export(source, file, chosen, name=name, **given), as_json=as_json)
