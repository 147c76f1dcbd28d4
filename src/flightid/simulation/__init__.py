"""Simulation: models driven by records, and a simulated quadrotor with its autopilot."""

from flightid.simulation.autopilot import Autopilot, PilotDoublet, RateGains, SidRun
from flightid.simulation.flight import Flight, fly
from flightid.simulation.quadrotor import QuadrotorParameters, Sensors, Turbulence
from flightid.simulation.simulate import LinearModel, LinearSystem, simulate
from flightid.simulation.truth import RateTruth, rate_truth

__all__ = [
    "Autopilot",
    "Flight",
    "LinearModel",
    "LinearSystem",
    "PilotDoublet",
    "QuadrotorParameters",
    "RateGains",
    "RateTruth",
    "Sensors",
    "SidRun",
    "Turbulence",
    "fly",
    "rate_truth",
    "simulate",
]
