"""Dynamics: what a model says of the vehicle's motion, and what it is like to fly."""

from flightid.dynamics.approximate_modes import ApproximateMode, ApproximateModes
from flightid.dynamics.conditions_result import (
    ComparedMode,
    ComparedNumber,
    ConditionComparison,
)
from flightid.dynamics.derivatives import Derivative, DerivativeTable
from flightid.dynamics.handling_qualities import attitude_bandwidth
from flightid.dynamics.handling_qualities_result import AttitudeBandwidth
from flightid.dynamics.handling_qualities_table import HandlingQualities, handling_qualities
from flightid.dynamics.lower_order import lower_order
from flightid.dynamics.lower_order_result import LowerOrder
from flightid.dynamics.mode_names import NamedMode
from flightid.dynamics.mode_result import Mode, Modes, Participation
from flightid.dynamics.nondimensional import FixedWing, Rotorcraft, to_dimensional
from flightid.dynamics.pilot_cutoff import PilotCutoff, pilot_cutoff
from flightid.dynamics.quantity import Quantity, quantity_table
from flightid.dynamics.rating import Rating, rate
from flightid.dynamics.rating_charts import RatingChart, Region
from flightid.dynamics.rating_charts_reading import rating_chart, rating_charts
from flightid.dynamics.rotor_blades import Blade, effective_lock_number
from flightid.dynamics.rotor_result import RotorFact, RotorPhysics
from flightid.dynamics.spread import Propagated, Spread
from flightid.dynamics.spread_of import spread_of

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
    "Propagated",
    "Quantity",
    "Rating",
    "RatingChart",
    "Region",
    "RotorFact",
    "RotorPhysics",
    "Rotorcraft",
    "Spread",
    "attitude_bandwidth",
    "effective_lock_number",
    "handling_qualities",
    "lower_order",
    "pilot_cutoff",
    "quantity_table",
    "rate",
    "rating_chart",
    "rating_charts",
    "spread_of",
    "to_dimensional",
]
