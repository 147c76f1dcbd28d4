"""``flightid margins``: what a loop may gain, lose or lag before it is unstable."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from flightid.cli.option_fields import OptionsCommand, flags_of, given_options
from flightid.cli.output import all_option, json_option, level_option
from flightid.cli.pages import html_option, show
from flightid.cli.sources import load_source, model_argument, model_options

if TYPE_CHECKING:
    from flightid.options import Options


def _fields() -> dict[str, type[Options]]:
    from flightid.control.margins.options import MarginOptions

    return {"margins": MarginOptions}


@click.command(
    cls=OptionsCommand, fields_of=_fields, short_help="Margins of a loop, or of feedback around it."
)
@model_argument
@model_options
@click.option(
    "--feedback",
    multiple=True,
    metavar="INPUT=OUTPUT:GAIN",
    help="Close these gains around MODEL; its margins are then those of each actuator.",
)
@level_option
@html_option
@all_option
@json_option
def command(
    model: str,
    axis: str | None,
    values: tuple[str, ...],
    feedback: tuple[str, ...],
    level: float | None,
    html: Path | None,
    as_json: bool,
    **options: Any,  # noqa: ANN401 — read from the fields
) -> None:
    """Margins of MODEL as a broken loop; with --feedback of the loops closed around it.

    MODEL is a .toml file, the folder of a study with one model, the JSON of a fit, or the name of a
    library model.
    """
    from flightid import close_loop, margins
    from flightid.control.margins.options import MarginOptions
    from flightid.simulation.fly_options import FlyOptions

    given = given_options(MarginOptions, options, "margins")
    source = load_source(model, axis, values)
    if not feedback:
        show(margins(source, **given), "Margins", as_json=as_json, html=html, level=level)
        return
    band = given.pop("band_rad_s", None)
    for name in given:
        raise click.UsageError(f"{flags_of(name)[-1]} is of a broken loop, not of --feedback")
    words = given_options(FlyOptions, {"feedback": feedback}, "margins")
    closed = close_loop(source, FlyOptions(**words).gains)
    broken = closed.margins(band_rad_s=band).values()
    show(closed, "Closed loop", *broken, as_json=as_json, html=html, level=level)
