"""What a study file may say about handling qualities."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass, replace
from pathlib import Path
from typing import cast

from flightid.dynamics.handling_qualities.options import CASES, QualitiesOptions
from flightid.errors import OptionError, StudyError
from flightid.options import option, options_of
from flightid.study.reading import TableReader, read_each

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
    (made,) = read_each((QualitiesSettings,), reader)
    settings = cast("QualitiesSettings", made)
    _require_case(settings, given, reader.where)
    charts = settings.charts
    return replace(settings, charts=None if charts is None else str(folder / charts))


def _require_case(settings: QualitiesOptions, given: Collection[str], where: str) -> None:
    try:
        settings.require_case(given)
    except OptionError as said:
        problem = f"study file, {where}: {said.problem}"
        raise StudyError(problem, found=said.found, needed=said.needed) from said


def read_cases(reader: TableReader) -> dict[str, str]:
    """Cases of the standards that one model differs in."""
    names = [name for case in CASES.values() for name in case]
    known = [each for each in options_of(QualitiesOptions) if each.name in names and each.choices]
    made = {each.name: reader.choice(each.name, each.choices) for each in known
            if each.name in reader}  # fmt: skip
    reader.finish()
    return made
