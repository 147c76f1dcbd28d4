"""``flightid pilot-cutoff``: below which frequency half of a control's power lies."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from flightid.cli.option_fields import OptionsCommand, parted
from flightid.cli.output import json_option, level_option
from flightid.cli.pages import html_option, show
from flightid.cli.records import FILES, FilesArgument, read_files, reading

if TYPE_CHECKING:
    from flightid.options import Options


def _fields() -> dict[str, type[Options]]:
    from flightid.dynamics.handling_qualities.options import CutoffOptions

    return {"the cut-off": CutoffOptions, **reading()}


@click.command(cls=OptionsCommand, fields_of=_fields, short_help="Say how tightly a pilot flew.")
@click.argument("records", nargs=-1, required=True, type=FILES, cls=FilesArgument)
@level_option
@html_option
@json_option
def command(
    records: tuple[Path, ...],
    level: float | None,
    html: Path | None,
    as_json: bool,
    **options: Any,  # noqa: ANN401 — read from the fields
) -> None:
    """Frequency below which half the power of one control lies, over RECORDS of one task.

    RECORDS are tables (CSV, Parquet, .mat, netCDF) or logs.
    """
    from flightid import pilot_cutoff

    asked, *of_files = parted(options, _fields())
    flown = read_files(records, *of_files, inputs=[asked["channel"]], outputs=[])
    show(pilot_cutoff(flown, **asked), "Pilot cut-off", as_json=as_json, html=html, level=level)
