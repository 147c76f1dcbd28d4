"""Identification: a model and data to a fit (native side: `frequency_fit.rs`)."""

from flightid.identification.advice.advice import Advice, advise
from flightid.identification.advice.impulse_response import ImpulseResponse, impulse_response
from flightid.identification.fit import Fit, FittedResponse, LocalMinimum
from flightid.identification.fitted_record import FittedRecord
from flightid.identification.identify import identify
from flightid.identification.narx.result import ChosenTerm, NarxFit
from flightid.identification.prediction_error.result import PolynomialFit
from flightid.identification.reduction.reduce import reduce
from flightid.identification.reduction.result import Reduction, ReductionStep
from flightid.identification.reduction.structures import (
    StructureComparison,
    StructureRow,
    compare_structures,
)
from flightid.identification.subspace.order import OrderChoice
from flightid.identification.subspace.result import InnovationsFit
from flightid.identification.uncertain_of import uncertain_of

__all__ = [
    "Advice",
    "ChosenTerm",
    "Fit",
    "FittedRecord",
    "FittedResponse",
    "ImpulseResponse",
    "InnovationsFit",
    "LocalMinimum",
    "NarxFit",
    "OrderChoice",
    "PolynomialFit",
    "Reduction",
    "ReductionStep",
    "StructureComparison",
    "StructureRow",
    "advise",
    "compare_structures",
    "identify",
    "impulse_response",
    "reduce",
    "uncertain_of",
]
