"""What a study file may say about handling qualities."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

from flightid.dynamics.handling_qualities.handling_qualities import ATTITUDES, VEHICLES
from flightid.study.reading import TableReader

BAND_RAD_S = (0.1, 100.0)
SOURCES = ("fit", "reference", "response", "loop")
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
    sources : tuple of str
        What is rated: of each model its fit, its reference, its measured response; closed loops.
    """

    axes: Mapping[str, tuple[str, str]] | None = None
    signs: Mapping[str, int] = field(default_factory=dict)
    vehicle: str = "rotorcraft"
    response_type: str = "rate"
    band_rad_s: tuple[float, float] = BAND_RAD_S
    conditions: Mapping[str, str] = field(default_factory=dict)
    n_alpha: float | None = None
    charts: Path | None = None
    sources: tuple[str, ...] = SOURCES[:1]


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
        reader.several(
            "sources", SOURCES.__contains__, f"one of {', '.join(SOURCES)}", SOURCES[:1]
        ),
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


def read_cases(reader: TableReader) -> dict[str, str]:
    """Cases of the standards that one model differs in."""
    words = {name: words for each in CONDITIONS.values() for name, words in each.items()}
    made = {name: reader.choice(name, words[name]) for name in words if name in reader}
    reader.finish()
    return made
