"""``flightid compare-structures``: which equations the data support, fitted side by side."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from flightid.cli.equations import equations, fits_of
from flightid.cli.log_parts import inspections_of, with_inspections
from flightid.cli.option_fields import OptionsCommand
from flightid.cli.output import all_option, json_option, note
from flightid.cli.pages import html_option, show, write_page
from flightid.cli.records import FILES, FilesArgument, reading
from flightid.cli.sources import AXES, known_methods, known_models

if TYPE_CHECKING:
    from flightid.options import Options

FEWEST = 2


def _fields() -> dict[str, type[Options]]:
    return {**equations(), **reading()}


@click.command(
    cls=OptionsCommand, fields_of=_fields, short_help="Fit several structures to the same data."
)
@click.argument("files", cls=FilesArgument, type=FILES, nargs=-1, required=True)
@click.option(
    "--model",
    "models",
    multiple=True,
    required=True,
    shell_complete=known_models,
    help="Library name or .toml file of a model's equations; repeat it for each structure.",
)
@click.option("--axis", type=AXES, help="Of a library model.")
@click.option(
    "--method",
    shell_complete=known_methods,
    help="How each is fitted; default: frequency_domain.",
)
@html_option
@all_option
@json_option
def command(
    files: tuple[Path, ...],
    models: tuple[str, ...],
    axis: str | None,
    method: str | None,
    html: Path | None,
    as_json: bool,
    **options: Any,  # noqa: ANN401 — read from the fields of the method's options
) -> None:
    """Fit each --model to FILES with the same options, and set cost against parameters.

    For models without equations: `flightid polynomial FILES --scan --kind any`.
    """
    from flightid import compare_structures
    from flightid.progress import progress

    if len(set(models)) < FEWEST:
        raise click.UsageError("name two structures or more by --model")
    with progress(None, "Fitting"):
        fits, _ = fits_of(models, axis, method, files, options)
        seen = inspections_of(files)
        fits = {name: with_inspections(fit, seen) for name, fit in fits.items()}
    compared = compare_structures(fits)
    if html is not None:
        note(f"Wrote {write_page(compared, 'Structures', html, *fits.values())}")
    show(compared, "Structures", as_json=as_json)
