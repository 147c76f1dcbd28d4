"""Options of a joint fit of responses and records; see `flightid.identify`."""

from __future__ import annotations

from flightid.frozen import dataclass
from flightid.identification.frequency_domain.options import FrequencyDomainOptions, PointOptions
from flightid.identification.records.options import RecordOptions


@dataclass(frozen=True)
class JointOptions(PointOptions, RecordOptions):
    """Options of a joint fit: those of records, and points of the response; see `identify`."""

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
