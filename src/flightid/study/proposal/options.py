"""What a study that is written for data is told beside them."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from flightid.frozen import dataclass
from flightid.options import Options, option
from flightid.record.options import ReadOptions
from flightid.study.shape_options import ShapeOptions


@dataclass(frozen=True, kw_only=True)
class DataOptions(ShapeOptions, ReadOptions):
    """How records are read, and what is declared of their inputs.

    Example
    -------
    >>> told(DataOptions(loop="open", time_column="t"))
    {'time_column': 't', 'loop': 'open'}
    """

    @property
    def declared(self) -> dict[str, Any]:
        """What is declared of inputs, by name: logs take that too."""
        return {name: value for name, value in told(self).items() if name in vars(ShapeOptions())}


def told(options: Options) -> dict[str, Any]:
    """Options that are not as usual, by name."""
    usual = vars(type(options)())
    return {name: value for name, value in vars(options).items() if value != usual[name]}


@dataclass(frozen=True)
class ProposalOptions(DataOptions):
    """What a proposal is told; see `flightid.study.proposal.propose_study`.

    Example
    -------
    >>> ProposalOptions(inputs=("u1",)).outputs
    ()
    """

    model: str | None = option(None, doc="Library model or model file in place of the usual one.")
    inputs: tuple[str, ...] = option((), doc="Columns of records that drive.")
    outputs: tuple[str, ...] = option((), doc="Columns of records that answer.")
    excitations: tuple[str, ...] = option(
        (), doc="Columns that were injected ahead of a controller: instruments in a closed loop."
    )
    actuators: Mapping[str, float] = option(
        default_factory=dict, unit="rad/s", doc="Bandwidth of the known actuator behind an input."
    )
