"""Vehicles: simulated ones with their autopilots and logs, whose truth is known."""

from flightid.vehicles.ardupilot_log import write_ardupilot_log
from flightid.vehicles.autopilot import Autopilot, PilotDoublet, RateGains, SidActivation
from flightid.vehicles.flight import Flight, fly
from flightid.vehicles.gain_flight import GainFlightOptions, fly_gains
from flightid.vehicles.gain_flight_result import FlownMargin, GainFlight
from flightid.vehicles.quadrotor import QuadrotorParameters, Sensors, Turbulence
from flightid.vehicles.scenario import fly_scenario
from flightid.vehicles.truth import RateTruth, rate_truth
from flightid.vehicles.twin_rotor import TwinRotor
from flightid.vehicles.twin_rotor_parameters import Draught, Encoders, TwinRotorParameters
from flightid.vehicles.vehicle_loop import (
    CrudePilot,
    Disturbance,
    FlightConditions,
    fly_closed_loop,
)

__all__ = [
    "Autopilot",
    "CrudePilot",
    "Disturbance",
    "Draught",
    "Encoders",
    "Flight",
    "FlightConditions",
    "FlownMargin",
    "GainFlight",
    "GainFlightOptions",
    "PilotDoublet",
    "QuadrotorParameters",
    "RateGains",
    "RateTruth",
    "Sensors",
    "SidActivation",
    "Turbulence",
    "TwinRotor",
    "TwinRotorParameters",
    "fly",
    "fly_closed_loop",
    "fly_gains",
    "fly_scenario",
    "rate_truth",
    "write_ardupilot_log",
]
