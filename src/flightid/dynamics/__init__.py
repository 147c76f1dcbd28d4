"""Dynamics: what a model says of the vehicle's motion, and what it is like to fly."""

from flightid.dynamics.handling_qualities import AttitudeBandwidth, attitude_bandwidth
from flightid.dynamics.mode_names import NamedMode
from flightid.dynamics.mode_result import Mode, Modes, Participation
from flightid.dynamics.quantity import Quantity, quantity_table
from flightid.dynamics.spread import Propagated, Spread
from flightid.dynamics.spread_of import spread_of

__all__ = [
    "AttitudeBandwidth",
    "Mode",
    "Modes",
    "NamedMode",
    "Participation",
    "Propagated",
    "Quantity",
    "Spread",
    "attitude_bandwidth",
    "quantity_table",
    "spread_of",
]
