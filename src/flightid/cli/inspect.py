"""``flightid inspect``: can this log support identification, and what to do instead."""

from __future__ import annotations

from pathlib import Path

import click

from flightid.cli.output import emit_values, json_option, leave_by_verdict
from flightid.cli.records import FILES


@click.command("inspect", short_help="Say what a log holds and what it is good for.")
@click.argument("log", metavar="LOG | RECORDS", type=FILES)
@click.option("--all", "whole", is_flag=True, help="Rates of all messages, and clock skews.")
@json_option
def command(log: Path, whole: bool, as_json: bool) -> None:
    """Say what LOG holds, whether it can support identification, and what to do instead.

    Reads logs of ArduPilot, PX4, Betaflight and INAV, telemetry, and ROS bags of PX4 or MAVROS.
    Leaves with exit code 1 where a verdict is red. Of RECORDS (tables, other ROS bags) the columns
    are listed.
    """
    from flightid.inspection import inspect_log
    from flightid.logs import is_log
    from flightid.progress import progress

    if not is_log(log):
        from flightid.record.contents import table_contents

        table = table_contents(log)
        emit_values(table.to_dict()) if as_json else click.echo(table)
        return
    with progress(None, f"inspecting {log.name}"):
        inspection = inspect_log(log)
    if as_json:
        emit_values(inspection.to_dict())
    else:
        click.echo(inspection.to_text() if whole else inspection.on_screen())
    leave_by_verdict(inspection.findings)
