"""``flightid fleet``: thousands of logs through one study, and questions to their catalogue."""

from __future__ import annotations

import os
from pathlib import Path

import click

from flightid.cli.figures import QuotientRange
from flightid.cli.output import (
    WRITTEN,
    emit,
    emit_values,
    finite,
    json_option,
    leave_by_verdict,
    note,
    of_a_page,
)

FLEET_FILE = click.Path(exists=True, path_type=Path)


@click.group(short_help="From thousands of logs to one catalogue, and what it tells of vehicles.")
def command() -> None:
    """Take all logs of a fleet file through its study, and ask the catalogue of the results.

    docs/fleet.md describes the fleet file and the tables.
    """


@command.command("run", short_help="Take every log that the catalogue lacks.")
@click.argument("fleet", metavar="FLEET | FOLDER", type=FLEET_FILE)
@click.option("--workers", type=click.IntRange(min=1), help="Processes; default: one a processor.")
@click.option(
    "--scheduler",
    metavar="ADDRESS",
    help="Dask scheduler whose workers take the logs, such as tls://host:8786.",
)
@click.option("--retry", is_flag=True, help="Take logs again that failed.")
@click.option(
    "--forget-gone",
    is_flag=True,
    help="Take records out of the catalogue whose log is not at the places of FLEET any more.",
)
@json_option
def run(
    fleet: Path,
    workers: int | None,
    scheduler: str | None,
    retry: bool,
    forget_gone: bool,
    as_json: bool,
) -> None:
    """Take every log of FLEET that its catalogue lacks, and compact the catalogue.

    Of a FOLDER of logs a fleet file with comments is written beside it first, and what was chosen
    is said: <folder>-fleet.toml is what the other commands take from then on.

    A log that fails costs itself alone. Interrupt a run at any time (Ctrl-C): the same command
    takes what is missing. The exit code is 1 where no log was found, every one that was taken
    failed, or none of the catalogue has a model.
    """
    from flightid.fleet import run_fleet
    from flightid.fleet.reasons import reason_lines

    if fleet.is_dir():
        fleet = _proposed(fleet)
    if fleet.suffix != ".toml":
        raise click.UsageError(
            f"{fleet} is no fleet file, which is a .toml that names the logs (docs/fleet.md); one "
            f"log: flightid run {fleet}"
        )
    done = run_fleet(
        fleet, workers=workers, scheduler=scheduler, retry=retry, forget_gone=forget_gone
    )
    if as_json:
        emit_values(done.to_dict())
    else:
        for line in (*done.lines, *reason_lines(done.reasons)):
            click.echo(line)
        place = done.catalogue
        note(f"Wrote {place if '://' in place else os.path.normpath(place)}")
    for finding in done.findings:
        note(str(finding))
    leave_by_verdict(done.findings)


def _proposed(folder: Path) -> Path:
    """The fleet file of a folder: the one that is there, or one that is written now."""
    from flightid.fleet import propose_fleet

    made = propose_fleet(folder)
    if made.path.exists():
        note(f"Taking {made.path}, which is there already")
        return made.path
    for said in made.said:
        note(said)
    note(f"Wrote {made.write()}")
    return made.path


@command.command("status", short_help="Count what is done, refused, failed and missing.")
@click.argument("place", metavar="FLEET | CATALOGUE")
@json_option
def status(place: str, as_json: bool) -> None:
    """Count the logs of a fleet file, or of a catalogue by its folder or address."""
    from flightid.fleet import fleet_status
    from flightid.fleet.reasons import reason_lines
    from flightid.fleet.shares import copy_lines

    found = fleet_status(place)
    emit(found, as_json=as_json)
    if not as_json:
        for line in (*copy_lines(found.shares), *reason_lines(found.reasons)):
            click.echo(line)
        for finding in found.findings:
            note(str(finding))


@command.command("query", short_help="Answer one SELECT over the tables of the catalogue.")
@click.argument("place", metavar="FLEET | CATALOGUE")
@click.argument("sql")
@click.option(
    "--time-s",
    type=QuotientRange(min=0.0, min_open=True, max=1e6),
    default=60.0,
    show_default=True,
    help="Longest time for the answer, s.",
)
@click.option(
    "--most-rows",
    type=click.IntRange(min=1),
    default=100_000,
    show_default=True,
    help="Longest answer.",
)
@click.option(
    "--earlier",
    is_flag=True,
    help="Let records of earlier studies and versions count where there is no newer one.",
)
@json_option
def query(
    place: str, sql: str, time_s: float, most_rows: int, earlier: bool, as_json: bool
) -> None:
    """Answer SQL, one SELECT in DuckDB's dialect, over the tables of the catalogue.

    Nothing but the catalogue can be read, and nothing can be changed.
    """
    from flightid import fleet
    from flightid.fleet.engine.address_space import bounded_memory
    from flightid.fleet.page import damaged_light

    with fleet.open(place, earlier=earlier) as catalogue, bounded_memory():
        answer = catalogue.answer(sql, time_s=time_s, most_rows=most_rows)
        lost = damaged_light(len(catalogue.broken))
    if as_json:
        emit_values(finite(answer.to_dict()["rows"]))
    else:
        click.echo(answer)
    if lost is not None:
        note(f"[red] {lost.message} — {lost.action}")
        leave_by_verdict([lost])


@command.command("report", short_help="One page: vehicles, types, what changed, refused logs.")
@click.argument("place", metavar="FLEET | CATALOGUE")
@click.option(
    "--html",
    type=WRITTEN,
    callback=of_a_page,
    help="Write the page to this file instead of printing text.",
)
@json_option
def report(place: str, html: Path | None, as_json: bool) -> None:
    """Answer the questions of a fleet file from its catalogue, on one page.

    Lights by vehicle, each type with the interval of its next vehicle, parameters over time with
    events and changes, and the logs that could not be used with what to change. The exit code is 1
    where a vehicle changed.
    """
    from flightid.files import write_atomically
    from flightid.fleet import fleet_report
    from flightid.report.html import to_html
    from flightid.report.json import to_dict
    from flightid.report.text import to_text, verdict_line

    document = fleet_report(place)
    if html is not None:
        write_atomically(html, to_html(document))
        note(f"Wrote {html}")
        note(verdict_line(document))
    elif as_json:
        emit_values(to_dict(document))
    else:
        click.echo(to_text(document), nl=False)
    leave_by_verdict(document.findings)
