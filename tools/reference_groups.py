"""Which page of the reference shows which public name, in the order of the work.

A contract test compares this table with ``flightid.__all__``: a name that is new goes into the
group of its verb, a name that is gone leaves it.
"""

from __future__ import annotations

from typing import NamedTuple


class Group(NamedTuple):
    """One page of the reference."""

    title: str
    guide: str
    """Page of docs/ that tells the same in sentences."""
    names: tuple[str, ...]
    """Public names ``flightid.X``, verbs before the results that they make."""


GROUPS = {
    "data": Group(
        "Get data in",
        "data.md",
        (
            "read_log",
            "Log",
            "LogTable",
            "read_records",
            "write_records",
            "Record",
            "Channel",
            "conditioning",
        ),
    ),
    "inspect": Group(
        "Inspect and plan",
        "inspection.md",
        (
            "inspect_log",
            "Inspection",
            "advise",
            "Advice",
            "feedback_test",
            "FeedbackTest",
            "excitation",
        ),
    ),
    "flight": Group(
        "Flight review",
        "flight.md",
        (
            "review_flight",
            "review_autotune",
            "AutotuneReview",
            "FlightReview",
            "LoopResponse",
            "compare_flights",
            "compare_with_promise",
            "FlightComparison",
            "compare_margins",
            "MarginComparison",
            "plan_flight",
            "SweepPlan",
        ),
    ),
    "responses": Group(
        "Responses",
        "responses.md",
        (
            "estimate_response",
            "FrequencyResponse",
            "coherent_pairs",
            "CoherentPairs",
            "PairResponse",
            "response_band",
            "without_bias",
            "impulse_response",
            "ImpulseResponse",
        ),
    ),
    "models": Group(
        "Models",
        "models.md",
        (
            "load_model",
            "library_names",
            "write_model",
            "ModelBuilder",
            "StateSpaceModel",
            "TransferFunctionModel",
            "PolynomialModel",
            "InnovationsModel",
            "NarxModel",
            "NarxStructure",
            "LinearSystem",
            "TransferFunction",
            "Parameters",
            "Parameter",
            "Output",
        ),
    ),
    "identify": Group(
        "Identify",
        "identify.md",
        (
            "identify",
            "identify_each",
            "Fit",
            "Estimate",
            "Uncertain",
            "FittedResponse",
            "FittedRecord",
            "LocalMinimum",
            "reduce",
            "Reduction",
            "compare_structures",
            "StructureComparison",
            "scan_orders",
            "OrderScan",
        ),
    ),
    "check": Group(
        "Check",
        "verification.md",
        (
            "predict",
            "Prediction",
            "verify",
            "Verification",
            "Comparison",
            "residual_tests",
            "ResidualTests",
            "Evidence",
            "Check",
            "validation",
            "plot",
        ),
    ),
    "use": Group(
        "Use",
        "modes.md",
        (
            "modes",
            "Modes",
            "approximate_modes",
            "derivatives",
            "DerivativeTable",
            "rotor_physics",
            "RotorPhysics",
            "compare_conditions",
            "ConditionComparison",
            "interpret",
            "Interpretation",
            "handling_qualities",
            "attitude_bandwidth",
            "pilot_cutoff",
            "lower_order",
            "simulate",
            "Noise",
        ),
    ),
    "loops": Group(
        "Margins and loops",
        "margins.md",
        (
            "margins",
            "Margins",
            "disk_margin",
            "DiskMargin",
            "disturbance_rejection",
            "DisturbanceRejection",
            "close_loop",
            "ClosedLoop",
            "open_loop",
            "connect",
            "Interconnection",
            "loops",
        ),
    ),
    "study": Group(
        "Studies, results and errors",
        "study.md",
        ("run_study", "Study", "Table", "Finding", "FlightidError"),
    ),
    "fleet": Group("Fleets", "fleet.md", ("fleet",)),
    "gains": Group(
        "Gains",
        "tuning.md",
        (
            "tune_controller",
            "ControllerOptions",
            "tune_pid",
            "PidDesign",
            "tune",
            "Tuning",
            "TuningRequirements",
            "axis_loop",
            "axis_loop_of",
            "AxisLoop",
            "replay",
            "Replay",
            "px4_autotune_gains",
            "read_parameters",
            "write_ardupilot_parameters",
            "write_betaflight_settings",
            "write_px4_parameters",
        ),
    ),
    "export": Group(
        "Export",
        "export.md",
        (
            "export",
            "ExportFiles",
            "write_system",
            "read_system",
            "to_continuous",
            "to_discrete",
            "to_control",
            "from_control",
            "to_scipy",
            "from_scipy",
        ),
    ),
}
