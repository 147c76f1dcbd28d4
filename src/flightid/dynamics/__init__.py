"""Dynamics: what a model says of the vehicle's motion, and what it is like to fly."""

from flightid.dynamics.conditions.result import (
    ComparedMode,
    ComparedNumber,
    ConditionComparison,
)
from flightid.dynamics.derivatives.derivatives import Derivative, DerivativeTable
from flightid.dynamics.derivatives.nondimensional import FixedWing, Rotorcraft, to_dimensional
from flightid.dynamics.handling_qualities.attitude_bandwidth import attitude_bandwidth
from flightid.dynamics.handling_qualities.handling_qualities import (
    HandlingQualities,
    handling_qualities,
)
from flightid.dynamics.handling_qualities.pilot_cutoff import PilotCutoff, pilot_cutoff
from flightid.dynamics.handling_qualities.rating import Rating, rate
from flightid.dynamics.handling_qualities.rating_charts import RatingChart, Region
from flightid.dynamics.handling_qualities.rating_charts_reading import rating_chart, rating_charts
from flightid.dynamics.handling_qualities.result import AttitudeBandwidth
from flightid.dynamics.lower_order.lower_order import lower_order
from flightid.dynamics.lower_order.result import LowerOrder
from flightid.dynamics.modes.approximate_modes import ApproximateMode, ApproximateModes
from flightid.dynamics.modes.names import NamedMode
from flightid.dynamics.modes.result import Mode, Modes, Participation
from flightid.dynamics.rotor.blades import Blade, effective_lock_number
from flightid.dynamics.rotor.result import RotorFact, RotorPhysics

__all__ = [
    "ApproximateMode",
    "ApproximateModes",
    "AttitudeBandwidth",
    "Blade",
    "ComparedMode",
    "ComparedNumber",
    "ConditionComparison",
    "Derivative",
    "DerivativeTable",
    "FixedWing",
    "HandlingQualities",
    "LowerOrder",
    "Mode",
    "Modes",
    "NamedMode",
    "Participation",
    "PilotCutoff",
    "Rating",
    "RatingChart",
    "Region",
    "RotorFact",
    "RotorPhysics",
    "Rotorcraft",
    "attitude_bandwidth",
    "effective_lock_number",
    "handling_qualities",
    "lower_order",
    "pilot_cutoff",
    "rate",
    "rating_chart",
    "rating_charts",
    "to_dimensional",
]
