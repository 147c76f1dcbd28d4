"""Simulation: models run on inputs, at once or step by step."""

from flightid.simulation.actuators import actuator_positions
from flightid.simulation.simulate import simulate

__all__ = ["actuator_positions", "simulate"]
