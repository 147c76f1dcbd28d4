"""``flightid plan``: what to fly so that the next log can be identified."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from flightid.cli.option_fields import OptionsCommand, parted
from flightid.cli.output import emit_values, json_option, leave_by_verdict, note
from flightid.cli.records import FILES

if TYPE_CHECKING:
    from flightid.options import Options
    from flightid.planning.result import SweepPlan


def _fields() -> dict[str, type[Options]]:
    from flightid.planning.options import PlanOptions

    return {"the sweeps": PlanOptions}


@click.command(
    cls=OptionsCommand,
    fields_of=_fields,
    short_help="Say what to fly next: sweeps, settings with the way back, a card.",
)
@click.argument("log", metavar="[LOG|STUDY]", required=False, type=FILES)
@click.option(
    "--output",
    type=click.Path(file_okay=False, path_type=Path),
    help="Folder of card and settings; default: <log>-plan beside the log.",
)
@click.option("--overwrite", is_flag=True, help="Replace files of settings that exist.")
@click.option("--write-no-go", is_flag=True, help="Write settings in spite of a no-go.")
@json_option
def command(
    log: Path | None,
    output: Path | None,
    overwrite: bool,
    write_no_go: bool,
    as_json: bool,
    **options: Any,  # noqa: ANN401 — read from the fields
) -> None:
    """Plan the sweeps of the vehicle that LOG was flown with, or of a typical --vehicle.

    LOG is any flight: its loops stay on while the sweep is flown, so they decide, with the axis as
    this flight showed it, which amplitude gives which rates, attitudes and coherence. Writes
    card.html, one page to print and take to the field, and the settings of each axis with the file
    that takes them back. Axes of which LOG can carry a model already are left out, unless --axes
    names them. The exit code is 1 for no-go, which leaves no settings. A STUDY (*.toml) names
    its log, and says under [plan] what is asked for; options of the command line go first.
    """
    from flightid import plan_flight
    from flightid.progress import progress

    (asked,) = parted(options, _fields())
    if log is not None and log.suffix == ".toml":
        log, asked = _of_study(log, asked)
    if (log is None) == ("vehicle" not in asked):
        raise click.UsageError("name a LOG, or without one a --vehicle")
    if log is not None and "autopilot" in asked:
        raise click.UsageError("--autopilot belongs to --vehicle: a log tells its own")
    with progress(None, "planning"):
        plan = plan_flight(log, **asked)
    try:
        _write(plan, output or _place(log, asked), overwrite=overwrite, no_go=write_no_go)
    finally:
        # The verdict is to stand where eyes are, whatever could not be written.
        emit_values(plan.to_dict()) if as_json else click.echo(plan.on_screen())
    leave_by_verdict(plan.findings)


def _place(log: Path | None, asked: dict[str, Any]) -> Path:
    """Folder of a plan that names none."""
    return Path(f"{asked['vehicle']}-plan") if log is None else log.parent / f"{log.stem}-plan"


def _write(plan: SweepPlan, place: Path, *, overwrite: bool, no_go: bool) -> None:
    """Write settings where they may be flown, and the card; nothing where nothing is to fly."""
    from flightid.files import write_atomically
    from flightid.report.flight_card import card_html

    if not plan.sweeps:
        return
    if plan.is_go or no_go:
        for path in plan.write(place, overwrite=overwrite, write_no_go=no_go):
            note(f"Wrote {path}")
    else:
        place.mkdir(parents=True, exist_ok=True)
        note("No settings written: no-go (--write-no-go writes them)")
    note(f"Wrote {write_atomically(place / 'card.html', card_html(plan))}: print it")


def _of_study(study: Path, asked: dict[str, Any]) -> tuple[Path, dict[str, Any]]:
    """Log of a study, and what it says under [plan] beneath what was asked for."""
    from flightid.study.settings import read_settings
    from flightid.study.taking import require_log
    from flightid.study.view_settings import TOLD_BY_LOG

    settings = read_settings(study)
    said = {} if settings.views.plan is None else vars(settings.views.plan)
    known = {key: value for key, value in said.items() if key not in TOLD_BY_LOG}
    return require_log(settings.log, study), {**known, **asked}
