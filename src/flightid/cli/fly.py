"""``flightid fly``: a pilot on a model, in real time."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from flightid.cli.option_fields import OptionsCommand, given_options
from flightid.cli.output import emit, json_option, note
from flightid.cli.sources import load_source, model_argument, model_options

if TYPE_CHECKING:
    from flightid.options import Options


def _fields() -> dict[str, type[Options]]:
    from flightid.simulation.fly_options import FlyOptions

    return {"a flight": FlyOptions}


@click.command(cls=OptionsCommand, fields_of=_fields)
@model_argument
@model_options
@click.option(
    "--output",
    type=click.Path(dir_okay=False, path_type=Path),
    help="Write the flight: .parquet or .nc.",
)
@json_option
def command(
    model: str,
    axis: str | None,
    values: tuple[str, ...],
    output: Path | None,
    as_json: bool,
    **options: Any,  # noqa: ANN401 — read from the fields
) -> None:
    """Fly MODEL beside the clock; Ctrl-C ends the flight and keeps it.

    MODEL is a .toml file, the folder of a study with one model, the JSON of a fit, or the name of a
    library model. Inputs come as JSON datagrams such as {"lat": 0.1}, outputs go to a cockpit
    each frame.
    """
    from flightid import write_records
    from flightid.simulation.fly_options import FlyOptions
    from flightid.simulation.realtime import fly_model

    asked = FlyOptions(**given_options(FlyOptions, options, "a flight"))
    session = fly_model(load_source(model, axis, values), asked, say=note)
    if output is not None:
        note(f"Wrote {write_records(session.record, output)}")
    emit(session, as_json=as_json)
