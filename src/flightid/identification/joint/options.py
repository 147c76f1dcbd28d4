"""Options of a joint fit of responses and records; see `flightid.identify`."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from flightid.identification.frequency_domain.options import Band, FrequencyDomainOptions
from flightid.identification.records.options import RecordOptions
from flightid.options import option


@dataclass(frozen=True)
class JointOptions(RecordOptions):
    """Options of a joint fit: those of records, and points of the response; see `identify`."""

    band_rad_s: Band | Mapping[str, Band] | None = option(
        None, unit="rad/s", doc="Band of all responses, or by name; default: the coherent one."
    )
    n_omega: int = option(20, minimum=3, doc="Frequencies of each response.")
    minimum_coherence: float | None = option(
        0.6, minimum=0.0, maximum=1.0, doc="Points with less coherence are left out."
    )
    correct_bias: bool = option(True, doc="Take the estimator's leakage and resolution out.")

    @property
    def of_responses(self) -> FrequencyDomainOptions:
        """The part that concerns the responses."""
        return FrequencyDomainOptions(
            band_rad_s=self.band_rad_s,
            n_omega=self.n_omega,
            minimum_coherence=self.minimum_coherence,
            cost="likelihood",
            correct_bias=self.correct_bias,
            hold=self.hold,
        )
