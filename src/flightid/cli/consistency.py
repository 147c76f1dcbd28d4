"""``flightid consistency``: do rates, attitudes, accelerations and velocities belong together."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from flightid.cli.option_fields import OptionsCommand, parted
from flightid.cli.output import (
    WRITTEN,
    all_option,
    emit,
    json_option,
    leave_by_verdict,
    level_option,
    note,
)
from flightid.cli.pages import html_option, write_page
from flightid.cli.records import FILES, read_files, reading

if TYPE_CHECKING:
    from flightid.options import Options


def _fields() -> dict[str, type[Options]]:
    return reading()


@click.command(cls=OptionsCommand, fields_of=_fields, short_help="Check data compatibility.")
@click.argument("files", type=FILES, nargs=-1, required=True)
@click.option("--estimate", help="Instrument errors, with commas: bias_p,scale_q,delay_phi.")
@click.option(
    "--write", type=WRITTEN, help="Write the corrected records to this file (*.parquet, *.nc)."
)
@level_option
@html_option
@all_option
@json_option
def command(
    files: tuple[Path, ...],
    estimate: str | None,
    write: Path | None,
    level: float | None,
    html: Path | None,
    as_json: bool,
    **options: Any,  # noqa: ANN401 — read from the fields
) -> None:
    """Rebuild attitude and velocity of each record; estimate biases, scale factors and delays.

    Needs p, q, r and an attitude; with ax, ay, az also velocities or V, alpha, beta. Sensors away
    from the centre of gravity are moved there first, in a study by [[conditioning]].
    """
    from flightid.conditioning import check_consistency
    from flightid.conditioning.kinematics import UNITS
    from flightid.record import write_records

    records = read_files(files, *parted(options, _fields()), units=UNITS)
    wanted = None if estimate is None else estimate.split(",")
    found = [check_consistency(record, estimate=wanted) for record in records]
    for result in found:
        emit(result, as_json=as_json, level=level)
    if html is not None:
        first, *others = found
        note(f"Wrote {write_page(first, 'Data compatibility', html, *others)}")
    if write is not None:
        write_records([result.corrected for result in found], write)
        note(f"Wrote {write}")
    leave_by_verdict([finding for result in found for finding in result.findings])
