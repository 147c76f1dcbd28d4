"""What a study file may say about handling qualities, and the stage that reads them off fits."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

from flightid.dynamics.handling_qualities.handling_qualities import (
    ATTITUDES,
    VEHICLES,
    HandlingQualities,
    handling_qualities,
)
from flightid.errors import StudyError
from flightid.study.faults import Faults
from flightid.study.reading import TableReader

if TYPE_CHECKING:
    from flightid.identification import Fit
    from flightid.study.identified import ModelResults
    from flightid.study.task import Task

BAND_RAD_S = (0.1, 100.0)
CONDITIONS: dict[str, dict[str, tuple[str, ...]]] = {
    "rotorcraft": {
        "speed": ("hover", "forward"),
        "task": ("other", "tracking"),
        "attention": ("full", "divided"),
    },
    "aeroplane": {
        "category": ("A", "B", "C"),
        "aircraft_class": ("I", "II", "II-L", "II-C", "III", "IV"),
    },
}
"""Cases of the standards by vehicle, the usual one first."""


@dataclass(frozen=True)
class QualitiesSettings:
    """How handling qualities are read; see `flightid.handling_qualities`.

    Attributes
    ----------
    axes : mapping of str to tuple of str, or None
        Output and control by axis; None: by their usual names.
    signs : mapping of str to int
        −1 for an axis whose control pulls the other way.
    vehicle, response_type : str
    band_rad_s : tuple of float
    conditions : mapping of str to str
        Case of the standard.
    n_alpha : float or None
        g/rad.
    charts : Path or None
        File of charts in place of ours.
    """

    axes: Mapping[str, tuple[str, str]] | None = None
    signs: Mapping[str, int] = field(default_factory=dict)
    vehicle: str = "rotorcraft"
    response_type: str = "rate"
    band_rad_s: tuple[float, float] = BAND_RAD_S
    conditions: Mapping[str, str] = field(default_factory=dict)
    n_alpha: float | None = None
    charts: Path | None = None


def read_qualities(reader: TableReader, folder: Path) -> QualitiesSettings:
    """Read the table ``[handling_qualities]``.

    Parameters
    ----------
    reader : TableReader
    folder : Path
        Of the study file.

    Raises
    ------
    StudyError
        A key is unknown, or a value does not fit.
    """
    vehicle = reader.choice("vehicle", VEHICLES, VEHICLES[0])
    conditions = {
        name: reader.choice(name, words, words[0]) for name, words in CONDITIONS[vehicle].items()
    }
    band = reader.maybe(reader.interval, "band_rad_s") or BAND_RAD_S
    if band[0] <= 0.0:
        raise reader.error("band_rad_s", "does not fit", found=band, needed="positive frequencies")
    charts = reader.maybe(reader.text, "charts")
    made = QualitiesSettings(
        reader.maybe(lambda key: _axes(reader.table(key)), "axes"),
        _signs(reader.table("signs")),
        vehicle,
        reader.choice("response_type", ("rate", "attitude"), "rate"),
        band,
        conditions,
        reader.maybe(reader.positive, "n_alpha") if vehicle == "aeroplane" else None,
        None if charts is None else folder / charts,
    )
    reader.finish()
    return made


def _axes(reader: TableReader) -> dict[str, tuple[str, str]]:
    found = {}
    for axis in ATTITUDES:
        pair = reader.maybe(reader.names, axis)
        if pair is not None and len(pair) != 2:
            raise reader.error(axis, "does not fit", found=pair, needed="an output and a control")
        if pair is not None:
            found[axis] = (pair[0], pair[1])
    reader.finish()
    return found


def _signs(reader: TableReader) -> dict[str, int]:
    found = {}
    for axis in ATTITUDES:
        sign = reader.maybe(reader.number, axis)
        if sign is not None and abs(sign) != 1.0:
            raise reader.error(axis, "does not fit", found=sign, needed="1 or -1")
        if sign is not None:
            found[axis] = int(sign)
    reader.finish()
    return found


def require_pairs(tasks: Iterable[Task], settings: QualitiesSettings) -> None:
    """See before any work that each axis is some model's.

    Raises
    ------
    StudyError
        There is no model with equations, or none with the output and control of an axis.
    """
    models = [task.model for task in tasks if task.model is not None]
    if not models:
        raise StudyError(
            "handling qualities are read off models with equations",
            found="none in the study",
            action="take [handling_qualities] out, or call flightid.handling_qualities",
        )
    for axis, (output, control) in (settings.axes or {}).items():
        if not any(output in model.outputs and control in model.inputs for model in models):
            raise StudyError(
                f"study file, [handling_qualities.axes]: no model gives {output} from {control}",
                found=f"{axis} = {[output, control]}",
                needed="output and control of one of the models",
            )


def rate_models(
    identified: Iterable[ModelResults], settings: QualitiesSettings, faults: Faults
) -> dict[str, HandlingQualities]:
    """Handling qualities of every fit, by the name of its model.

    Parameters
    ----------
    identified : iterable of ModelResults
    settings : QualitiesSettings
    faults : Faults
        Takes what cannot be rated.

    Returns
    -------
    dict of str to HandlingQualities
    """
    found = {}
    for item in identified:
        if item.fit is None or item.settings.structure is not None:
            continue
        name = item.settings.name
        rated = faults.spare(f"handling qualities of “{name}”", _rated, None, item.fit, settings)
        if rated is not None:
            found[name] = rated
    return found


def _rated(fit: Fit, settings: QualitiesSettings) -> HandlingQualities:
    model, axes = fit.model, settings.axes
    if axes is not None:
        axes = {
            axis: pair
            for axis, pair in axes.items()
            if pair[0] in model.outputs and pair[1] in model.inputs
        }
    return handling_qualities(
        fit,
        axes=axes,
        signs=settings.signs,
        vehicle=settings.vehicle,
        response_type=settings.response_type,
        band_rad_s=settings.band_rad_s,
        n_alpha=settings.n_alpha,
        charts=None if settings.charts is None else str(settings.charts),
        **settings.conditions,
    )
