"""Models of a type, pooled from the catalogue over all its vehicles, for `flightid tune`."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from flightid.errors import DataError, FlightidError
from flightid.fleet.opening import CURRENT, open_catalogue
from flightid.fleet.statistics.answers import RED, TypeAnswers, answer_questions
from flightid.fleet.statistics.pooling import pooled_model
from flightid.models.kinds import model_from_description
from flightid.reading import parse_toml, read_toml

if TYPE_CHECKING:
    from flightid.fleet.catalogue.catalogue import Catalogue

POOLED = ("parameters", "covariances", "models")


def is_fleet(path: Path) -> bool:
    """Whether a path is a fleet file or the folder of a catalogue."""
    if path.is_dir():
        return (path / CURRENT).is_file()
    try:
        return path.suffix == ".toml" and "fleet" in read_toml(path, "the file")
    except FlightidError:
        return False


def type_models(place: str | Path, *, type_name: str | None = None) -> dict[str, Any]:
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

    Returns
    -------
    dict of str to model
        By the name of the model in the study; flights whose model is red are left out.

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
    Those of `flightid.fleet.statistics.pooling.pooled_model`.

    Example
    -------
    >>> import flightid as fid
    >>> pooled = fid.fleet.type_models("fleet.toml", type_name="quad")
    >>> pooled["roll"].estimated
    EstimateProvenance(2 numbers with covariance, by population)
    """
    with open_catalogue(place) as catalogue:
        chosen = _chosen(catalogue, type_name).replace("'", "''")
        rows: dict[str, list[Mapping[str, Any]]] = {"logs": [], "covariates": []}
        for name in POOLED:
            told = catalogue.query(
                f"SELECT * FROM {name} WHERE type = '{chosen}' AND light <> '{RED}'"
            )
            rows[name] = [dict(zip(told.columns, row, strict=True)) for row in told.fetchall()]
    answers = answer_questions(rows, drift=False, outliers=False)
    return {each.model: _pooled(each, rows["models"]) for each in answers.types}


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


def _pooled(answers: TypeAnswers, rows: list[Mapping[str, Any]]) -> Any:  # noqa: ANN401 — any kind of model
    """One model of a type, from the files of the flights that count."""
    name = f"{answers.model} of type {answers.type_name}"
    if answers.population is None:
        raise DataError("a type cannot be pooled", found=f"{name}: {'; '.join(answers.reasons)}")
    flights = set(answers.data.flights)
    members: list[Any] = [
        model_from_description(parse_toml(row["file"], "a model file", name))
        for row in rows
        if row["model"] == answers.model and row["log"] in flights
    ]
    shapes = {_shape(each) for each in members}
    if len(shapes) != 1:
        raise DataError(
            "flights of a type were fitted with different structures",
            found=f"{name}: {len(shapes)} structures in {len(members)} flights",
            needed="one structure for all",
            action="name a study with that model in the fleet file: [fleet] study",
        )
    return pooled_model(answers.population, replace(members[0], estimated=None), members)


def _shape(model: Any) -> str:  # noqa: ANN401 — any kind of model
    """Structure of a model: all of its description but the numbers."""
    plain = model.to_dict()
    names = sorted(plain.get("parameters", {}))
    told = {k: v for k, v in plain.items() if k not in ("parameters", "estimated", "note", "name")}
    return repr((names, sorted(told.items(), key=str)))
