"""Comparisons and plans in a worker: what `flightid compare` and `flightid plan` say."""

from __future__ import annotations

import json
import math
import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from flightid.app.compare_schemas import (
    ChangeRow,
    ComparedSide,
    ComparisonPart,
    LoopSteps,
    PlanPart,
    PlanRow,
)
from flightid.app.gain_schemas import GainFile
from flightid.app.overview import light_of, shown_finding, step_curve
from flightid.app.plan_words import as_asked
from flightid.app.study_reach import draft_inside
from flightid.app.work import KEPT, kept_log
from flightid.conventions import Light
from flightid.files import sha256_of_file
from flightid.findings import Finding, worst
from flightid.inspection import inspect_log
from flightid.inspection.carried import carried_axes
from flightid.planning.plan import plan_flight
from flightid.planning.result import DEGREES, AxisSweep, SweepPlan
from flightid.report.flight_card import card_html
from flightid.review.before_after import compare_flights, compare_with_promise
from flightid.review.changes import LoopChange, dashes
from flightid.review.comparison import FlightComparison, unheld
from flightid.review.flight import review_flight
from flightid.review.flight_state import FlightState
from flightid.review.next_step import FlownStep, flown_step, left_to_fly
from flightid.review.tables import cell
from flightid.study.gain_preview import preview_fits
from flightid.surface import speaking
from flightid.uncertainty.estimate import Reading


def make_comparison(
    before: Path,
    after: Path,
    sides: tuple[ComparedSide, ComparedSide],
    study: Path,
    text: str,
    files: Sequence[Mapping[str, str]] = (),
) -> Mapping[str, Any]:
    """A promise of a study and a flight, or two flights or parts of flights.

    `files` are those of the study's tuning, one of which may have flown.
    """
    if not sides[0].promised:
        both = (_reviewed(before, sides[0]), _reviewed(after, sides[1]))
        return _part(compare_flights(*both), None).model_dump()
    key = f"promise of {sha256_of_file(after)} {sha256_of_file(before)} {study} {text}"
    if key not in KEPT:
        with draft_inside(study, text) as draft:
            fits = preview_fits(draft, cache=KEPT)
        state = FlightState.of(kept_log(before))
        KEPT[key] = compare_with_promise(fits, kept_log(after), state=state)
    made: FlightComparison = KEPT[key]
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        for each in files:
            (folder / each["name"]).write_text(each["text"], encoding="utf-8")
        step = flown_step([folder], kept_log(after).parameters)
        if step is not None:
            made = replace(made, findings=_with_next(made, step, after))
        return _part(made, step).model_dump()


def _with_next(made: FlightComparison, step: FlownStep, after: Path) -> tuple[Finding, ...]:
    """Verdicts with what to do after the step that a log flew, as the command says it."""
    flown = kept_log(after)
    plain = FlownStep(Path(step.flown.name), _named(step.following), _named(step.back))
    to_fly = left_to_fly(made)
    found = plain.finding(
        kept=made.kept,
        to_fly=to_fly,
        log=after.name,
        again="drop its log here",
        swept=bool(flown.sid_runs and carried_axes(inspect_log(flown))),
        otherwise=made.set_otherwise,
    )
    said = made.findings
    if to_fly and made.kept is not False:
        # The last line says what to fly for all of them.
        left = unheld(made)
        said = tuple(replace(each, action="") if each in left else each for each in said)
    return (*said, found)


def _named(path: Path | None) -> Path | None:
    return None if path is None else Path(path.name)


def _reviewed(path: Path, side: ComparedSide) -> Any:  # noqa: ANN401 - a review
    key = f"review of {sha256_of_file(path)} {side.span_s}"
    if key not in KEPT:
        KEPT[key] = review_flight(kept_log(path), span_s=side.span_s)
    return KEPT[key]


def _part(made: FlightComparison, step: FlownStep | None) -> ComparisonPart:
    later = {each.name: each for each in made.after if each.is_told}
    pairs = [(each, later[each.name]) for each in made.before if each.name in later]
    columns = ("promised", "flown") if made.promised else ("before", "after")
    return ComparisonPart(
        names=made.names,
        promised=made.promised,
        light=light_of(worst(made.findings)),
        rows=[_row(each, each.key in made.significant) for each in made.changes],
        settings=[
            *((n, f"{old:.5g}", f"{new:.5g}") for n, (old, new) in made.gains.items()),
            *((n, old, new) for n, (old, new) in made.filters.items()),
        ],
        steps=[
            LoopSteps(loop=a.name, before=step_curve(a), after=step_curve(b))
            for a, b in pairs
            if a.is_told
        ],
        findings=[shown_finding(each) for each in made.findings],
        notes=[*dashes(columns, made.changes), *made.left_out],
        following=_file(None if step is None else step.following),
        back=_file(None if step is None else step.back),
    )


def _file(path: Path | None) -> GainFile | None:
    return None if path is None else GainFile(name=path.name, text=path.read_text(encoding="utf-8"))


def _row(change: LoopChange, significant: bool) -> ChangeRow:
    factor, unit = change.shown_unit

    def told(of: Reading) -> str:
        said = cell(of, factor)
        if said is None:
            return "–"
        value, *around = said.split(" (")
        return " (".join((f"{value} {unit}" if unit else value, *around))

    return ChangeRow(
        loop=change.loop,
        name=change.name,
        before=told(change.before),
        after=told(change.after),
        difference=told(change.difference),
        significant=significant,
        alone=change.chance is not None and change.excludes_zero and not significant,
    )


def make_plan(log: Path, options: dict[str, Any]) -> Mapping[str, Any]:
    """The next flight of the vehicle of a log."""
    plan = _plan(log, options)
    light = worst(plan.findings)
    files: list[GainFile] = []
    refusal = "" if plan.is_go else "no-go: nothing is written that a vehicle could load"
    if plan.is_go and plan.sweeps:
        with tempfile.TemporaryDirectory() as folder:
            files = [
                GainFile(name=each.name, text=each.read_text(encoding="utf-8"))
                for each in plan.write(folder)
            ]
    return PlanPart(
        title=plan.title,
        verdict=plan.verdict,
        light=light_of(light),
        axes=list(plan.procedure.axes),
        carried=list(plan.carried),
        rows=[_sweep(each, plan.n_records) for each in plan.sweeps],
        battery=plan.flight_time.words,
        logging=plan.logging,
        findings=[shown_finding(each) for each in plan.findings],
        why=next((f.message for f in plan.findings if f.light is light is not Light.GREEN), ""),
        files=files,
        refusal=refusal,
    ).model_dump()


def make_card(log: Path, options: dict[str, Any]) -> str:
    """The card to print."""
    return card_html(_plan(log, options))


def _plan(log: Path, options: dict[str, Any]) -> SweepPlan:
    key = f"plan of {sha256_of_file(log)} {json.dumps(options, sort_keys=True)}"
    if key not in KEPT:
        with speaking(as_asked):
            KEPT[key] = plan_flight(kept_log(log), **options)
    made: SweepPlan = KEPT[key]
    return made


def _sweep(sweep: AxisSweep, runs: int) -> PlanRow:
    told = None if sweep.plan is None or sweep.is_flown_again else sweep.plan.axes[0]
    guess = sweep.guess
    full = None if guess is None else guess.vehicle.full_command
    plan = sweep.plan
    return PlanRow(
        axis=sweep.axis,
        amplitude=sweep.amplitude,
        size=sweep.size,
        unit="" if plan is None else plan.excitation.unit,
        low_hz=None if plan is None else plan.band_rad_s[0] / math.tau,
        high_hz=None if plan is None else plan.band_rad_s[1] / math.tau,
        duration_s=None if plan is None else plan.excitation.duration_s,
        runs=runs,
        command_percent=None if told is None or not full else 100.0 * told.peak_control / full,
        rate_deg_s=None if told is None else DEGREES * told.peak_rate_rad_s,
        attitude_deg=None if told is None else DEGREES * told.peak_attitude_rad,
        coherence=sweep.coherence,
        rests_on=sweep.rests_on,
        untold=_untold(sweep),
        settings={each.name: each.value for each in sweep.changes},
    )


def _untold(sweep: AxisSweep) -> str:
    """Why no number is expected of a sweep."""
    if sweep.plan is None:
        return "the autopilot sizes this sweep"
    return "seen in this log, so nothing is foretold" if sweep.is_flown_again else ""
