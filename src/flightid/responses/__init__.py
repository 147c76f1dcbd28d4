"""Frequency responses of records: spectra, conditioning, composite windows, coherence and error."""

from flightid.responses.coherent_pairs import CoherentPairs, coherent_pairs
from flightid.responses.estimate import estimate_response
from flightid.responses.pair import PairResponse
from flightid.responses.response import FrequencyResponse
from flightid.responses.response_band import ResponseIntervals, response_band
from flightid.responses.unbiased import without_bias

__all__ = [
    "CoherentPairs",
    "FrequencyResponse",
    "PairResponse",
    "ResponseIntervals",
    "coherent_pairs",
    "estimate_response",
    "response_band",
    "without_bias",
]
