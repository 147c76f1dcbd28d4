"""``flightid response``: frequency responses of records or of a log."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from flightid.cli.output import emit, json_option, leave_by_verdict, note

if TYPE_CHECKING:
    from flightid.record import Record
    from flightid.responses import FrequencyResponse

FILE = click.Path(dir_okay=False, path_type=Path)


@click.command()
@click.argument("files", type=click.Path(exists=True, path_type=Path), nargs=-1, required=True)
@click.option("--input", "inputs", multiple=True, help="Input channel; may be repeated.")
@click.option("--output", "outputs", multiple=True, help="Output channel; may be repeated.")
@click.option(
    "--excitation",
    "excitations",
    multiple=True,
    help="Injected signal, for --estimator instrument.",
)
@click.option("--band", type=float, nargs=2, help="Lowest and highest frequency, rad/s.")
@click.option("--n-omega", type=click.IntRange(2, 10000), default=100, show_default=True)
@click.option("--window", type=float, multiple=True, help="Window length, s; may be repeated.")
@click.option("--overlap", type=float, default=0.5, show_default=True)
@click.option(
    "--estimator",
    type=click.Choice(("composite", "instrument", "local_polynomial")),
    default="composite",
    show_default=True,
)
@click.option("--span", type=float, nargs=2, help="Part of each log, s on its clock.")
@click.option("--sweep", type=int, help="Number of the system-identification run in the log.")
@click.option("--time", default="time", show_default=True, help="Time column of a table.")
@click.option("--netcdf", type=FILE, help="Write the response to this file.")
@click.option("--html", type=FILE, help="Write a page with pictures to this file.")
@json_option
def command(
    files: tuple[Path, ...],
    inputs: tuple[str, ...],
    outputs: tuple[str, ...],
    excitations: tuple[str, ...],
    band: tuple[float, float] | None,
    n_omega: int,
    window: tuple[float, ...],
    overlap: float,
    estimator: str,
    span: tuple[float, float] | None,
    sweep: int | None,
    time: str,
    netcdf: Path | None,
    html: Path | None,
    as_json: bool,
) -> None:
    """Estimate frequency responses from tables of records or from flight logs.

    Prints the usable band, coherence and random error of every pair.
    """
    from flightid.progress import progress, track
    from flightid.responses import estimate_response
    from flightid.responses.store import write_response

    records: list[Record] = []
    for file in track(files, "Reading"):
        records += _read(file, inputs, outputs, excitations, span, sweep, time)
    with progress(None, "Estimating"):
        response = estimate_response(
            records,
            inputs=inputs or None,
            outputs=outputs or None,
            excitations=excitations or None,
            band_rad_s=band,
            n_omega=n_omega,
            window_s=window or "auto",
            estimator=estimator,
            overlap=overlap,
        )
    emit(response, as_json=as_json)
    if netcdf is not None:
        note(f"Wrote {write_response(response, netcdf)}")
    if html is not None:
        note(f"Wrote {_write_page(response, html)}")
    leave_by_verdict(response.findings)


def _read(
    file: Path,
    inputs: tuple[str, ...],
    outputs: tuple[str, ...],
    excitations: tuple[str, ...],
    span: tuple[float, float] | None,
    sweep: int | None,
    time: str,
) -> list[Record]:
    from flightid.logs import is_log, read_log

    if is_log(file):
        return [read_log(file).record(span_s=span, sid_run=sweep)]
    from flightid.record.read import read_records

    records = read_records(
        file,
        inputs or None,
        outputs or None,
        excitations=excitations or None,
        time_column=time,
    )
    return records if span is None else [record.segment(*span) for record in records]


def _write_page(response: FrequencyResponse, path: Path) -> Path:
    from flightid.files import write_atomically
    from flightid.plot.response import leading_pairs, response_figure
    from flightid.report.blocks import result_blocks
    from flightid.report.content import Document, Section
    from flightid.report.figures import figure_block
    from flightid.report.html import to_html

    pictures = tuple(
        figure_block(
            response_figure(response, [(output, name)]),
            f"Response of {output} to {name}; bands are 95 % of the random error.",
        )
        for output, name in leading_pairs(response)
    )
    sections = (
        Section("Frequency responses", result_blocks(response)),
        Section("Pictures", pictures),
    )
    return write_atomically(path, to_html(Document("Frequency response", repr(response), sections)))
