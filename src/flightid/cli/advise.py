"""``flightid advise``: what records can support before a model without equations is fitted."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from flightid.cli.black_boxes import channels_of, only
from flightid.cli.option_fields import OptionsCommand, parted
from flightid.cli.output import all_option, json_option
from flightid.cli.pages import html_option, show
from flightid.cli.records import FILES, FilesArgument, reading

if TYPE_CHECKING:
    from flightid.options import Options


def _fields() -> dict[str, type[Options]]:
    from flightid.record.options import ChannelOptions

    return {"channels": ChannelOptions, **reading()}


@click.command(
    cls=OptionsCommand, fields_of=_fields, short_help="What records can support: delays, orders."
)
@click.argument("files", cls=FilesArgument, type=FILES, nargs=-1, required=True)
@html_option
@all_option
@json_option
def command(
    files: tuple[Path, ...],
    html: Path | None,
    as_json: bool,
    **options: Any,  # noqa: ANN401 — read from the fields
) -> None:
    """Say what the records of FILES can support: excitation, delay, length, loop."""
    from flightid import advise

    named, *of_files = parted(options, _fields())
    records, inputs, outputs = channels_of(files, named, of_files)
    found = advise(records, inputs=inputs, outputs=only(outputs, files))
    show(found, "What the records support", as_json=as_json, html=html)
