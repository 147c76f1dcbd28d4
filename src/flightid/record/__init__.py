"""Records: one manoeuvre on one uniform time base, with names, units, roles and history."""

from flightid.record.channel import Channel
from flightid.record.history import Step
from flightid.record.interpolation import Interpolation
from flightid.record.read import read_records
from flightid.record.record import Record
from flightid.record.stamps import StampPolicy
from flightid.record.store import write_records
from flightid.record.timebase import GapPolicy, to_uniform
from flightid.record.uniform_base import UniformBase, UniformSpan

__all__ = [
    "Channel",
    "GapPolicy",
    "Interpolation",
    "Record",
    "StampPolicy",
    "Step",
    "UniformBase",
    "UniformSpan",
    "read_records",
    "to_uniform",
    "write_records",
]
