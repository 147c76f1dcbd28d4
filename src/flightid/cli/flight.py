"""``flightid flight``: what one flight tells of its vehicle, sweeps or none."""

from __future__ import annotations

from pathlib import Path

import click

from flightid.cli.output import emit_values, json_option, leave_by_verdict, level_option, note
from flightid.cli.pages import html_option


@click.command("flight", short_help="Say what a flight tells: steps of the loops, motors, noise.")
@click.argument("log", type=click.Path(exists=True, dir_okay=False, path_type=Path))
@level_option
@html_option
@json_option
def command(log: Path, level: float | None, html: Path | None, as_json: bool) -> None:
    """Say what the flight of LOG tells of its vehicle; no sweep is needed.

    Steps, delays and bandwidths of the rate and attitude loops from ordinary flying, each with an
    interval; motors at their limits and out of balance; vibration; battery, modes, gains.
    What it cannot tell it says, with what to fly or log. Reads ArduPilot DataFlash and PX4 ULog.
    """
    from flightid import review_flight
    from flightid.progress import progress
    from flightid.uncertainty.quantiles import showing

    with progress(None, f"reviewing {log.name}"), showing(level):
        review = review_flight(log)
        if as_json:
            emit_values(review.to_dict())
        else:
            click.echo(review.to_text())
        if html is not None:
            from flightid.files import write_atomically
            from flightid.report.flight import flight_document
            from flightid.report.html import to_html

            note(f"Wrote {write_atomically(html, to_html(flight_document(review)))}")
    leave_by_verdict(review.findings)
