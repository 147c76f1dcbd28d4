"""``flightid inspect``: can this log support identification, and what to do instead."""

from __future__ import annotations

from pathlib import Path

import click

from flightid.cli.output import emit_values, json_option, leave_by_verdict


@click.command("inspect", short_help="Say what a log holds and what it is good for.")
@click.argument("log", type=click.Path(exists=True, dir_okay=False, path_type=Path))
@json_option
def command(log: Path, as_json: bool) -> None:
    """Say what LOG holds, whether it can support identification, and what to do instead.

    Reads logs of ArduPilot, PX4, Betaflight and INAV, and telemetry. Leaves with exit code 1 where
    a verdict is red.
    """
    from flightid.inspection import inspect_log
    from flightid.progress import progress

    with progress(None, f"inspecting {log.name}"):
        inspection = inspect_log(log)
    if as_json:
        emit_values(inspection.to_dict())
    else:
        click.echo(inspection.to_text())
    leave_by_verdict(inspection.findings)
