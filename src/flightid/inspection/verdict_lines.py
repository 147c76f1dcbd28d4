"""Verdicts as lines of a terminal, each with what to do."""

from __future__ import annotations

from collections.abc import Iterable
from textwrap import fill

from flightid.findings import Finding

WIDTH = 100


def verdict_lines(findings: Iterable[Finding]) -> str:
    """Light and message of each finding; an action that several share stands with the first."""
    given: set[str] = set()
    lines = []
    for finding in findings:
        lines.append(fill(f"{finding.light}: {finding.message}", WIDTH, subsequent_indent="    "))
        if finding.action and finding.action not in given:
            given.add(finding.action)
            lines.append(
                fill(
                    f"do: {finding.action}",
                    WIDTH,
                    initial_indent="    ",
                    subsequent_indent="        ",
                )
            )
    return "\n".join(lines)
