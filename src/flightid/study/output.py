"""A study's output folder: it appears whole or not at all."""

from __future__ import annotations

import json
import re
import secrets
import shutil
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path

from flightid.errors import FileFormatError, StudyError
from flightid.files import flush, sha256_of_file
from flightid.reading import bounded_bytes, memory_budget, parse_json
from flightid.report.content import Document
from flightid.report.json import from_dict
from flightid.study.owner import OWNER, is_owned, mark_owner

RESULTS = "results.json"
WRITTEN = ".written.json"
"""What a run wrote, so that the next one removes that and nothing else."""
SCHEMA = "flightid.study/1"
GROWTH = 16
"""What JSON takes in memory, by its length in the file."""


@contextmanager
def whole_folder(final: Path, inputs: Iterable[Path] = ()) -> Iterator[Path]:
    """Give a temporary folder that becomes `final` when the block succeeds.

    Of an earlier result of a study at `final` the files that the study wrote go, those that are
    not its own, or were changed since, stay; any other content is refused. On failure or
    interrupt the temporary folder is removed and what stood at `final` stands there still.

    Parameters
    ----------
    final : Path
        Folder to make.
    inputs : iterable of Path
        Files that the study reads: a folder that holds one is refused.

    Yields
    ------
    Path
        Temporary folder beside it.

    Raises
    ------
    StudyError
        `final` holds something that no study wrote, or what this one reads.
    """
    clear_stale(final)
    require_replaceable(final, inputs)
    final.parent.mkdir(parents=True, exist_ok=True)
    temporary = final.with_name(f".{final.name}.{secrets.token_hex(6)}.part")
    temporary.mkdir()
    try:
        mark_owner(temporary)
        yield temporary
        (temporary / OWNER).unlink()
        written = {name: sha256_of_file(file) for name, file in _files(temporary).items()}
        (temporary / WRITTEN).write_text(json.dumps(written, indent=1), encoding="utf-8")
        # Power may go at any line. Files and names of the new folder are on the disk before it has
        # its name, so `final` is the old one or the whole new one, or, between the two renames of
        # `_exchange`, absent beside an `.old` folder that the next run puts back. The parent is
        # flushed before the old folder goes: it must not be gone while the new name is not there.
        for entry in (*_files(temporary).values(), *_folders(temporary)):
            flush(entry)
        _exchange(temporary, final)
    except BaseException:
        shutil.rmtree(temporary, ignore_errors=True)
        raise


def clear_stale(final: Path) -> None:
    """Put right what a killed run left beside a folder; what a living run holds is left alone.

    An `.old` folder without a `final` is the earlier result: it gets its name back. One beside a
    `final` still holds what was to be handed over. A `.part` folder is half a result, and goes.
    """
    pattern = re.compile(rf"\.{re.escape(final.name)}\.[0-9a-f]{{12}}\.(part|old)")
    beside = final.parent.iterdir() if final.parent.is_dir() else ()
    for folder in sorted(beside, key=_age):
        kind = pattern.fullmatch(folder.name)
        if kind is None or folder.is_symlink() or not folder.is_dir() or is_owned(folder):
            continue
        if kind[1] == "old" and not final.exists():
            folder.replace(final)
            continue
        if kind[1] == "old":
            _hand_over(folder, final)
        shutil.rmtree(folder, ignore_errors=True)


def _age(path: Path) -> float:
    """Seconds, negative for the newest, which has the best claim to a name."""
    return -path.lstat().st_mtime


def output_folder(study: Path) -> Path:
    """Where a study writes by default: ``dryer.toml`` and ``dryer-study.toml`` to ``dryer-output``.

    Example
    -------
    >>> output_folder(Path("rig/dryer-study.toml")).as_posix()
    'rig/dryer-output'
    """
    return study.with_name(f"{study.stem.removesuffix('-study')}-output")


def require_replaceable(final: Path, inputs: Iterable[Path] = ()) -> None:
    """Refuse a folder that a study may not replace; call it before the work, not after it.

    Raises
    ------
    StudyError
        `final` holds something that no study wrote, or one of `inputs`.
    """
    place = final.resolve()
    if held := [str(each) for each in inputs if each.resolve().is_relative_to(place)]:
        raise StudyError(
            "the output folder holds what the study reads",
            found=", ".join(held),
            needed="a folder apart from the inputs",
            action="name another folder with --output",
        )
    if not final.exists() or (final.is_dir() and not any(final.iterdir())):
        return
    if final.is_dir() and _is_ours(final / RESULTS) and _written(final) is not None:
        return
    raise StudyError(
        "the output folder holds something else",
        found=str(final),
        needed=f"a new folder, an empty one, or the output of an earlier run with its {WRITTEN}",
        action="name another folder with --output, or remove this one yourself",
    )


def _is_ours(results: Path) -> bool:
    values = _read_json(results)
    return isinstance(values, dict) and values.get("schema") == SCHEMA


def _written(folder: Path) -> dict[str, str] | None:
    """SHA-256 of each file that a run wrote, by its path in the folder; None where no run says."""
    values = _read_json(folder / WRITTEN)
    return values if isinstance(values, dict) else None


def _read_json(path: Path) -> object:
    try:
        content = bounded_bytes(path, memory_budget() // GROWTH)
        return parse_json(content, "a results file", path.name)
    except (OSError, FileFormatError):
        return None


def _files(folder: Path) -> dict[str, Path]:
    files = (entry for entry in sorted(folder.rglob("*")) if entry.is_symlink() or entry.is_file())
    return {file.relative_to(folder).as_posix(): file for file in files}


def _exchange(temporary: Path, final: Path) -> None:
    """Put the new folder in the place of the old; the old one returns if that fails."""
    if not final.exists():
        temporary.replace(final)
        flush(final.parent)
        return
    aside = final.with_name(f".{final.name}.{secrets.token_hex(6)}.old")
    final.replace(aside)
    try:
        temporary.replace(final)
    except BaseException:
        aside.replace(final)
        raise
    flush(final.parent)
    _hand_over(aside, final)
    shutil.rmtree(aside, ignore_errors=True)


def _hand_over(aside: Path, final: Path) -> None:
    """Move the files that are not a run's own into the new folder, beside its own names."""
    written = _written(aside) or {}
    for name, file in _files(aside).items():
        unchanged = not file.is_symlink() and written.get(name) == sha256_of_file(file)
        if unchanged or name == WRITTEN:
            continue
        target, copy = final / name, 0
        while target.exists() or target.is_symlink():
            copy += 1
            target = final / Path(name).with_name(f"{file.stem}.kept{copy}{file.suffix}")
        target.parent.mkdir(parents=True, exist_ok=True)
        file.replace(target)
        flush(target.parent)


def _folders(folder: Path) -> list[Path]:
    return [folder, *(entry for entry in folder.rglob("*") if entry.is_dir())]


def read_report(path: Path) -> Document:
    """Content tree of an earlier run.

    Parameters
    ----------
    path : Path
        Output folder of a study, or its ``results.json``.

    Raises
    ------
    FileFormatError
        The file holds no results of a study.
    """
    results = path / RESULTS if path.is_dir() else path
    content = bounded_bytes(results, memory_budget() // GROWTH)
    values = parse_json(content, "a results file", results.name)
    if not isinstance(values, dict) or values.get("schema") != SCHEMA:
        raise FileFormatError("not a results file", found=str(results), needed=f"schema {SCHEMA}")
    report = values.get("report")
    return from_dict(report if isinstance(report, dict) else {})
