"""The page of a catalogue: its rows read, the questions of its fleet file answered."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from flightid.conventions import Light
from flightid.errors import FlightidError
from flightid.findings import Finding
from flightid.fleet.catalogue.loose import BROKEN, REWRITE
from flightid.fleet.catalogue.schema import FAILED
from flightid.fleet.catalogue.soundness import unsound_logs
from flightid.fleet.opening import (
    catalogue_place,
    earlier_light,
    names_fleet_file,
    open_catalogue,
    opened_store,
)
from flightid.fleet.page import fleet_document
from flightid.fleet.settings import FleetQuestions, FleetSettings, read_fleet
from flightid.fleet.shares import fleet_shares
from flightid.fleet.statistics.answers import FleetAnswers, answer_questions
from flightid.fleet.statistics.events import FleetEvent
from flightid.uncertainty.quantiles import showing

if TYPE_CHECKING:
    from flightid.fleet.catalogue.catalogue import Catalogue
    from flightid.report.content import Document

ASKED = ("logs", "parameters", "covariances", "covariates")


def ask_fleet(place: str | Path) -> FleetAnswers:
    """Answer the questions of a fleet from its catalogue.

    Parameters
    ----------
    place : str or Path
        Fleet file, whose questions and events count; or folder or address of a catalogue.

    Returns
    -------
    FleetAnswers
        By type and model: population, outliers and drift.

    Raises
    ------
    DataError
        There is no catalogue.
    StudyError
        A fleet file with errors.
    OptionError
        The extra ``fleet`` is not installed.

    Reference
    ---------
    Those of `flightid.fleet.statistics`.

    Example
    -------
    >>> import flightid as fid
    >>> fid.fleet.ask_fleet("fleet.toml").types[0].population
    Population('quad', 5 vehicles, 40 flights, 2 parameters, I² 100 % at most)
    """
    settings = _settings(place)
    questions = FleetQuestions() if settings is None else settings.questions
    with open_catalogue(place) as catalogue:
        rows = _sound({name: _rows(catalogue, name) for name in ASKED})
        damaged = len(catalogue.broken)
    answers = answer_questions(
        rows,
        **asked_of(place),
        parameters=questions.parameters,
        population=questions.population,
    )
    outdated, copies = ((), {}) if settings is None else _as_files_are(settings, place)
    return replace(answers, damaged=damaged, outdated=(*answers.outdated, *outdated), copies=copies)


def _as_files_are(
    settings: FleetSettings, place: str | Path
) -> tuple[tuple[Finding, ...], Mapping[str, str]]:
    """What of the catalogue is not as the files are, and copies; none of files out of reach."""
    store = opened_store(catalogue_place(place))
    earlier = earlier_light(settings, store)
    try:
        shares, _ = fleet_shares(settings, store)
    except (FlightidError, OSError):
        return earlier, {}
    if shares is None:
        return earlier, {}
    return (*earlier, *shares.findings), shares.copies


def asked_of(place: str | Path) -> dict[str, Any]:
    """What a fleet file asks of vehicles; of a catalogue alone all, without events."""
    settings = _settings(place)
    questions = FleetQuestions() if settings is None else settings.questions
    return {
        "events": [] if settings is None else _events(settings),
        "covariates": questions.covariates,
        "drift": questions.drift,
        "outliers": questions.outliers,
    }


def fleet_report(place: str | Path) -> Document:
    """One page about a fleet, as a content tree.

    Parameters
    ----------
    place : str or Path
        Fleet file, or folder or address of a catalogue.

    Returns
    -------
    Document
        For `flightid.report.html.to_html` and its neighbours.

    Raises
    ------
    DataError
        There is no catalogue.
    StudyError
        A fleet file with errors.
    OptionError
        The extra ``fleet`` is not installed.

    Reference
    ---------
    Those of `flightid.fleet.statistics`.

    Example
    -------
    >>> import flightid as fid
    >>> fid.fleet.fleet_report("fleet.toml").title
    'Survey'
    """
    settings = _settings(place)
    with showing(None if settings is None else settings.questions.level):
        return fleet_document(
            ask_fleet(place), "Fleet" if settings is None else settings.words.title
        )


def _settings(place: str | Path) -> FleetSettings | None:
    return read_fleet(place) if names_fleet_file(place) else None


def _events(settings: FleetSettings) -> list[FleetEvent]:
    return [
        FleetEvent(
            each.what,
            each.instant.timestamp(),
            () if each.vehicle is None else (each.vehicle,),
        )
        for each in settings.events
    ]


def _rows(catalogue: Catalogue, name: str) -> list[dict[str, Any]]:
    found = catalogue.table(name)
    return [dict(zip(found.columns, row, strict=True)) for row in found.fetchall()]


def _sound(rows: dict[str, list[dict[str, Any]]]) -> dict[str, list[dict[str, Any]]]:
    """The rows without those of logs that cannot be computed with, which stand as failures.

    Loose records are held against this when they are read; parts of earlier versions were not.
    """
    flaws = unsound_logs(rows)
    if not flaws:
        return rows
    kept = {name: [row for row in held if row["log"] not in flaws] for name, held in rows.items()}
    told = {"outcome": FAILED, "reason": BROKEN, "light": str(Light.RED), "action": REWRITE}
    kept["logs"] = [
        row | told | {"message": f"its record cannot be computed with: {flaws[row['log']]}"}
        if row["log"] in flaws
        else row
        for row in rows["logs"]
    ]
    return kept
