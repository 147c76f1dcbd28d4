"""Two studies side by side in a worker: what `flightid compare` says of the folders of both."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import suppress
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

from flightid.app.overview import light_of
from flightid.dynamics.conditions.result import ConditionComparison
from flightid.errors import DataError, OptionError
from flightid.findings import Finding, worst
from flightid.report.blocks import result_blocks
from flightid.report.content import Block, Document, Section, TableBlock
from flightid.report.figures import figure_block
from flightid.report.json import to_dict
from flightid.review.margin_comparison import MarginComparison
from flightid.study.paired_models import compare_paired
from flightid.surface import speaking


def make_study_comparison(folders: Mapping[str, Path]) -> Mapping[str, Any]:
    """Parameters, modes and, of PIDs that were tuned, margins: each pair of models a section."""
    with speaking(partial(_on_page, folders)):
        conditions, margins = compare_paired(folders)
    said = {str(finding) for each in conditions.values() for finding in each.findings}
    sections = []
    found: list[Finding] = []
    for model, each in conditions.items():
        blocks = [*_of_conditions(each)]
        found += each.findings
        if model in margins:
            own = tuple(f for f in margins[model].findings if str(f) not in said)
            blocks += _of_margins(replace(margins[model], findings=own))
            found += own
        sections.append(Section(model, tuple(blocks)))
    tree = to_dict(Document("Comparison", "", tuple(sections)))
    return {"light": light_of(worst(found)), "sections": tree["sections"]}


def _on_page(folders: Mapping[str, Path], text: str) -> str:
    """A refusal in the page's words: no path of this machine, nothing that only a command takes."""
    for name, folder in folders.items():
        text = text.replace(str(folder), name)
    return text.replace(
        "name the files of two models",
        "give both studies a model of the same name, inputs and outputs, under Model or Records, "
        "and fit again",
    )


def _of_conditions(made: ConditionComparison) -> Iterator[Block]:
    yield from result_blocks(made)
    if made.parameters and made.modes:
        yield TableBlock(made.modes_table())


def _of_margins(made: MarginComparison) -> Iterator[Block]:
    yield from result_blocks(made)
    with suppress(OptionError, DataError):  # Of some margins there is no picture.
        yield figure_block(made.plot(), made.summary().title)
