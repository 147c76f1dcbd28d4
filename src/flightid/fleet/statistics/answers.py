"""The questions of a fleet, answered from the rows of its catalogue."""

from __future__ import annotations

import datetime
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import field, replace
from typing import Any

import numpy as np

from flightid.errors import FlightidError
from flightid.findings import Finding
from flightid.fleet.catalogue.schema import FITTED, from_lower_triangle
from flightid.fleet.parameter_words import told_apart
from flightid.fleet.statistics.covariates import Covariate
from flightid.fleet.statistics.drift import FleetDrift, find_drift
from flightid.fleet.statistics.events import FleetEvent
from flightid.fleet.statistics.events_of_nobody import events_of_nobody
from flightid.fleet.statistics.flight_estimates import FlightEstimates
from flightid.fleet.statistics.least_difference import least_differences
from flightid.fleet.statistics.moderated_errors import moderated_errors
from flightid.fleet.statistics.odd_flights import without_odd_flights
from flightid.fleet.statistics.outliers import FleetOutliers, find_outliers
from flightid.fleet.statistics.population import Population, estimate_population
from flightid.fleet.statistics.spread_search import FEWEST
from flightid.frozen import dataclass
from flightid.threads import on_one_thread
from flightid.uncertainty.estimate import Estimate

Row = Mapping[str, Any]
Rows = Mapping[str, Sequence[Row]]
RED = "red"
UNDATED = "no flight has a date, so nothing is said of change"


@dataclass(frozen=True, eq=False)
class TypeAnswers:
    """What is known of one model of one type.

    Attributes
    ----------
    type_name, model : str
    data : FlightEstimates
    population : Population or None
    outliers : FleetOutliers or None
    drift : FleetDrift or None
    reasons : tuple of str
        Why an answer is missing.
    labels : mapping of str to str
        Parameters in words, where their models have them: ``"Lp"`` to ``"roll damping"``.
    red : mapping of str to int
        By vehicle: its flights of which this model is red, which count nowhere.
    newest_red : mapping of str to int
        By vehicle: how many of them follow the last flight with a date that counts.
    odd_flights : mapping of str to tuple of str
        By parameter: logs left out of the population (`without_odd_flights`), by file name.
    least_differences : mapping of str to tuple of Estimate
        By vehicle: which difference from its type would have been told, where that was asked.
    """

    type_name: str
    model: str
    data: FlightEstimates
    population: Population | None
    outliers: FleetOutliers | None
    drift: FleetDrift | None
    reasons: tuple[str, ...] = ()
    labels: Mapping[str, str] = field(default_factory=dict)
    red: Mapping[str, int] = field(default_factory=dict)
    newest_red: Mapping[str, int] = field(default_factory=dict)
    odd_flights: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    least_differences: Mapping[str, tuple[Estimate, ...]] = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class FleetAnswers:
    """Answers by type and model, with what became of every log.

    Attributes
    ----------
    types : tuple of TypeAnswers
    logs : sequence of mapping
        Rows of the catalogue's table of logs.
    undated : int
        Flights without a date, which are in no history.
    red : mapping of str to sequence of str
        By model: addresses of logs of which another model counts, and this one is red.
    damaged : int
        Parts of the catalogue that cannot be read: their logs are in no answer.
    outdated : tuple of Finding
        What of the catalogue and the fleet file is not as the logs are: events of nobody too.
    copies : mapping of str to str
        Files with the bytes of another, whose log they are, and that one.
    """

    types: tuple[TypeAnswers, ...]
    logs: Sequence[Row]
    undated: int = 0
    red: Mapping[str, Sequence[str]] = field(default_factory=dict)
    damaged: int = 0
    outdated: tuple[Finding, ...] = ()
    copies: Mapping[str, str] = field(default_factory=dict)


@on_one_thread
def answer_questions(
    rows: Rows,
    *,
    events: Sequence[FleetEvent] = (),
    covariates: Sequence[str] = (),
    parameters: Sequence[str] = (),
    population: bool = True,
    drift: bool = True,
    outliers: bool = True,
) -> FleetAnswers:
    """Answer what a fleet file asks.

    Parameters
    ----------
    rows : mapping of str to sequence of mapping
        Tables ``logs``, ``parameters``, ``covariances`` and ``covariates`` of the catalogue.
    events : sequence of FleetEvent
        On the clock of Unix, s, UTC.
    covariates : sequence of str
        Names of covariates that are taken out before drift is looked for.
    parameters : sequence of str
        Parameters that are asked about; none: all that are free.
    population, drift, outliers : bool
        Which questions are asked.

    Returns
    -------
    FleetAnswers
        Flights whose model is red, that name no vehicle or type, or have no interval, are left out.
    """
    told = [each for each in rows["parameters"] if _counts(each, parameters)]
    groups = sorted({(each["type"], each["model"]) for each in told})
    answers, undated = [], 0
    names = {e["log"]: str(e["address"]).rpartition("/")[2] for e in rows["logs"]}
    for type_name, model in groups:
        mine = [e for e in told if (e["type"], e["model"]) == (type_name, model)]
        data = _estimates(mine, [e for e in rows["covariances"] if e["model"] == model])
        dated = np.array([_instant(head) is not None for head in _heads(mine).values()])
        undated += int(np.count_nonzero(~dated))
        one = _answered(type_name, model, data, events, population=population, outliers=outliers)
        named = {k: tuple(names.get(log, log) for log in v) for k, v in one.odd_flights.items()}
        one = replace(one, odd_flights=named)
        if drift and dated.any():
            flights = data.chosen(dated)
            explained = _covariates(flights, rows, covariates)
            one = replace(one, drift=find_drift(flights, explained, events))
        elif drift:
            one = replace(one, reasons=(*one.reasons, UNDATED))
        labels = told_apart({each["name"]: each.get("meaning") for each in mine})
        red = _red_flights(rows["parameters"], type_name, model)
        last = _last_flown(data.chosen(dated)) if dated.any() else {}
        newest = Counter(str(e["vehicle"]) for e in red if _follows(e, last))
        lost = Counter(str(each["vehicle"]) for each in red)
        answers.append(replace(one, labels=labels, red=lost, newest_red=newest))
    nobody = tuple(events_of_nobody(events, {str(each["vehicle"]) for each in told}))
    return FleetAnswers(
        tuple(answers), tuple(rows["logs"]), undated, _red_models(rows), outdated=nobody
    )


def _red_models(rows: Rows) -> dict[str, list[str]]:
    """Addresses of fitted logs by the model of theirs that is red, and counts nowhere."""
    places = {e["log"]: str(e["address"] or "") for e in rows["logs"] if e["outcome"] == FITTED}
    found: dict[str, dict[str, None]] = {}
    for each in rows["parameters"]:
        if each["light"] == RED and each["log"] in places:
            found.setdefault(str(each["model"]), {})[each["log"]] = None
    return {model: [places[log] for log in logs] for model, logs in sorted(found.items())}


def _counts(row: Row, parameters: Sequence[str]) -> bool:
    known = all(row[key] is not None for key in ("vehicle", "type", "value", "stderr", "position"))
    asked = not parameters or row["name"] in parameters
    return bool(known and asked and row["light"] != RED and row["stderr"] > 0.0)


def _heads(rows: Sequence[Row]) -> dict[str, Row]:
    """First row of each log, in the order of logs."""
    found: dict[str, Row] = {}
    for each in rows:
        found.setdefault(each["log"], each)
    return found


def _red_flights(rows: Sequence[Row], type_name: str, model: str) -> list[Row]:
    """First row of each flight of which a model is red."""
    mine = (e for e in rows if e["light"] == RED and (e["type"], e["model"]) == (type_name, model))
    return list(_heads(list(mine)).values())


def _last_flown(data: FlightEstimates) -> dict[str, float]:
    """Start of the newest flight of each vehicle, s."""
    found: dict[str, float] = {}
    for vehicle, at in zip(data.vehicles, data.time_s.tolist(), strict=True):
        found[vehicle] = max(at, found.get(vehicle, -np.inf))
    return found


def _follows(row: Row, last: Mapping[str, float]) -> bool:
    """Whether a flight came after the last one that counts of its vehicle, if there is one."""
    at = _instant(row)
    return at is not None and at > last.get(str(row["vehicle"]), np.inf)


def _instant(row: Row) -> float | None:
    """Start of a flight on the clock of Unix, s; None where nobody says."""
    found = row["flown_at"]
    if found is None:
        return None
    at = datetime.datetime.fromisoformat(found) if isinstance(found, str) else found
    aware = at if at.tzinfo is not None else at.replace(tzinfo=datetime.UTC)
    return float(aware.timestamp())


def _estimates(rows: Sequence[Row], covariances: Sequence[Row]) -> FlightEstimates:
    names = sorted({each["name"] for each in rows})
    heads = _heads(rows)
    logs = list(heads)
    units = {each["name"]: each["unit"] or "1" for each in rows}
    values, known = np.zeros((len(logs), len(names))), np.zeros((len(logs), len(names)), dtype=bool)
    errors, freedom = np.ones(values.shape), np.full(values.shape, np.inf)
    matrices = np.zeros((len(logs), len(names), len(names)))
    place = {log: n for n, log in enumerate(logs)}
    columns = {name: i for i, name in enumerate(names)}
    for each in rows:
        n, i = place[each["log"]], columns[each["name"]]
        values[n, i], known[n, i] = each["value"], True
        errors[n, i] = each["stderr"]
        if each.get("freedom") is not None:
            freedom[n, i] = each["freedom"]
    for i in range(len(names)):
        told = known[:, i]
        matrices[told, i, i] = moderated_errors(errors[told, i], freedom[told, i]) ** 2
    for each in covariances:
        if each["log"] in place:
            _set_covariance(matrices[place[each["log"]]], each, columns)
    return FlightEstimates.of(
        names,
        [str(each["vehicle"]) for each in heads.values()],
        values,
        matrices,
        time_s=[_instant(each) or 0.0 for each in heads.values()],
        units=[units[name] for name in names],
        known=known,
        flights=logs,
    )


def _set_covariance(matrix: Any, row: Row, columns: Mapping[str, int]) -> None:  # noqa: ANN401 — an array
    """Correlations of a fit about the standard errors that its parameters state."""
    found = np.array(from_lower_triangle(row["lower"]))
    sizes = np.sqrt(np.diag(found))
    stated = np.sqrt(np.diag(matrix))
    for a, first in enumerate(row["names"]):
        for b, second in enumerate(row["names"]):
            if a != b and first in columns and second in columns and sizes[a] * sizes[b] > 0.0:
                i, j = columns[first], columns[second]
                matrix[i, j] = found[a, b] / (sizes[a] * sizes[b]) * stated[i] * stated[j]


def _answered(
    type_name: str,
    model: str,
    data: FlightEstimates,
    events: Sequence[FleetEvent],
    *,
    population: bool,
    outliers: bool,
) -> TypeAnswers:
    if not (population or outliers):
        return TypeAnswers(type_name, model, data, None, None, None)
    shared, rare = _shared(data)
    usual, odd = without_odd_flights(shared, events)
    try:
        found = estimate_population(usual, type_name)
        apart = find_outliers(found) if outliers else None
    except FlightidError as error:
        return TypeAnswers(type_name, model, data, None, None, None, (error.reason,))
    common, least = found if population else None, least_differences(found) if outliers else {}
    one = TypeAnswers(type_name, model, data, common, apart, None, rare, odd_flights=odd)
    return replace(one, least_differences=least)


def _shared(data: FlightEstimates) -> tuple[FlightEstimates, tuple[str, ...]]:
    """Estimates of parameters that several vehicles tell, and what is said of the others."""
    told = [data.known[:, i] for i in range(len(data.names))]
    common = np.array([len(set(data.member_of[each])) >= FEWEST for each in told])
    if common.all() or not common.any():
        return data, ()
    rare = [
        f"what is common in {name}, which {data.members[data.member_of[each][0]]} alone tells"
        for name, each, several in zip(data.names, told, common, strict=True)
        if not several
    ]
    return data.of_parameters(common), tuple(rare)


def _covariates(
    data: FlightEstimates, rows: Rows, names: Sequence[str]
) -> dict[str, list[float | str | None]]:
    """One value a flight; of the logs themselves where the covariates lack it, as firmware."""
    found: dict[str, list[float | str | None]] = {}
    logs = {each["log"]: each for each in rows["logs"]}
    for name in names:
        told = {
            each["log"]: each["value"] if each["text"] is None else each["text"]
            for each in rows["covariates"]
            if each["name"] == name
        }
        own: Covariate = [told.get(log, logs.get(log, {}).get(name)) for log in data.flights]
        found[name] = list(own)
    return found


def fitted_share(logs: Sequence[Row]) -> tuple[int, int]:
    """Logs with a model, and all of them."""
    return sum(each["outcome"] == FITTED for each in logs), len(logs)
