"""Records: one manoeuvre on one uniform time base, with names, units, roles and history."""

from flightid.record.channel import Channel
from flightid.record.history import Step
from flightid.record.record import Record

__all__ = ["Channel", "Record", "Step"]
