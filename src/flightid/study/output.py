"""A study's output folder: it appears whole or not at all."""

from __future__ import annotations

import json
import secrets
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from flightid.errors import FileFormatError, StudyError
from flightid.report.content import Document
from flightid.report.json import from_dict

RESULTS = "results.json"
SCHEMA = "flightid.study/1"


@contextmanager
def whole_folder(final: Path) -> Iterator[Path]:
    """Give a temporary folder that becomes `final` when the block succeeds.

    An earlier result of a study at `final` is replaced; any other content is refused. On failure or
    interrupt the temporary folder is removed and what stood at `final` stands there still.

    Parameters
    ----------
    final : Path
        Folder to make.

    Yields
    ------
    Path
        Temporary folder beside it.

    Raises
    ------
    StudyError
        `final` holds something that no study wrote.
    """
    require_replaceable(final)
    final.parent.mkdir(parents=True, exist_ok=True)
    temporary = final.with_name(f".{final.name}.{secrets.token_hex(6)}.part")
    temporary.mkdir()
    try:
        yield temporary
        _exchange(temporary, final)
    except BaseException:
        shutil.rmtree(temporary, ignore_errors=True)
        raise


def require_replaceable(final: Path) -> None:
    """Refuse a folder that a study may not replace; call it before the work, not after it.

    Raises
    ------
    StudyError
        `final` holds something that no study wrote.
    """
    if not final.exists() or (final.is_dir() and not any(final.iterdir())):
        return
    if final.is_dir() and _is_ours(final / RESULTS):
        return
    raise StudyError(
        "the output folder holds something else",
        found=str(final),
        needed="a new folder, an empty one, or the output of an earlier run",
        action="name another folder with --output",
    )


def _is_ours(results: Path) -> bool:
    if not results.is_file():
        return False
    try:
        values = json.loads(results.read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return False
    return isinstance(values, dict) and values.get("schema") == SCHEMA


def _exchange(temporary: Path, final: Path) -> None:
    """Put the new folder in the place of the old; the old one returns if that fails."""
    if not final.exists():
        temporary.replace(final)
        return
    aside = final.with_name(f".{final.name}.{secrets.token_hex(6)}.old")
    final.replace(aside)
    try:
        temporary.replace(final)
    except BaseException:
        aside.replace(final)
        raise
    shutil.rmtree(aside, ignore_errors=True)


def read_report(path: Path) -> Document:
    """Content tree of an earlier run.

    Parameters
    ----------
    path : Path
        Output folder of a study, or its ``results.json``.

    Returns
    -------
    Document

    Raises
    ------
    FileFormatError
        The file holds no results of a study.
    """
    results = path / RESULTS if path.is_dir() else path
    try:
        values = json.loads(results.read_text(encoding="utf-8"))
    except (ValueError, RecursionError) as error:
        raise FileFormatError("not a results file", found=f"{results}: {error}") from error
    if not isinstance(values, dict) or values.get("schema") != SCHEMA:
        raise FileFormatError("not a results file", found=str(results), needed=f"schema {SCHEMA}")
    report = values.get("report")
    return from_dict(report if isinstance(report, dict) else {})
