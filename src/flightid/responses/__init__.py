"""Frequency responses of records: spectra, conditioning, composite windows, coherence and error."""

from flightid.responses.estimate import estimate_response
from flightid.responses.pair import PairResponse
from flightid.responses.response import FrequencyResponse

__all__ = ["FrequencyResponse", "PairResponse", "estimate_response"]
