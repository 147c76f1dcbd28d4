"""Identification: a model and data to a fit (native side: `frequency_fit.rs`)."""

from flightid.identification.advice.advice import Advice, advise
from flightid.identification.advice.impulse_response import ImpulseResponse, impulse_response
from flightid.identification.fit import Fit
from flightid.identification.fitted_record import FittedRecord
from flightid.identification.fitted_response import FittedResponse
from flightid.identification.identify import identify
from flightid.identification.local_minimum import LocalMinimum
from flightid.identification.narx.details import ChosenTerm, NarxDetails
from flightid.identification.prediction_error.details import PolynomialDetails
from flightid.identification.reduction.reduce import reduce
from flightid.identification.reduction.result import Reduction, ReductionStep
from flightid.identification.reduction.structures import (
    StructureComparison,
    StructureRow,
    compare_structures,
)
from flightid.identification.subspace.details import SubspaceDetails
from flightid.identification.subspace.order import OrderChoice
from flightid.identification.uncertain_of import uncertain_of

__all__ = [
    "Advice",
    "ChosenTerm",
    "Fit",
    "FittedRecord",
    "FittedResponse",
    "ImpulseResponse",
    "LocalMinimum",
    "NarxDetails",
    "OrderChoice",
    "PolynomialDetails",
    "Reduction",
    "ReductionStep",
    "StructureComparison",
    "StructureRow",
    "SubspaceDetails",
    "advise",
    "compare_structures",
    "identify",
    "impulse_response",
    "reduce",
    "uncertain_of",
]
