"""``flightid flight``: what one flight tells of its vehicle, sweeps or none."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from flightid.cli.output import WRITTEN, json_option, leave_by_verdict, level_option, note
from flightid.cli.pages import html_option, show_review
from flightid.cli.records import FILES

if TYPE_CHECKING:
    from flightid.review import FlightReview


@click.command("flight", short_help="Say what a flight tells: steps of the loops, motors, noise.")
@click.argument("log", type=FILES)
@click.option(
    "--write",
    "target",
    type=WRITTEN,
    help="Parameter file for the filters that would serve better, with the way back.",
)
@click.option("--overwrite", is_flag=True, help="Replace parameter files that exist.")
@level_option
@html_option
@json_option
def command(
    log: Path,
    target: Path | None,
    overwrite: bool,
    level: float | None,
    html: Path | None,
    as_json: bool,
) -> None:
    """Say what the flight of LOG tells of its vehicle; no sweep is needed.

    Steps, delays and bandwidths of the rate and attitude loops from ordinary flying, each with an
    interval; motors at their limits and out of balance; vibration; noise of the gyro and what it
    makes of the outputs; filters, the phase they cost, and better ones; battery, modes, gains.
    What it cannot tell it says, with what to fly or log. Reads logs of ArduPilot, PX4, Betaflight
    and INAV, and telemetry.
    """
    from flightid import review_flight
    from flightid.progress import progress
    from flightid.report.flight import flight_document
    from flightid.uncertainty.quantiles import showing

    with progress(None, f"reviewing {log.name}"), showing(level):
        review = review_flight(log)
        show_review(review, flight_document, as_json=as_json, html=html)
        if target is not None:
            _write(review, target, overwrite)
    leave_by_verdict(review.findings)


def _write(review: FlightReview, target: Path, overwrite: bool) -> None:
    """Write the filters that would serve better; say why there are none."""
    from flightid.control.autopilots import write_parameters
    from flightid.findings import FALL

    fallen = [each for each in review.findings if each.code == FALL]
    if fallen:
        note(f"Not written: {target}: {fallen[0].message}; {fallen[0].action}")
        return
    choice = review.filters.choice
    if choice is None or not choice.changes:
        why = "as good as flown" if choice else review.filters.reason or review.noise.reason
        note(f"Not written: {target}: no better filters ({why})")
        return
    notes = ["flightid: filters for the noise of this flight", *review.filters.words()]
    made = write_parameters(review.kind, choice.changes, target, notes=notes, overwrite=overwrite)
    note(f"Wrote {made.path}")
    if made.rollback is not None:
        note(f"Wrote {made.rollback}")
