"""``flightid inspect``: can this log support identification, and what to do instead."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from flightid.cli.output import emit_values, json_option, leave_by_verdict, note
from flightid.cli.pages import html_option
from flightid.cli.records import FILES

if TYPE_CHECKING:
    from flightid.report.content import Document


@click.command("inspect", short_help="Say what a log holds and what it is good for.")
@click.argument("log", metavar="LOG | RECORDS", type=FILES)
@click.option("--all", "whole", is_flag=True, help="Rates of all messages, and clock skews.")
@html_option
@json_option
def command(log: Path, whole: bool, html: Path | None, as_json: bool) -> None:
    """Say what LOG holds, whether it can support identification, and what to do instead.

    Reads logs of ArduPilot, PX4, Betaflight and INAV, telemetry, and ROS bags of PX4 or MAVROS.
    Leaves with exit code 1 where a verdict is red. Of RECORDS (tables, other ROS bags) the columns
    are listed.
    """
    from flightid.inspection import inspect_log
    from flightid.logs import is_log, read_log
    from flightid.progress import progress

    if not is_log(log):
        from flightid.record.contents import table_contents

        table = table_contents(log)
        emit_values(table.to_dict()) if as_json else click.echo(table)
        if html is not None:
            from flightid.report.inspection import contents_document

            _write(contents_document(log), html)
        return
    with progress(None, f"inspecting {log.name}"):
        opened = read_log(log)
        inspection = inspect_log(opened)
    if as_json:
        emit_values(inspection.to_dict())
    else:
        click.echo(inspection.to_text() if whole else inspection.on_screen())
    if html is not None:
        from flightid.report.inspection import inspection_document

        _write(inspection_document(opened, inspection), html)
    leave_by_verdict(inspection.findings)


def _write(document: Document, html: Path) -> None:
    from flightid.files import write_atomically
    from flightid.report.html import to_html

    note(f"Wrote {write_atomically(html, to_html(document))}")
