"""Review of a flight: what it tells of the vehicle, sweeps or none, and what changed since."""

from flightid.review.autotune.result import AutotuneReview
from flightid.review.autotune.review import review_autotune
from flightid.review.before_after import compare_flights, compare_with_promise
from flightid.review.comparison import FlightComparison
from flightid.review.flight import review_flight
from flightid.review.gyro_noise import GyroNoise, NoisePeak
from flightid.review.loop_response import LoopResponse
from flightid.review.margin_comparison import MarginComparison, compare_margins
from flightid.review.result import FlightReview

__all__ = [
    "AutotuneReview",
    "FlightComparison",
    "FlightReview",
    "GyroNoise",
    "LoopResponse",
    "MarginComparison",
    "NoisePeak",
    "compare_flights",
    "compare_margins",
    "compare_with_promise",
    "review_autotune",
    "review_flight",
]
