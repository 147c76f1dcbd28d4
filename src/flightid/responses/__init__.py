"""Frequency responses of records: spectra, conditioning, composite windows, coherence and error."""

from flightid.responses.coherent_pairs import CoherentPairs, coherent_pairs
from flightid.responses.estimate import estimate_response
from flightid.responses.pair import PairResponse
from flightid.responses.response import FrequencyResponse

__all__ = [
    "CoherentPairs",
    "FrequencyResponse",
    "PairResponse",
    "coherent_pairs",
    "estimate_response",
]
