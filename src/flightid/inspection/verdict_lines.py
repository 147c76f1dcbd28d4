"""Verdicts as lines of a terminal, each with what to do."""

from __future__ import annotations

from collections.abc import Iterable

from flightid.findings import Finding, said_once
from flightid.wrapping import wrapped

WIDTH = 100
"""Letters of a line."""


def verdict_lines(findings: Iterable[Finding]) -> str:
    """Light and message of each finding, each once; an action of several stands with the first."""
    lines = []
    for finding in said_once(findings):
        lines += wrapped(f"{finding.light.words}: {finding.message}", WIDTH, later="    ")
        if finding.action:
            lines += wrapped(f"do: {finding.action}", WIDTH, first="    ", later="        ")
    return "\n".join(lines)
