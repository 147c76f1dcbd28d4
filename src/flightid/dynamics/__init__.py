"""Dynamics: what a model says of the vehicle's motion, and what it is like to fly."""

from flightid.dynamics.eigenvalues import Eigenvalue, eigenvalue_table, eigenvalues_of
from flightid.dynamics.handling_qualities import AttitudeBandwidth, attitude_bandwidth

__all__ = [
    "AttitudeBandwidth",
    "Eigenvalue",
    "attitude_bandwidth",
    "eigenvalue_table",
    "eigenvalues_of",
]
