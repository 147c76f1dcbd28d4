"""What a study that is written for data is told beside them."""

from __future__ import annotations

from dataclasses import dataclass

from flightid.options import option
from flightid.record.options import ReadOptions


@dataclass(frozen=True)
class ProposalOptions(ReadOptions):
    """What a proposal is told; see `flightid.study.proposal.propose_study`.

    Example
    -------
    >>> ProposalOptions(inputs=("u1",)).outputs
    ()
    """

    model: str | None = option(None, doc="Library model or model file in place of the usual one.")
    inputs: tuple[str, ...] = option((), doc="Columns of records that drive.")
    outputs: tuple[str, ...] = option((), doc="Columns of records that answer.")
