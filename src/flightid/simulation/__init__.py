"""Simulation: models driven by records, and a simulated quadrotor with its autopilot."""

from flightid.simulation.actuators import actuator_positions
from flightid.simulation.ardupilot_log import write_ardupilot_log
from flightid.simulation.autopilot import Autopilot, PilotDoublet, RateGains, SidRun
from flightid.simulation.closed_loop import (
    CrudePilot,
    Disturbance,
    FlightConditions,
    fly_closed_loop,
)
from flightid.simulation.flight import Flight, fly
from flightid.simulation.quadrotor import QuadrotorParameters, Sensors, Turbulence
from flightid.simulation.scenario import fly_scenario
from flightid.simulation.simulate import simulate
from flightid.simulation.truth import RateTruth, rate_truth
from flightid.simulation.twin_rotor import TwinRotor
from flightid.simulation.twin_rotor_parameters import Draught, Encoders, TwinRotorParameters

__all__ = [
    "Autopilot",
    "CrudePilot",
    "Disturbance",
    "Draught",
    "Encoders",
    "Flight",
    "FlightConditions",
    "PilotDoublet",
    "QuadrotorParameters",
    "RateGains",
    "RateTruth",
    "Sensors",
    "SidRun",
    "Turbulence",
    "TwinRotor",
    "TwinRotorParameters",
    "actuator_positions",
    "fly",
    "fly_closed_loop",
    "fly_scenario",
    "rate_truth",
    "simulate",
    "write_ardupilot_log",
]
