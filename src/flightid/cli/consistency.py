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
from flightid.cli.records import FILES, FilesArgument, in_units, read_files, reading

if TYPE_CHECKING:
    from collections.abc import Mapping

    from flightid.options import Options
    from flightid.record import Record


def _fields() -> dict[str, type[Options]]:
    return reading()


@click.command(cls=OptionsCommand, fields_of=_fields, short_help="Check data compatibility.")
@click.argument("files", cls=FilesArgument, type=FILES, nargs=-1, required=True)
@click.option("--rename", help="Columns of kinematic channels, with commas: p=roll_rate,phi=bank.")
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
    rename: str | None,
    estimate: str | None,
    write: Path | None,
    level: float | None,
    html: Path | None,
    as_json: bool,
    **options: Any,  # noqa: ANN401 — read from the fields
) -> None:
    """Rebuild attitude and velocity of each record; estimate biases, scale factors and delays.

    Needs p, q, r and an attitude, or columns so named with their unit, as p_radps; with ax, ay, az
    also velocities or V, alpha, beta. Sensors away from the centre of gravity are moved there
    first, in a study by [[conditioning]].
    """
    from flightid.conditioning import check_consistency
    from flightid.record import write_records

    given = _named(rename)
    wanted = None if estimate is None else estimate.split(",")
    found = []
    for record in read_files(files, *parted(options, _fields())):
        converted, names = _kinematic(record, given)
        found.append(check_consistency(converted, channels=names, estimate=wanted))
    for result in found:
        emit(result, as_json=as_json, level=level)
    if html is not None:
        first, *others = found
        note(f"Wrote {write_page(first, 'Data compatibility', html, *others)}")
    if write is not None:
        write_records([result.corrected for result in found], write)
        note(f"Wrote {write}")
    leave_by_verdict([finding for result in found for finding in result.findings])


def _named(channels: str | None) -> dict[str, str]:
    """Columns by canonical name, as the option gives them."""
    parts = [each.partition("=") for each in (channels or "").split(",") if each]
    wrong = [name for name, sign, column in parts if not (name and sign and column)]
    if wrong:
        raise click.BadParameter(
            f"found {', '.join(wrong)}; needed name=column, as p=roll_rate", param_hint="--rename"
        )
    return {name.strip(): column.strip() for name, _, column in parts}


def _kinematic(record: Record, given: Mapping[str, str]) -> tuple[Record, dict[str, str]]:
    """The record in the units of the equations, and its column by canonical name."""
    from flightid.conditioning.kinematics import UNITS, columns_of

    names = {**columns_of(record), **given}
    said = ", ".join(f"{name} from {label!r}" for name, label in names.items() if name != label)
    if said:
        note(f"{record.name or 'Record'}: {said}")
    return in_units(record, {names[n]: UNITS[n] for n in names if n in UNITS}), names
