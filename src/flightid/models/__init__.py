"""Models: a structure as data, with named parameters (native: `expression.rs`, `transfer.rs`)."""

from flightid.models.load import library_names, load_model
from flightid.models.parameters import Parameter, Parameters
from flightid.models.transfer import TransferFunction, TransferFunctionModel

__all__ = [
    "Parameter",
    "Parameters",
    "TransferFunction",
    "TransferFunctionModel",
    "library_names",
    "load_model",
]
