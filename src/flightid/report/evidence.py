"""Evidence of a fit in a report: its light with the first reason, and every check below."""

from __future__ import annotations

from flightid.evidence import Evidence
from flightid.report.content import Block, Lights, TableBlock


def evidence_blocks(evidence: Evidence) -> tuple[Block, ...]:
    """The light of a fit, and what was examined and what was not.

    Parameters
    ----------
    evidence : Evidence

    Returns
    -------
    tuple of Block
    """
    return (Lights((evidence.verdict,), "Evidence"), TableBlock(evidence.summary(), folded=True))
