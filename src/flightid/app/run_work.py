"""What a worker does with a whole study: what `flightid run` does, by the same call."""

from __future__ import annotations

import json
import shutil
import time
from pathlib import Path
from typing import Any

from flightid.app.overview import light_of
from flightid.app.own_folders import is_link
from flightid.app.run_schemas import RunPart
from flightid.app.study_edits import etag_of, parts_of
from flightid.app.study_reach import require_inside
from flightid.app.work import KEPT
from flightid.files import write_atomically
from flightid.report.json import to_dict
from flightid.study.run import run_study

FIGURES = "page-figures.json"


def make_run(study: Path, folder: Path, result: Path) -> None:
    """Run a study into a folder named by its version, and write what the page shows of it."""
    require_inside(study.parent.parent, study)
    text = study.read_text(encoding="utf-8")
    etag = etag_of(text)
    begun = time.perf_counter()
    name = f"run-{etag.strip(chr(34))[:16]}"
    if is_link(folder / name):  # Planted: a run would take, and later delete, what it leads to.
        (folder / name).unlink()
    made = run_study(study, output=folder / name, cache=KEPT)
    figures: list[Any] = []
    tree = to_dict(made.document)
    for section in tree["sections"]:
        _take_figures(section, figures)
    write_atomically(folder / f"{name}-{FIGURES}", json.dumps(figures, allow_nan=False))
    part = RunPart(
        etag=etag,
        parts=parts_of(text),
        folder=name,
        title=made.document.title,
        verdict=light_of(made.document.verdict),
        tally=made.document.tally,
        seconds=time.perf_counter() - begun,
        figures=len(figures),
        sections=tree["sections"],
    )
    write_atomically(result, part.model_dump_json())
    for other in folder.glob("run-*"):
        if not other.name.startswith(name) and other.name != result.name:
            _remove(other)


def _remove(other: Path) -> None:
    """Remove what an earlier run left; of a link, the link alone."""
    if is_link(other) or not other.is_dir():
        other.unlink(missing_ok=True)
    else:
        shutil.rmtree(other, ignore_errors=True)


def _take_figures(section: dict[str, Any], figures: list[Any]) -> None:
    """Put numbers in place of pictures, which the page asks for when they come into sight."""
    for block in section["blocks"]:
        if block["kind"] == "figure":
            figures.append(block.pop("spec"))
            block["number"] = len(figures) - 1
    for inner in section["sections"]:
        _take_figures(inner, figures)
