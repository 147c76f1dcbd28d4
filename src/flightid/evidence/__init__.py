"""Evidence: what was examined of data and fit, and what that says of using the result."""

from flightid.evidence.evidence import Check, Evidence
from flightid.evidence.feedback import feedback_test
from flightid.evidence.gather import (
    gather_evidence,
    inspection_check,
    residual_check,
    sweep_check,
)
from flightid.uncertainty.feedback_result import FeedbackTest

__all__ = [
    "Check",
    "Evidence",
    "FeedbackTest",
    "feedback_test",
    "gather_evidence",
    "inspection_check",
    "residual_check",
    "sweep_check",
]
