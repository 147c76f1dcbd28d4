"""What a study that is written for data is told beside them."""

from __future__ import annotations

from dataclasses import dataclass

from flightid.options import Options, option


@dataclass(frozen=True)
class ProposalOptions(Options):
    """What a proposal is told; see `flightid.study.proposal.propose_study`.

    Example
    -------
    >>> ProposalOptions(inputs=("u1",)).outputs
    ()
    """

    model: str | None = option(None, doc="Library model or model file in place of the usual one.")
    inputs: tuple[str, ...] = option((), doc="Columns of records that drive.")
    outputs: tuple[str, ...] = option((), doc="Columns of records that answer.")
    time_column: str = option("time", doc="Name of the time column of records.")
    sample_time_s: float | None = option(
        None, unit="s", above=0.0, doc="Sample time of records without time column."
    )
    resample_to_s: float | None = option(
        None, unit="s", above=0.0, doc="Sample time of a new uniform grid for records."
    )
