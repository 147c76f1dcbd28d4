"""Models: a structure as data, with named parameters (native: `expression.rs`, `transfer.rs`).

State space: `model_tape.rs`, `state_space_fit.rs`.
"""

from flightid.models.blocks import Block
from flightid.models.builder import ModelBuilder
from flightid.models.description import Model, SavedModel
from flightid.models.innovations import InnovationsModel
from flightid.models.innovations_prediction import InnovationsPrediction
from flightid.models.interchange import from_control, from_scipy, to_control, to_scipy
from flightid.models.linear_system import LinearModel, LinearSystem
from flightid.models.load import library_names, load_model, load_structure
from flightid.models.narx import NarxEquation, NarxModel, NarxPrediction
from flightid.models.narx_terms import Lag, Term
from flightid.models.parameters import Parameter, Parameters
from flightid.models.polynomial import PolynomialModel
from flightid.models.polynomial_prediction import PolynomialPrediction
from flightid.models.polynomial_structure import PolynomialStructure
from flightid.models.record_values import RecordValue
from flightid.models.save import write_model
from flightid.models.statespace import StateSpaceModel
from flightid.models.statespace_parts import Output, ResponsePair, StateSpaceMatrices
from flightid.models.subspace_structure import SubspaceStructure
from flightid.models.system_files import read_system, write_system
from flightid.models.tables import Axis, TableFunction
from flightid.models.transfer import TransferFunction, TransferFunctionModel

__all__ = [
    "Axis",
    "Block",
    "InnovationsModel",
    "InnovationsPrediction",
    "Lag",
    "LinearModel",
    "LinearSystem",
    "Model",
    "ModelBuilder",
    "NarxEquation",
    "NarxModel",
    "NarxPrediction",
    "Output",
    "Parameter",
    "Parameters",
    "PolynomialModel",
    "PolynomialPrediction",
    "PolynomialStructure",
    "RecordValue",
    "ResponsePair",
    "SavedModel",
    "StateSpaceMatrices",
    "StateSpaceModel",
    "SubspaceStructure",
    "TableFunction",
    "Term",
    "TransferFunction",
    "TransferFunctionModel",
    "from_control",
    "from_scipy",
    "library_names",
    "load_model",
    "load_structure",
    "read_system",
    "to_control",
    "to_scipy",
    "write_model",
    "write_system",
]
