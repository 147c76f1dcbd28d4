"""Dynamics: what a model says of the vehicle's motion, and what it is like to fly."""

from flightid.dynamics.eigenvalues import Eigenvalue, eigenvalue_table, eigenvalues_of
from flightid.dynamics.handling_qualities import AttitudeBandwidth, attitude_bandwidth
from flightid.dynamics.quantity import Quantity, quantity_table
from flightid.dynamics.spread import Propagated, Spread
from flightid.dynamics.spread_of import spread_of

__all__ = [
    "AttitudeBandwidth",
    "Eigenvalue",
    "Propagated",
    "Quantity",
    "Spread",
    "attitude_bandwidth",
    "eigenvalue_table",
    "eigenvalues_of",
    "quantity_table",
    "spread_of",
]
