"""Evidence: what was examined of data and fit, and what that says of using the result."""

from flightid.evidence.feedback import feedback_test
from flightid.uncertainty.feedback import FeedbackTest

__all__ = ["FeedbackTest", "feedback_test"]
