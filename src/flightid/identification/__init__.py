"""Identification: a model and data to a fit (native side: `frequency_fit.rs`)."""

from flightid.identification.fit import Fit, FittedParameter, FittedResponse, LocalMinimum
from flightid.identification.identify import identify

__all__ = ["Fit", "FittedParameter", "FittedResponse", "LocalMinimum", "identify"]
