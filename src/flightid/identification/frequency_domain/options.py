"""Options of a fit to frequency responses; see `flightid.identify`."""

from __future__ import annotations

from collections.abc import Mapping

from flightid.errors import OptionError
from flightid.frozen import dataclass
from flightid.options import Options, option
from flightid.simulation.model_outputs import HOLDS

Band = tuple[float, float]
Bands = Band | Mapping[str, Band] | None
COSTS = ("coherence", "likelihood")


@dataclass(frozen=True)
class PointOptions(Options):
    """Which points of responses are fitted, and whether their estimator is taken along."""

    band_rad_s: Bands = option(
        None, unit="rad/s", doc="Band of all responses, or by name; default: the coherent one."
    )
    n_omega: int = option(20, minimum=3, doc="Frequencies of each response.")
    minimum_coherence: float | None = option(
        0.6, minimum=0.0, maximum=1.0, doc="Points with less coherence are left out."
    )
    correct_bias: bool = option(True, doc="Take the estimator's leakage and resolution out.")


@dataclass(frozen=True)
class FrequencyDomainOptions(PointOptions):
    """Options of a frequency-domain fit; see `flightid.identify`."""

    starts: int = option(
        1, minimum=1, doc="Number of starts: the model's values, then a Latin hypercube."
    )
    seed: int = option(0, minimum=0, doc="Seed of the hypercube.")
    weight_gain: float = option(1.0, minimum=0.0, doc="Weight of a squared decibel.")
    weight_phase: float = option(0.01745, minimum=0.0, doc="Weight of a squared degree.")
    cost: str = option(
        "coherence", choices=COSTS, doc="Coherence-weighted squares, or the likelihood."
    )
    maximum_iterations: int = option(200, minimum=1, doc="Most steps of each start.")
    hold: str = option(
        "band_limited", choices=HOLDS, doc="What inputs do between samples, for that correction."
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.weight_gain == 0.0 and self.weight_phase == 0.0:
            raise OptionError("both weights are zero", needed="weight_gain or weight_phase above 0")
