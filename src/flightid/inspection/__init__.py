"""Inspection: can this log support identification, and what to log or fly instead."""

from flightid.inspection.inspect import inspect_log
from flightid.inspection.inspection import Inspection

__all__ = ["Inspection", "inspect_log"]
