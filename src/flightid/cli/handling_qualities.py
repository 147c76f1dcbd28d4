"""``flightid handling-qualities``: levels of the standards, as far as a model tells them."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from flightid.cli.option_fields import OptionsCommand, given_options
from flightid.cli.output import all_option, json_option, level_option
from flightid.cli.pages import html_option, show
from flightid.cli.sources import load_source, model_argument, model_options

if TYPE_CHECKING:
    from flightid.options import Options


def _fields() -> dict[str, type[Options]]:
    from flightid.dynamics.handling_qualities.options import QualitiesOptions

    return {"handling qualities": QualitiesOptions}


@click.command(cls=OptionsCommand, fields_of=_fields, short_help="Rate a model by the standards.")
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
    **options: Any,  # noqa: ANN401 — read from the fields
) -> None:
    """Bandwidths, phase delays and modes of MODEL with their levels; see --vehicle.

    MODEL is a .toml file, the folder of a study with one model, the JSON of a fit, or the name of a
    library model. --level is that of the intervals.
    """
    from flightid import handling_qualities
    from flightid.dynamics.handling_qualities.options import QualitiesOptions

    given = given_options(QualitiesOptions, options, "handling qualities")
    asked = QualitiesOptions(**given)
    asked.require_case(given)
    rated = handling_qualities(load_source(model, axis, values), **asked.of_verb())
    show(rated, "Handling qualities", as_json=as_json, html=html, level=level)
