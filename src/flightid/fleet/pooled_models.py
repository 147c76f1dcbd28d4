"""Models of a type, pooled from the catalogue over all its vehicles, for `flightid tune`."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from flightid.conventions import Light
from flightid.errors import DataError
from flightid.fleet.catalogue.loose import REWRITE
from flightid.fleet.catalogue.soundness import unsound_logs
from flightid.fleet.opening import open_catalogue
from flightid.fleet.reporting import asked_of
from flightid.fleet.statistics.answers import RED, TypeAnswers, answer_questions
from flightid.fleet.statistics.joint_fit import FlightPoints, MeasuredPoints, fit_population
from flightid.fleet.statistics.pooling import pooled_model
from flightid.fleet.vehicle_lights import vehicle_light
from flightid.models.kinds import model_from_description
from flightid.reading import parse_toml
from flightid.threads import on_one_thread

if TYPE_CHECKING:
    from flightid.fleet.catalogue.catalogue import Catalogue

Row = Mapping[str, Any]
POOLED = ("logs", "parameters", "covariances", "covariates", "models", "responses")


@on_one_thread
def type_models(
    place: str | Path, *, type_name: str | None = None, joint: bool = False
) -> dict[str, Any]:
    """Pool the models of a type over its vehicles, straight from a catalogue.

    Every model of the study becomes one whose covariance is that of the next vehicle, with the
    band that all flights share, the worst light of each check and the model error that nine flights
    of ten keep: what `flightid tune` makes of it holds for the fleet.

    Parameters
    ----------
    place : str or Path
        Fleet file, or folder or address of a catalogue.
    type_name : str, optional
        Which type; default: the only one.
    joint : bool
        Whether the measured responses of all flights are fitted together (`fit_population`), in
        place of pooling the estimates of their fits: flights that tell little by themselves count
        with what they tell.

    Returns
    -------
    dict of str to model
        By the name of the model in the study; flights whose model is red are left out. Vehicles
        that changed or are unlike their type count: the provenance of the model names them
        (``"apart"``), and so does what is tuned with it.

    Raises
    ------
    DataError
        There is no catalogue, or no such type in it; several types and none is named; flights with
        different structures; a model that fewer than two vehicles tell.
    OptionError
        The extra ``fleet`` is not installed.

    Assumes
    -------
    Vehicles normal about the mean of their type. Biased as `estimate_population` is.

    Reference
    ---------
    Those of `flightid.fleet.statistics.pooling.pooled_model` and
    `flightid.fleet.statistics.joint_fit.fit_population`.

    Example
    -------
    >>> import flightid as fid
    >>> pooled = fid.fleet.type_models("types.toml", type_name="quad")
    >>> pooled["Roll"].estimated.method
    'population'
    """
    with open_catalogue(place) as catalogue:
        chosen = _chosen(catalogue, type_name).replace("'", "''")
        rows: dict[str, list[Row]] = {}
        for name in POOLED:
            told = catalogue.query(
                f"SELECT * FROM {name} WHERE type = '{chosen}' AND light <> '{RED}'"
            )
            rows[name] = [dict(zip(told.columns, row, strict=True)) for row in told.fetchall()]
    _require_sound(rows)
    answers = answer_questions(rows, **asked_of(place))
    points = rows["responses"] if joint else None
    return {each.model: _pooled(each, rows["models"], points) for each in answers.types}


def _require_sound(rows: Mapping[str, Sequence[Row]]) -> None:
    """Refuse what a part of an earlier version may hold, by the log whose record it is."""
    for log, flaw in unsound_logs(rows).items():
        raise DataError(
            "a record of the catalogue cannot be computed with",
            found=f"log {log[:16]}…: {flaw}",
            action=REWRITE,
        )


def _chosen(catalogue: Catalogue, type_name: str | None) -> str:
    """The type that is named, or the only one that has models."""
    found = catalogue.query(
        f"SELECT DISTINCT type FROM models WHERE type IS NOT NULL AND light <> '{RED}' ORDER BY 1"
    )
    types = [str(name) for (name,) in found.fetchall()]
    wanted = types if type_name is None else [name for name in types if name == type_name]
    if len(wanted) == 1:
        return wanted[0]
    raise DataError(
        "no type to be pooled" if not wanted else "several types, and none is named",
        found=", ".join(types)[:300] or "no model of a vehicle whose type is known",
        needed="one type with models that are not red",
        action="name one with --type" if types else "run the fleet, and name [vehicles] type",
    )


def _pooled(answers: TypeAnswers, rows: Sequence[Row], points: Sequence[Row] | None) -> Any:  # noqa: ANN401 — any kind of model
    """One model of a type, from the files of the flights that count."""
    name = f"{answers.model} of type {answers.type_name}"
    if answers.population is None:
        raise DataError("a type cannot be pooled", found=f"{name}: {'; '.join(answers.reasons)}")
    flights = set(answers.data.flights)
    members: dict[str, Any] = {
        row["log"]: model_from_description(parse_toml(row["file"], "a model file", row["log"]))
        for row in rows
        if row["model"] == answers.model and row["log"] in flights
    }
    shapes = {_shape(each) for each in members.values()}
    if len(shapes) != 1:
        raise DataError(
            "flights of a type were fitted with different structures",
            found=f"{name}: {len(shapes)} structures in {len(members)} flights",
            needed="one structure for all",
            action="name a study with that model in the fleet file: [fleet] study",
        )
    plain = replace(next(iter(members.values())), estimated=None)
    population = answers.population
    if points is not None:
        mine = [row for row in points if row["model"] == answers.model]
        told = [_flight_points(plain, log, members[log], mine) for log in sorted(members)]
        population = fit_population(plain, told, answers.type_name)
    made = pooled_model(population, plain, list(members.values()))
    apart = _apart(answers)
    if not apart:
        return made
    provenance = {**made.estimated.provenance, "apart": apart}
    return replace(made, estimated=replace(made.estimated, provenance=provenance))


def _apart(answers: TypeAnswers) -> list[str]:
    """What is said of vehicles that changed, or are unlike the others that they are pooled with."""
    lights = (vehicle_light(name, [answers]) for name in answers.data.members)
    return [each.message for each in lights if each.light in (Light.RED, Light.AMBER)]


def _flight_points(plain: Any, log: str, member: Any, rows: Sequence[Row]) -> FlightPoints:  # noqa: ANN401
    """What one flight measured, with what its own fit knew."""
    mine = [row for row in rows if row["log"] == log]
    free, known = [each.name for each in plain.parameters.free], member.estimated
    covariance = None
    if known.covariance is not None and set(free) <= set(known.names):
        places = [known.names.index(name) for name in free]
        covariance = known.covariance[np.ix_(places, places)]
    return FlightPoints(
        str(mine[0]["vehicle"]) if mine else "",
        log,
        {
            f"{row['output']}/{row['input']}": MeasuredPoints(
                np.array(row["omega_rad_s"]),
                np.array(row["real"]) + 1j * np.array(row["imag"]),
                np.array(row["random_error"]),
            )
            for row in mine
        },
        np.array([member.parameters[name].value for name in free]),
        covariance,
    )


def _shape(model: Any) -> str:  # noqa: ANN401 — any kind of model
    """Structure of a model: all of its description but the numbers."""
    plain = model.to_dict()
    names = sorted(plain.get("parameters", {}))
    told = {k: v for k, v in plain.items() if k not in ("parameters", "estimated", "note", "name")}
    return repr((names, sorted(told.items(), key=str)))
