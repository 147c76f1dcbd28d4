"""What is red beside the models, so that a red page does not begin with amber alone."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import replace

from flightid.conventions import Light
from flightid.findings import Finding, worst
from flightid.report.content import Lights, Section

BESIDE = (", reference", ", response")
"""Ends of names of what stands beside a model: it is not what the reader identified."""
MOST = 3
"""Reasons that are named; the others are counted."""


def red_elsewhere(answer: Iterable[Finding], sections: Iterable[Section]) -> tuple[Finding, ...]:
    """Red findings of sections, named by their section, where the answer itself is not red.

    Parameters
    ----------
    answer : iterable of Finding
    sections : iterable of Section
        All but the one of the answer.
    """
    if worst(tuple(answer)) is Light.RED:
        return ()
    found = [each for section in sections for each in _red(section)]
    rest = len(found) - MOST
    more = f"{rest} more red {'reason' if rest == 1 else 'reasons'} below"
    return (*found[:MOST], *([Finding("elsewhere", Light.RED, more)] if rest > 0 else []))


def _red(section: Section) -> Iterator[Finding]:
    if section.title.rstrip("”").endswith(BESIDE):
        return
    for block in section.blocks:
        if isinstance(block, Lights) and not block.repeats:
            for each in block.findings:
                if each.light is Light.RED:
                    yield replace(each, message=f"{section.title}: {each.message}")
    for inner in section.sections:
        yield from _red(inner)
