"""``flightid compare``: before and after, of models, flights, or a promise and its flight."""

from __future__ import annotations

import filecmp
import re
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from shlex import quote
from typing import TYPE_CHECKING

import click

from flightid.cli.compared_loops import compared_loops, short_names
from flightid.cli.figures import QuotientRange
from flightid.cli.hints import PARAMETERS
from flightid.cli.lists import ListOption, ListsCommand
from flightid.cli.model_commands import feedback_option
from flightid.cli.next_comparison import flown_for, models_made_of, unasked
from flightid.cli.output import all_option, json_option, level_option
from flightid.cli.pages import html_option, show
from flightid.cli.sources import AXES, known_models, load_source

if TYPE_CHECKING:
    from flightid.dynamics.conditions.result import ConditionComparison
    from flightid.findings import Finding
    from flightid.logs import Log
    from flightid.models import Model
    from flightid.result import Result
    from flightid.review import FlightComparison, FlightReview, MarginComparison
    from flightid.review.flight_state import FlightState

PART = re.compile(r"(.+)@([\d.]*):([\d.]*)")
"""A log and a part of it, s: ``flight.BIN@20:80``."""


@click.command(
    cls=ListsCommand,
    short_help="Put flights, models, gains, or a promise and its flight side by side.",
)
@click.argument("files", nargs=-1, required=True, metavar="A B...", shell_complete=known_models)
@click.option("--axis", type=AXES, help="Of a library model.")
@click.option(
    "--gains",
    cls=ListOption,
    multiple=True,
    type=click.Path(exists=True, dir_okay=False, path_type=Path),
    help="Compare margins under these gains: a parameter file of an autopilot or the TOML of a "
    "PID, as tune writes them; one for both models, one for each, or two for one model.",
)
@feedback_option
@click.option(
    "--loop-rate-hz",
    type=QuotientRange(min=0.0, min_open=True),
    help="Rate of the controllers of --gains, where nothing tells it.",
)
@level_option
@html_option
@all_option
@json_option
def command(
    files: tuple[str, ...],
    axis: str | None,
    gains: tuple[Path, ...],
    feedback: tuple[str, ...],
    loop_rate_hz: float | None,
    level: float | None,
    html: Path | None,
    as_json: bool,
) -> None:
    """What changed from A to B, and what is more than chance.

    Two logs, or parts of logs (flight.BIN@20:80, s on the autopilot's clock): steps, bandwidths and
    tracking of the loops, gains and filters that differ, and whether vehicle, firmware or battery
    do; the two logs alone decide. Models, then a log: what they promise of the gains that it flew
    beside what it shows; where `flightid tune --write` left its files beside either, the next step
    to fly or the file that takes this one back. Models, then two logs: what got worse is held
    against what they promise of the second. Models alone: parameters and modes with their ratios,
    the first as base; with --gains or --feedback, and of studies that tuned a PID, margins with
    intervals of the difference too; one model and two files of --gains: what the gains change. A
    model is a .toml file, the folder of a study, the JSON of a fit, or a library name. To see which
    predicts better: `flightid verify MODEL RECORDS --against MODEL`.
    """
    from flightid.uncertainty.quantiles import showing

    if len(set(files)) < len(files):
        raise click.UsageError("a file is named twice: parts of a log are flight.BIN@20:80")
    flights = [file for file in files if _is_flight(file)]
    _require_different(flights)
    _require_sides(files, flights, closed=bool(gains or feedback))
    if not flights:
        loops = compared_loops(files, axis, gains, feedback, loop_rate_hz)
        conditions = _conditions(files, axis, needed=not loops)
        if not loops:
            *_, last = conditions
            conditions[-1] = replace(last, findings=(*last.findings, unasked(files)))
        said = [finding for each in conditions for finding in each.findings]
        first, *beside = results = [*conditions, *(_without(each, said) for each in loops)]
        if not as_json:
            _show_modes(results, level)
        show(first, "Comparison", *beside, as_json=as_json, html=html, level=level)
        return
    if gains or feedback:
        raise click.UsageError("--gains and --feedback are closed around models; a log has its own")
    if len(flights) > 2:
        raise click.UsageError("two logs are compared at a time")
    models = files[: -len(flights)]
    if tuple(flights) != files[-len(flights) :]:
        raise click.UsageError("name two logs, or models and then the log that flew their gains")
    with showing(level):
        if len(flights) == 2:
            made = _flights(flights[0], flights[1], models)
        else:
            made = _promise(models, flights[0])
        if not as_json:
            for table in made.settings_tables():
                click.echo(f"{table}\n")
        show(made, "Comparison", as_json=as_json, html=html, level=level)


def _require_different(flights: Sequence[str]) -> None:
    """Refuse a copy of a flight beside it: a difference of none would pass for a finding."""
    there = [file for file in flights if Path(file).is_file()]
    for place, one in enumerate(there):
        for other in there[place + 1 :]:
            if filecmp.cmp(one, other, shallow=False):
                raise click.UsageError(f"{one} and {other} are one flight, byte by byte: name two")


def _require_sides(files: Sequence[str], flights: Sequence[str], *, closed: bool) -> None:
    """Refuse gains in place of models, and one side alone that no loop is closed around."""
    if laws := [file for file in files if file.endswith(".toml") and _holds_gains(Path(file))]:
        told = f"MODEL --gains {','.join(laws)}"
        raise click.UsageError(f"{laws[0]} holds gains, no model: flightid compare {told}")
    if sets := [file for file in files if file.endswith(PARAMETERS)]:
        told = f"flightid compare MODEL --gains {','.join(sets)}"
        raise click.UsageError(
            f"{sets[0]} holds gains, no model and no flight: margins under them: {told}; what a "
            "flight kept of its promise: flightid compare STUDY-output LOG"
        )
    if len(files) == len(flights) == 1:
        raise click.UsageError(
            f"one log has nothing beside it: flightid flight {files[0]}, or flightid compare "
            f"{files[0]} OTHER"
        )
    if len(files) == 1 and not closed:
        results = sorted(str(each) for each in Path(files[0]).glob("*-output"))
        named = f" (here: {', '.join(results)})" if results else ""
        raise click.UsageError(
            f"nothing stands beside {files[0]}: flightid compare A B, of logs, models or results "
            f"of studies{named}"
        )


def _conditions(
    files: Sequence[str], axis: str | None, *, needed: bool
) -> list[ConditionComparison]:
    """Parameters and modes; none of models that have no names for them, where margins are there."""
    from flightid import compare_conditions
    from flightid.errors import ModelError
    from flightid.study.paired_models import paired_models

    if len(files) == 1 and not needed:
        return []
    names = short_names(files)
    try:
        if all(Path(file).is_dir() for file in files):
            both = paired_models(files).values()
            return [compare_conditions(dict(zip(names, each, strict=True))) for each in both]
        named = zip(names, files, strict=True)
        return [compare_conditions({name: load_source(model, axis) for name, model in named})]
    except ModelError:
        if needed:
            raise
        return []


def _without(loops: MarginComparison, said: Sequence[Finding]) -> MarginComparison:
    """Margins without the doubts that stand above them."""
    return replace(loops, findings=tuple(each for each in loops.findings if each not in said))


def _show_modes(results: Sequence[Result], level: float | None) -> None:
    """Modes of models with named parameters, ahead of those; of others they are the summary."""
    from flightid.dynamics.conditions.result import ConditionComparison
    from flightid.uncertainty.quantiles import showing

    for result in results:
        if isinstance(result, ConditionComparison) and result.parameters and result.modes:
            with showing(level):
                click.echo(f"{result.modes_table()}\n")


def _holds_gains(path: Path) -> bool:
    from flightid.reading import read_toml

    return path.is_file() and "controller" in read_toml(path, "a file")


def _is_flight(name: str) -> bool:
    from flightid.logs import is_log
    from flightid.record.formats.sniff import is_bag

    path = Path(PART.sub(r"\1", name))
    there = path.is_file() or (path.is_dir() and is_bag(path))
    return there and path.suffix not in (".toml", ".json") and is_log(path)


def _reviewed(name: str) -> FlightReview:
    from flightid import review_flight

    part = PART.fullmatch(name)
    if part is None:
        return review_flight(name)
    span_s = float(part[2] or 0.0), float(part[3] or "inf")
    review = review_flight(part[1], span_s=span_s)
    ends_s = review.start_s, review.start_s + review.duration_s
    if span_s[0] >= ends_s[1] or span_s[1] <= ends_s[0]:
        raise click.UsageError(
            f"{name} lies outside of the log: {ends_s[0]:.1f} to {ends_s[1]:.1f} s of "
            "the autopilot's clock"
        )
    return replace(review, name=f"{review.name}@{part[2]}:{part[3]}")


def _flights(before: str, after: str, models: Sequence[str]) -> FlightComparison:
    """Two flights, judged by themselves; with models named, by what these promise of the second.

    Whatever lies beside the logs changes no verdict: the same two give the same.
    """
    from flightid import compare_flights, compare_with_promise, read_log
    from flightid.progress import progress

    if models and PART.fullmatch(after):
        raise click.UsageError("a promise is compared with a whole log")
    with progress(None, "reviewing both flights"):
        reviews = _reviewed(before), _reviewed(after)
    if not models:
        return replace(compare_flights(*reviews), beside=_beside(before, after))
    log = read_log(after)
    with progress(None, "working out what was promised"):
        promise = compare_with_promise(
            _all_models(models), log, review=reviews[1], state=_state(models)
        )
    made = compare_flights(*reviews, promise=promise)
    return _with_step(made, log, [before, after], promise, models)


def _beside(before: str, after: str) -> str:
    """That no study was looked at, and the command that holds one's promise against the second."""
    said = "Two logs are judged by themselves, whatever lies beside them"
    if PART.fullmatch(before) or PART.fullmatch(after):
        return f"{said}."
    made = models_made_of(Path(before), dict.fromkeys((Path(before).resolve().parent, Path.cwd())))
    study = "STUDY-output" if made is None else str(_near(made))
    named = " ".join(map(quote, (study, before, after)))
    return f"{said}; what a study promised of the second: flightid compare {named}."


def _near(path: Path) -> Path:
    """A path as it is typed here: without the folder that the command runs in."""
    here = Path.cwd()
    return path.relative_to(here) if path.is_relative_to(here) else path


def _with_step(
    made: FlightComparison,
    log: Log,
    logs: Sequence[str],
    promise: FlightComparison,
    models: Sequence[str],
) -> FlightComparison:
    """With what to do after the step of gains that a log flew, if it is one of those beside it.

    `models` promised, as they were named.
    """
    from flightid.inspection import inspect_log
    from flightid.inspection.carried import carried_axes
    from flightid.review.comparison import unheld
    from flightid.review.next_step import flown_step, left_to_fly

    places = [Path(PART.sub(r"\1", name)).resolve().parent for name in (*models, *logs)]
    step = flown_step([_near(each) for each in places if each.is_dir()], log.parameters)
    untold = () if promise is made else unheld(promise)
    said = [*made.findings, *untold]
    if step is None:
        return replace(made, findings=tuple(said))
    to_fly = left_to_fly(promise)
    found = step.finding(
        kept=promise.kept,
        to_fly=to_fly,
        log=log.path.name,
        again=f"flightid compare {' '.join(map(quote, models))} LOG",
        swept=bool(log.sid_runs and carried_axes(inspect_log(log))),
        otherwise=promise.set_otherwise,
    )
    if to_fly and promise.kept is not False:
        # The last line says what to fly for all of them.
        said = [replace(e, action="") if e in unheld(promise) else e for e in said]
    return replace(made, findings=(*said, found))


def _promise(models: Sequence[str], after: str) -> FlightComparison:
    """What models promised of a flight, and which step of the gains comes next."""
    from flightid import compare_with_promise, read_log
    from flightid.progress import progress

    if PART.fullmatch(after):
        raise click.UsageError("a promise is compared with a whole log")
    log = read_log(after)
    with progress(None, "working out what was promised"):
        made = compare_with_promise(_all_models(models), log, state=_state(models))
    return _with_step(made, log, [after], made, models)


def _state(models: Sequence[str]) -> FlightState | None:
    """State of the flight that the models were identified from, where their results tell it."""
    return next(filter(None, (flown_for(Path(name)) for name in models)), None)


def _all_models(names: Sequence[str]) -> list[Model]:
    return [each for name in names for each in _models(name)]


def _models(name: str) -> list[Model]:
    """All models of a folder, or the one that was named."""
    from flightid.models.saved_files import models_of

    if Path(name).is_dir():
        return [load_source(str(path)) for path in models_of(Path(name))]
    return [load_source(name)]
