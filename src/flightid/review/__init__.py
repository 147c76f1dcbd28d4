"""Review: what one flight tells of its vehicle, sweeps or none."""

from flightid.review.flight import review_flight
from flightid.review.gyro_noise import GyroNoise, NoisePeak
from flightid.review.loop_response import LoopResponse
from flightid.review.result import FlightReview

__all__ = ["FlightReview", "GyroNoise", "LoopResponse", "NoisePeak", "review_flight"]
