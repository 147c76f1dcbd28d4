"""Verdicts as lines of a terminal, each with what to do."""

from __future__ import annotations

from collections.abc import Iterable

from flightid.findings import Finding
from flightid.wrapping import wrapped

WIDTH = 100


def verdict_lines(findings: Iterable[Finding]) -> str:
    """Light and message of each finding; an action that several share stands with the first."""
    given: set[str] = set()
    lines = []
    for finding in findings:
        lines += wrapped(f"{finding.light.words}: {finding.message}", WIDTH, later="    ")
        if finding.action and finding.action not in given:
            given.add(finding.action)
            lines += wrapped(f"do: {finding.action}", WIDTH, first="    ", later="        ")
    return "\n".join(lines)
