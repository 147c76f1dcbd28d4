"""``flightid replay``: an autopilot's controller run on a log's signals, beside what it logged."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from flightid.cli.figures import FIGURE
from flightid.cli.option_fields import flags_of
from flightid.cli.output import all_option, json_option
from flightid.cli.pages import html_option, show
from flightid.cli.records import FILES
from flightid.cli.sources import AXES


@click.command(short_help="Run an autopilot's controller on its log's own signals.")
@click.argument("log", type=FILES)
@click.option("--axis", type=AXES, required=True, help="Axis of the controller.")
@click.option(*flags_of("span_s"), "span_s", nargs=2, type=FIGURE, help="Part of the log, s.")
@html_option
@all_option
@json_option
def command(
    log: Path, axis: str, span_s: tuple[float, float] | None, html: Path | None, as_json: bool
) -> None:
    """Run the controller that LOG was flown with on what it was given, beside what it logged."""
    from flightid import read_log, replay

    done: Any = replay(read_log(log), axis, span_s=span_s)
    show(done, f"Replay of {axis}", as_json=as_json, html=html)
