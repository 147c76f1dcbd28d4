"""Identification: a model and data to a fit (native side: `frequency_fit.rs`)."""

from flightid.identification.advice import Advice, advise
from flightid.identification.fit import Fit, FittedParameter, FittedResponse, LocalMinimum
from flightid.identification.fitted_record import FittedRecord
from flightid.identification.identify import identify
from flightid.identification.impulse_response import ImpulseResponse, impulse_response
from flightid.identification.innovations_fit import InnovationsFit
from flightid.identification.narx_fit import ChosenTerm, NarxFit
from flightid.identification.polynomial_fit import PolynomialFit
from flightid.identification.reduce import reduce
from flightid.identification.reduction import Reduction, ReductionStep
from flightid.identification.structures import (
    StructureComparison,
    StructureRow,
    compare_structures,
)
from flightid.identification.subspace_order import OrderChoice

__all__ = [
    "Advice",
    "ChosenTerm",
    "Fit",
    "FittedParameter",
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
]
