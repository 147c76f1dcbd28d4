"""``flightid predict``: what a model makes of records, some samples ahead or in free run."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from flightid.cli.option_fields import OptionsCommand, parted
from flightid.cli.output import WRITTEN, all_option, json_option, note
from flightid.cli.pages import html_option, show
from flightid.cli.records import FILES, FilesArgument, read_files, reading, write_out
from flightid.cli.sources import load_source, model_argument, model_options

if TYPE_CHECKING:
    from flightid.options import Options


def _fields() -> dict[str, type[Options]]:
    from flightid.record.options import ComparedOptions
    from flightid.validation.verification.options import VerifyOptions

    return {"channels": ComparedOptions, "the prediction": VerifyOptions, **reading()}


@click.command(
    cls=OptionsCommand, fields_of=_fields, short_help="Predict records, and write what comes out."
)
@model_argument
@click.argument("records", nargs=-1, required=True, type=FILES, cls=FilesArgument)
@model_options
@click.option(
    "--write",
    type=WRITTEN,
    help="Write the predicted records to this file (*.parquet, *.nc; one also as *.csv).",
)
@html_option
@all_option
@json_option
def command(
    model: str,
    records: tuple[Path, ...],
    axis: str | None,
    values: tuple[str, ...],
    write: Path | None,
    html: Path | None,
    as_json: bool,
    **options: Any,  # noqa: ANN401 — read from the fields
) -> None:
    """Predict RECORDS with MODEL, as far ahead as --horizon says.

    MODEL is a .toml file, the folder of a study with one model, the JSON of a fit, or the name of a
    library model; RECORDS hold its channels by name. Nothing is judged: `flightid verify` does.
    """
    from flightid import predict

    chosen = load_source(model, axis, values)
    channels, given, *of_files = parted(options, _fields())
    wanted = channels.get("outputs") or chosen.outputs
    flown = read_files(records, *of_files, inputs=chosen.inputs, outputs=wanted, units=chosen.units)
    first, *others = predict(chosen, flown, outputs=channels.get("outputs"), **given)
    if write is not None:
        note(f"Wrote {write_out([one.predicted for one in (first, *others)], write)}")
    show(first, "Prediction", *others, as_json=as_json, html=html)
