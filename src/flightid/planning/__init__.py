"""Planning: from an ordinary log to the flight that can be identified."""

from flightid.planning.plan import plan_flight
from flightid.planning.result import SweepPlan

__all__ = ["SweepPlan", "plan_flight"]
