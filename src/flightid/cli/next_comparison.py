"""What ``flightid compare`` leaves unasked of two models, and which models stand behind a log."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from flightid.conventions import Light
from flightid.findings import Finding

if TYPE_CHECKING:
    from flightid.review.flight_state import FlightState

RESULTS = "results.json"
MAXIMUM_RESULTS = 256 << 20
MODEL_SUFFIX = ".toml"
RECORDS = "RECORDS"
"""Stands for records that nothing names."""


def unasked(files: Sequence[str]) -> Finding:
    """That neither predictions nor margins of models were compared, and how they are.

    Parameters
    ----------
    files : sequence of str
        Models as they were named, the base first.

    Returns
    -------
    Finding
        Its action names models and records that are there, so that it can be typed.
    """
    named = " ".join(files)
    margins = f"flightid compare {named} --gains FILE, of margins under gains of `tune`"
    if len(files) != 2:
        return Finding("margins-unasked", Light.UNKNOWN, "margins are not compared", margins)
    first, second = _models(files)
    verify = f"flightid verify {first} {_records(Path(files[1]))} --against {second}"
    return Finding(
        "prediction-unasked",
        Light.UNKNOWN,
        "whether the first predicts what the second was fitted to, and what either does to margins",
        f"{verify}; {margins}",
    )


def _models(files: Sequence[str]) -> Sequence[str]:
    """Files of one model of each side, where a folder holds several; else as they were named."""
    from flightid.models.saved_files import models_of

    folders = [Path(file) for file in files if Path(file).is_dir()]
    if len(folders) < 2:
        return files
    first, second = ({path.name: path for path in models_of(each)} for each in folders)
    if len(first) == len(second) == 1:
        return files
    shared = next((name for name in first if name in second), None)
    return files if shared is None else [str(first[shared]), str(second[shared])]


def _records(results: Path) -> str:
    """Records that a study's results were made of, where they lie beside its folder."""
    from flightid.logs import is_log

    for name in _used(results / RESULTS):
        path = results.parent / name
        if path.suffix != MODEL_SUFFIX and path.is_file() and not is_log(path):
            return str(path)
    return RECORDS


def _used(results: Path) -> dict[str, str]:
    """Names of the files that a study read, with their hashes."""
    files = _part(results, "files")
    return {str(k): str(v) for k, v in files.items()}


def _part(results: Path, name: str) -> dict[str, object]:
    """A part of a study's results; empty where they have none."""
    from flightid.reading import bounded_bytes, parse_json

    if not results.is_file():
        return {}
    content = parse_json(bounded_bytes(results, MAXIMUM_RESULTS), "results", results.name)
    part = content.get(name) if isinstance(content, dict) else None
    return part if isinstance(part, dict) else {}


def flown_for(model: Path) -> FlightState | None:
    """State of the flight that a study's folder, or a model in it, was identified from.

    None where no results stand with it, or they hold no review of a flight.
    """
    from flightid.models.saved_files import MODELS
    from flightid.review.flight_state import FlightState

    folder = model if model.is_dir() else model.parent
    folder = folder.parent if folder.name == MODELS else folder
    review = _part(folder / RESULTS, "review")
    return FlightState.in_results(review) if review else None


def models_made_of(log: Path, folders: Iterable[Path]) -> Path | None:
    """The newest results in these folders whose study read this very log and left models.

    Parameters
    ----------
    log : Path
    folders : iterable of Path
        Where ``*-output`` folders may lie.

    Returns
    -------
    Path or None
    """
    from flightid.files import sha256_of_file
    from flightid.models.saved_files import models_of

    found = {each for folder in folders for each in folder.glob(f"*-output/{RESULTS}")}
    if not found or not log.is_file():
        return None
    wanted = sha256_of_file(log)
    for results in sorted(found, key=lambda path: path.stat().st_mtime, reverse=True):
        if wanted in _used(results).values() and models_of(results.parent):
            return results.parent
    return None
