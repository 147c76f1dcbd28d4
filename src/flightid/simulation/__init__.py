"""Simulation: models driven by records, and a simulated quadrotor with its autopilot."""

from flightid.simulation.simulate import LinearModel, LinearSystem, simulate

__all__ = ["LinearModel", "LinearSystem", "simulate"]
