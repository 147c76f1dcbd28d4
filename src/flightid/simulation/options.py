"""Options of a simulation; see `flightid.simulate`."""

from __future__ import annotations

from collections.abc import Mapping

from flightid.frozen import dataclass
from flightid.models.linear.hold_equivalent import Hold
from flightid.options import Options, option


@dataclass(frozen=True)
class SimulationOptions(Options):
    """How a model is driven over a record.

    Example
    -------
    >>> SimulationOptions(substeps=2).to_dict()["substeps"]
    2
    """

    hold: Hold | None = option(
        None,
        choices=("first", "zero"),
        doc="What inputs do between samples: lines or steps; default: what the record knows.",
    )
    initial_state: Mapping[str, float] | None = option(
        None, doc="State at the first sample, by state; default: rest or trim."
    )
    substeps: int | None = option(
        None, minimum=1, doc="Runge-Kutta steps in a sample, for a nonlinear model."
    )
    input_bias: Mapping[str, float] | None = option(None, doc="Constants added to inputs.")
    output_bias: Mapping[str, float] | None = option(None, doc="Constants added to outputs.")
