"""flightid: flight logs and rig records to validated flight-dynamics models.

A stage is loaded when its first name is used: add a public name to the three lists below.
"""

import sys
from difflib import get_close_matches
from importlib import import_module
from types import ModuleType
from typing import TYPE_CHECKING

from flightid.version import VERSION as __version__

if TYPE_CHECKING:
    from flightid import conditioning, excitation, fleet, plot, validation
    from flightid.control import loops
    from flightid.control.autopilots.axis_loop import AxisLoop
    from flightid.control.autopilots.from_log import axis_loop_of
    from flightid.control.autopilots.make import axis_loop
    from flightid.control.autopilots.parameter_files import (
        read_parameters,
        write_ardupilot_parameters,
        write_betaflight_settings,
        write_px4_parameters,
    )
    from flightid.control.autopilots.px4_autotune import px4_autotune_gains
    from flightid.control.autopilots.replay import replay
    from flightid.control.autopilots.replay_result import Replay
    from flightid.control.closed_loop.close_loop import close_loop
    from flightid.control.closed_loop.open_loop import open_loop
    from flightid.control.closed_loop.result import ClosedLoop
    from flightid.control.loops.connect import connect
    from flightid.control.loops.interconnection import Interconnection
    from flightid.control.margins.disk_margin import DiskMargin, disk_margin
    from flightid.control.margins.disturbance_rejection import (
        DisturbanceRejection,
        disturbance_rejection,
    )
    from flightid.control.margins.margins import Margins, margins
    from flightid.control.tuning.controller_options import ControllerOptions
    from flightid.control.tuning.pid_design import PidDesign
    from flightid.control.tuning.requirements import TuningRequirements
    from flightid.control.tuning.result import Tuning
    from flightid.control.tuning.tune import tune
    from flightid.control.tuning.tune_controller import tune_controller
    from flightid.control.tuning.tune_pid import tune_pid
    from flightid.dynamics.conditions.compare_conditions import compare_conditions
    from flightid.dynamics.conditions.result import ConditionComparison
    from flightid.dynamics.continuous import to_continuous, to_discrete
    from flightid.dynamics.derivatives.derivatives import DerivativeTable, derivatives
    from flightid.dynamics.handling_qualities.attitude_bandwidth import attitude_bandwidth
    from flightid.dynamics.handling_qualities.handling_qualities import handling_qualities
    from flightid.dynamics.handling_qualities.pilot_cutoff import pilot_cutoff
    from flightid.dynamics.interpretation import Interpretation, interpret
    from flightid.dynamics.lower_order.lower_order import lower_order
    from flightid.dynamics.modes.approximate_modes import approximate_modes
    from flightid.dynamics.modes.modes import modes
    from flightid.dynamics.modes.result import Modes
    from flightid.dynamics.rotor.result import RotorPhysics
    from flightid.dynamics.rotor.rotor_physics import rotor_physics
    from flightid.errors import FlightidError
    from flightid.evidence import Check, Evidence, FeedbackTest, feedback_test
    from flightid.export import ExportFiles
    from flightid.export.to_file import export
    from flightid.findings import Finding
    from flightid.identification import (
        Advice,
        Fit,
        FittedRecord,
        FittedResponse,
        ImpulseResponse,
        LocalMinimum,
        Reduction,
        StructureComparison,
    )
    from flightid.identification.advice.advice import advise
    from flightid.identification.advice.impulse_response import impulse_response
    from flightid.identification.identify import identify
    from flightid.identification.identify_each import identify_each
    from flightid.identification.prediction.predict import predict
    from flightid.identification.prediction.result import Prediction
    from flightid.identification.reduction.reduce import reduce
    from flightid.identification.reduction.structures import compare_structures
    from flightid.inspection import Inspection, inspect_log
    from flightid.logs import Log, LogTable, read_log
    from flightid.models import (
        InnovationsModel,
        LinearSystem,
        ModelBuilder,
        NarxModel,
        NarxStructure,
        Output,
        Parameter,
        Parameters,
        PolynomialModel,
        StateSpaceModel,
        TransferFunction,
        TransferFunctionModel,
        from_control,
        from_scipy,
        library_names,
        load_model,
        read_system,
        to_control,
        to_scipy,
        write_model,
        write_system,
    )
    from flightid.planning import SweepPlan, plan_flight
    from flightid.record import Channel, Record, read_records, write_records
    from flightid.responses import (
        CoherentPairs,
        FrequencyResponse,
        PairResponse,
        estimate_response,
        without_bias,
    )
    from flightid.responses.coherent_pairs import coherent_pairs
    from flightid.responses.response_band import response_band
    from flightid.review import (
        AutotuneReview,
        FlightComparison,
        FlightReview,
        LoopResponse,
        MarginComparison,
        compare_flights,
        compare_margins,
        compare_with_promise,
        review_autotune,
        review_flight,
    )
    from flightid.simulation.noise import Noise
    from flightid.simulation.simulate import simulate
    from flightid.study import Study, run_study
    from flightid.table import Table
    from flightid.uncertainty import Estimate, Uncertain
    from flightid.validation import Comparison, OrderScan, ResidualTests, Verification
    from flightid.validation.order_scan.scan_orders import scan_orders
    from flightid.validation.residuals.residual_tests import residual_tests
    from flightid.validation.verification.verify import verify

# Name -> the module that holds it (a public module is its own home).
# fmt: off
_HOMES = {
    "AxisLoop": "flightid.control.autopilots.axis_loop",
    "Replay": "flightid.control.autopilots.replay_result",
    "axis_loop": "flightid.control.autopilots.make",
    "axis_loop_of": "flightid.control.autopilots.from_log",
    "px4_autotune_gains": "flightid.control.autopilots.px4_autotune",
    "read_parameters": "flightid.control.autopilots.parameter_files",
    "replay": "flightid.control.autopilots.replay",
    "write_ardupilot_parameters": "flightid.control.autopilots.parameter_files",
    "write_betaflight_settings": "flightid.control.autopilots.parameter_files",
    "write_px4_parameters": "flightid.control.autopilots.parameter_files",
    **dict.fromkeys(
        [
            "Advice", "Fit", "FittedRecord", "FittedResponse", "ImpulseResponse", "LocalMinimum",
            "Reduction", "StructureComparison",
        ],
        "flightid.identification",
    ),
    **dict.fromkeys(
        ["Comparison", "OrderScan", "ResidualTests", "Verification", "validation"],
        "flightid.validation",
    ),
    "advise": "flightid.identification.advice.advice",
    "approximate_modes": "flightid.dynamics.modes.approximate_modes",
    "DerivativeTable": "flightid.dynamics.derivatives.derivatives",
    "derivatives": "flightid.dynamics.derivatives.derivatives",
    "impulse_response": "flightid.identification.advice.impulse_response",
    "scan_orders": "flightid.validation.order_scan.scan_orders",
    **dict.fromkeys(
        ["Channel", "Record", "read_records", "write_records"],
        "flightid.record",
    ),
    **dict.fromkeys(
        [
            "CoherentPairs", "FrequencyResponse", "PairResponse", "estimate_response",
            "without_bias",
        ],
        "flightid.responses",
    ),
    "coherent_pairs": "flightid.responses.coherent_pairs",
    "response_band": "flightid.responses.response_band",
    "Estimate": "flightid.uncertainty",
    "Finding": "flightid.findings",
    "Uncertain": "flightid.uncertainty",
    "FlightidError": "flightid.errors",
    **dict.fromkeys(
        [
            "InnovationsModel", "LinearSystem", "ModelBuilder", "NarxModel", "NarxStructure",
            "Output", "Parameter", "Parameters", "PolynomialModel", "StateSpaceModel",
            "TransferFunction", "TransferFunctionModel", "from_control", "from_scipy",
            "library_names", "load_model", "read_system", "to_control", "to_scipy", "write_model",
            "write_system",
        ],
        "flightid.models",
    ),
    "Inspection": "flightid.inspection",
    "Interpretation": "flightid.dynamics.interpretation",
    "attitude_bandwidth": "flightid.dynamics.handling_qualities.attitude_bandwidth",
    "handling_qualities": "flightid.dynamics.handling_qualities.handling_qualities",
    "lower_order": "flightid.dynamics.lower_order.lower_order",
    "pilot_cutoff": "flightid.dynamics.handling_qualities.pilot_cutoff",
    "interpret": "flightid.dynamics.interpretation",
    "to_continuous": "flightid.dynamics.continuous",
    "to_discrete": "flightid.dynamics.continuous",
    "DiskMargin": "flightid.control.margins.disk_margin",
    "disk_margin": "flightid.control.margins.disk_margin",
    "DisturbanceRejection": "flightid.control.margins.disturbance_rejection",
    "disturbance_rejection": "flightid.control.margins.disturbance_rejection",
    "Margins": "flightid.control.margins.margins",
    "margins": "flightid.control.margins.margins",
    "Log": "flightid.logs",
    "LogTable": "flightid.logs",
    "Modes": "flightid.dynamics.modes.result",
    "modes": "flightid.dynamics.modes.modes",
    "ConditionComparison": "flightid.dynamics.conditions.result",
    "compare_conditions": "flightid.dynamics.conditions.compare_conditions",
    "RotorPhysics": "flightid.dynamics.rotor.result",
    "rotor_physics": "flightid.dynamics.rotor.rotor_physics",
    "PidDesign": "flightid.control.tuning.pid_design",
    "ControllerOptions": "flightid.control.tuning.controller_options",
    "TuningRequirements": "flightid.control.tuning.requirements",
    "Tuning": "flightid.control.tuning.result",
    "tune": "flightid.control.tuning.tune",
    "tune_controller": "flightid.control.tuning.tune_controller",
    "tune_pid": "flightid.control.tuning.tune_pid",
    "Study": "flightid.study",
    "Table": "flightid.table",
    "compare_structures": "flightid.identification.reduction.structures",
    "conditioning": "flightid.conditioning",
    "Interconnection": "flightid.control.loops.interconnection",
    "ClosedLoop": "flightid.control.closed_loop.result",
    "close_loop": "flightid.control.closed_loop.close_loop",
    "open_loop": "flightid.control.closed_loop.open_loop",
    "connect": "flightid.control.loops.connect",
    "loops": "flightid.control.loops",
    "excitation": "flightid.excitation",
    "fleet": "flightid.fleet",
    "identify": "flightid.identification.identify",
    "identify_each": "flightid.identification.identify_each",
    "inspect_log": "flightid.inspection",
    **dict.fromkeys(
        ["Check", "Evidence", "FeedbackTest", "feedback_test"],
        "flightid.evidence",
    ),
    "ExportFiles": "flightid.export",
    "Noise": "flightid.simulation.noise",
    "export": "flightid.export.to_file",
    "Prediction": "flightid.identification.prediction.result",
    "plot": "flightid.plot",
    "predict": "flightid.identification.prediction.predict",
    "read_log": "flightid.logs",
    "reduce": "flightid.identification.reduction.reduce",
    "residual_tests": "flightid.validation.residuals.residual_tests",
    "SweepPlan": "flightid.planning",
    "AutotuneReview": "flightid.review",
    "FlightComparison": "flightid.review",
    "FlightReview": "flightid.review",
    "LoopResponse": "flightid.review",
    "MarginComparison": "flightid.review",
    "compare_margins": "flightid.review",
    "plan_flight": "flightid.planning",
    "compare_flights": "flightid.review",
    "compare_with_promise": "flightid.review",
    "review_autotune": "flightid.review",
    "review_flight": "flightid.review",
    "run_study": "flightid.study",
    "simulate": "flightid.simulation.simulate",
    "verify": "flightid.validation.verification.verify",
}
# fmt: on

__all__ = [
    "Advice", "AutotuneReview", "AxisLoop", "Channel", "Check", "ClosedLoop", "CoherentPairs",
    "Comparison", "ConditionComparison", "ControllerOptions", "DerivativeTable", "DiskMargin",
    "DisturbanceRejection", "Estimate", "Evidence", "ExportFiles", "FeedbackTest", "Finding",
    "Fit", "FittedRecord", "FittedResponse", "FlightComparison", "FlightReview", "FlightidError",
    "FrequencyResponse", "ImpulseResponse", "InnovationsModel", "Inspection", "Interconnection",
    "Interpretation", "LinearSystem", "LocalMinimum", "Log", "LogTable", "LoopResponse",
    "MarginComparison", "Margins", "ModelBuilder", "Modes", "NarxModel", "NarxStructure",
    "Noise", "OrderScan",
    "Output", "PairResponse", "Parameter", "Parameters", "PidDesign", "PolynomialModel",
    "Prediction", "Record", "Reduction", "Replay", "ResidualTests", "RotorPhysics",
    "StateSpaceModel", "StructureComparison", "Study", "SweepPlan", "Table", "TransferFunction",
    "TransferFunctionModel", "Tuning", "TuningRequirements", "Uncertain", "Verification",
    "__version__", "advise", "approximate_modes", "attitude_bandwidth", "axis_loop",
    "axis_loop_of", "close_loop", "coherent_pairs", "compare_conditions", "compare_flights",
    "compare_margins", "compare_structures", "compare_with_promise", "conditioning", "connect",
    "derivatives",
    "disk_margin", "disturbance_rejection", "estimate_response", "excitation", "export",
    "feedback_test", "fleet", "from_control", "from_scipy", "handling_qualities", "identify",
    "identify_each", "impulse_response", "inspect_log", "interpret", "library_names",
    "load_model", "loops", "lower_order", "margins", "modes", "open_loop", "pilot_cutoff",
    "plan_flight", "plot", "predict", "px4_autotune_gains", "read_log", "read_parameters",
    "read_records", "read_system", "reduce", "replay", "residual_tests", "response_band",
    "review_autotune", "review_flight", "rotor_physics", "run_study", "scan_orders", "simulate",
    "to_continuous", "to_control",
    "to_discrete", "to_scipy", "tune", "tune_controller", "tune_pid", "validation", "verify",
    "without_bias", "write_ardupilot_parameters", "write_betaflight_settings", "write_model",
    "write_px4_parameters",
    "write_records", "write_system",
]  # fmt: skip


def __getattr__(name: str) -> object:
    if (home := _HOMES.get(name)) is None:
        if name.startswith("_"):  # what tools ask of every module: no spelling to look for
            raise AttributeError(name)
        raise AttributeError(f"module 'flightid' has no attribute {name!r}{_nearest(name)}")
    module = import_module(home)
    is_room = home in (f"flightid.{name}", f"flightid.control.{name}")
    return module if is_room else getattr(module, name)


def _nearest(name: str) -> str:
    """Public names that hold the name or are spelt like it."""
    asked = name.lower()
    holding = [each for each in __all__ if asked in each.lower().split("_")]
    near = dict.fromkeys([*holding, *get_close_matches(name, __all__)])
    return f"; nearest: {', '.join(near)}" if near else "; dir(flightid) lists the names"


def __dir__() -> list[str]:
    return sorted(__all__)


# Keeps a verb where a room has its name: Python binds an imported room to the package.
class _Package(ModuleType):
    def __setattr__(self, name: str, value: object) -> None:
        is_room = isinstance(value, ModuleType) and value.__name__ == f"{__name__}.{name}"
        if not (is_room and name in _HOMES and _HOMES[name] != f"{__name__}.{name}"):
            super().__setattr__(name, value)


sys.modules[__name__].__class__ = _Package
