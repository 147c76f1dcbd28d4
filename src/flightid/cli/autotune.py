"""``flightid autotune``: a second opinion on an autopilot's autotune."""

from __future__ import annotations

from pathlib import Path

import click

from flightid.cli.output import json_option, leave_by_verdict, level_option
from flightid.cli.pages import html_option, show_review
from flightid.cli.records import FILES


@click.command("autotune", short_help="A second opinion on an autotune: margins, why it failed.")
@click.argument("log", type=FILES)
@level_option
@html_option
@json_option
def command(log: Path, level: float | None, html: Path | None, as_json: bool) -> None:
    """Say what the autotune of LOG did, and what margins its gains have.

    Reads ArduCopter's twitches (ATUN, ATDE) and PX4's autotune_attitude_control_status. A model of
    each axis is fitted to that excitation, and the gains before and after are closed around it with
    the autopilot's own filters: margins with intervals. Where it failed, it says why.
    """
    from flightid import review_autotune
    from flightid.report.flight import autotune_document
    from flightid.uncertainty.quantiles import showing

    with showing(level):
        review = review_autotune(log)
        show_review(review, autotune_document, as_json=as_json, html=html)
    leave_by_verdict(review.findings)
