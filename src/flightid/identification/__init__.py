"""Identification: a model and data to a fit (native side: `frequency_fit.rs`)."""

from flightid.identification.fit import Fit, FittedParameter, FittedResponse, LocalMinimum
from flightid.identification.identify import identify
from flightid.identification.narx_fit import ChosenTerm, NarxFit

__all__ = [
    "ChosenTerm",
    "Fit",
    "FittedParameter",
    "FittedResponse",
    "LocalMinimum",
    "NarxFit",
    "identify",
]
