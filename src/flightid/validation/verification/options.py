"""Options of a verification; see `flightid.verify`."""

from __future__ import annotations

from flightid.frozen import dataclass
from flightid.identification.prediction.request import PredictionOptions
from flightid.options import option
from flightid.record.hold import HOLDS, InputHold


@dataclass(frozen=True)
class VerifyOptions(PredictionOptions):
    """How records are predicted; None leaves an option to the kind of model.

    Example
    -------
    >>> VerifyOptions(horizon=1).given
    {'horizon': 1}
    """

    state_bias: bool | None = option(
        None, doc="Solve for constants on the state derivatives; default: by the kind of model."
    )
    output_bias: bool | None = option(
        None, doc="Solve for constants on the outputs; default: by the kind of model."
    )
    hold: InputHold | None = option(
        None,
        choices=HOLDS,
        doc="What inputs do between samples: default: what records or the fit know.",
    )

    @property
    def given(self) -> dict[str, object]:
        """Options by name without those that are left to the kind of model."""
        return {name: value for name, value in vars(self).items() if value is not None}
