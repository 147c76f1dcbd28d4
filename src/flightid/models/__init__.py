"""Models: a structure as data, with named parameters (native: `expression.rs`, `transfer.rs`).

State space: `model_tape.rs`, `state_space_response.rs`.
"""

from flightid.models.estimated import EstimateProvenance
from flightid.models.innovations.model import InnovationsModel
from flightid.models.innovations.structure import SubspaceStructure
from flightid.models.interchange import from_control, from_scipy, to_control, to_scipy
from flightid.models.kinds import GreyBoxModel
from flightid.models.language.blocks import ModelBlock
from flightid.models.language.record_values import RecordValue
from flightid.models.language.tables import TableAxis, TableFunction
from flightid.models.linear.linear_system import LinearSystem
from flightid.models.linear.system_files import read_system, write_system
from flightid.models.load import library_names, load_model, load_structure
from flightid.models.model import LinearModel, Model, linear_system, model_of
from flightid.models.narx.model import NarxModel
from flightid.models.narx.structure import NarxStructure
from flightid.models.narx.terms import Lag, Term
from flightid.models.parameters import Parameter, Parameters
from flightid.models.polynomial.model import PolynomialModel
from flightid.models.polynomial.structure import PolynomialStructure
from flightid.models.save import write_model
from flightid.models.state_space.builder import ModelBuilder
from flightid.models.state_space.model import StateSpaceModel
from flightid.models.state_space.parts import Output, ResponsePair, StateSpaceMatrices
from flightid.models.transfer.model import TransferFunction, TransferFunctionModel

__all__ = [
    "EstimateProvenance",
    "GreyBoxModel",
    "InnovationsModel",
    "Lag",
    "LinearModel",
    "LinearSystem",
    "Model",
    "ModelBlock",
    "ModelBuilder",
    "NarxModel",
    "NarxStructure",
    "Output",
    "Parameter",
    "Parameters",
    "PolynomialModel",
    "PolynomialStructure",
    "RecordValue",
    "ResponsePair",
    "StateSpaceMatrices",
    "StateSpaceModel",
    "SubspaceStructure",
    "TableAxis",
    "TableFunction",
    "Term",
    "TransferFunction",
    "TransferFunctionModel",
    "from_control",
    "from_scipy",
    "library_names",
    "linear_system",
    "load_model",
    "load_structure",
    "model_of",
    "read_system",
    "to_control",
    "to_scipy",
    "write_model",
    "write_system",
]
