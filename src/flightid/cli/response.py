"""``flightid response``: frequency responses of records or of a log."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from flightid.cli.log_parts import with_instrument
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
from flightid.cli.pages import html_option
from flightid.cli.records import FILES, FilesArgument, as_channels, read_files, reading

if TYPE_CHECKING:
    from flightid.options import Options
    from flightid.responses import FrequencyResponse

write_option = click.option(
    "--write",
    "target",
    type=WRITTEN,
    help="Write the response to this file, which response-arithmetic takes.",
)


def _fields() -> dict[str, type[Options]]:
    from flightid.record.options import ChannelOptions, InputOptions
    from flightid.responses.options import ResponseOptions

    return {
        "channels": ChannelOptions,
        "response": ResponseOptions,
        "inputs": InputOptions,
        **reading(),
    }


@click.command(cls=OptionsCommand, fields_of=_fields)
@click.argument("files", cls=FilesArgument, type=FILES, nargs=-1, required=True)
@write_option
@level_option
@html_option
@all_option
@json_option
def command(
    files: tuple[Path, ...],
    target: Path | None,
    level: float | None,
    html: Path | None,
    as_json: bool,
    **options: Any,  # noqa: ANN401 — read from the fields
) -> None:
    """Estimate frequency responses from tables of records or from flight logs.

    Prints the usable band, coherence and random error of every pair.
    """
    from flightid.progress import progress
    from flightid.responses import estimate_response

    channels, of_response, known, *of_files = parted(options, _fields())
    injected = of_response.get("excitations")
    records = read_files(files, *of_files, **channels, excitations=injected, take="flown")
    channels = {role: as_channels(records[0], names) for role, names in channels.items()}
    if injected:
        of_response = of_response | {"excitations": as_channels(records[0], injected)}
    if known:
        records = [record.declare(**known) for record in records]
    of_response = with_instrument(of_response, files, records, channels.get("inputs") or ())
    with progress(None, "Estimating"):
        response = estimate_response(records, **channels, **of_response)
    show_response(response, target, html, as_json=as_json, level=level)


def show_response(
    response: FrequencyResponse,
    target: Path | None,
    html: Path | None,
    *,
    as_json: bool,
    level: float | None,
) -> None:
    """Print a response as it is shown, write what is asked for, and leave by its verdict."""
    from flightid.responses.store import write_response
    from flightid.uncertainty.quantiles import showing

    response = response.shown
    emit(response, as_json=as_json)
    if target is not None:
        note(f"Wrote {write_response(response, target)}")
    if html is not None:
        with showing(level):
            note(f"Wrote {_write_page(response, html)}")
    leave_by_verdict(response.findings)


def _write_page(response: FrequencyResponse, path: Path) -> Path:
    from flightid.files import write_atomically
    from flightid.plot.response import leading_pairs, response_figure
    from flightid.report.blocks import result_blocks
    from flightid.report.content import Document, Section
    from flightid.report.figures import figure_block
    from flightid.report.html import to_html
    from flightid.uncertainty.quantiles import interval_words, shown

    pictures = tuple(
        figure_block(
            response_figure(response, [(output, name)]),
            f"Response of {output} to {name}; bands: {interval_words(shown())}.",
        )
        for output, name in leading_pairs(response)
    )
    sections = (
        Section("Frequency responses", result_blocks(response)),
        Section("Pictures", pictures),
    )
    return write_atomically(path, to_html(Document("Frequency response", repr(response), sections)))
