"""What a study file may say about handling qualities."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import replace
from pathlib import Path

from flightid.dynamics.handling_qualities.options import CASES, QualitiesOptions
from flightid.errors import OptionError, StudyError
from flightid.frozen import dataclass
from flightid.options import option, options_class, options_of
from flightid.study.reading import TableReader, read_table

SOURCES = ("fit", "reference", "response", "loop")


@dataclass(frozen=True)
class QualitiesSettings(QualitiesOptions):
    """How handling qualities are read; see `flightid.handling_qualities`."""

    sources: tuple[str, ...] = option(
        SOURCES[:1], choices=SOURCES, doc="What is rated: of each model, and closed loops."
    )


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
    given = [each.name for each in options_of(QualitiesSettings) if each.name in reader]
    settings = read_table(QualitiesSettings, reader)
    _require_case(settings, given, reader.where)
    charts = settings.charts
    return replace(settings, charts=None if charts is None else str(folder / charts))


def _require_case(settings: QualitiesOptions, given: Collection[str], where: str) -> None:
    try:
        settings.require_case(given)
    except OptionError as said:
        problem = f"study file, {where}: {said.problem}"
        raise StudyError(problem, found=said.found, needed=said.needed) from said


QualityCase = options_class(
    "QualityCase",
    [
        (each.name, str | None, option(None, choices=each.choices, doc=each.doc))
        for each in options_of(QualitiesOptions)
        if each.choices and any(each.name in names for names in CASES.values())
    ],
)
"""Case of the standards that one model differs in: keys of ``qualities`` of a ``[[model]]``."""
