"""Records: one manoeuvre on one uniform time base, with names, units, roles and history.

The readers and writers of files bring Arrow, HDF5 and SciPy with them (seconds of imports): they
are loaded when first used.
"""

from importlib import import_module
from typing import TYPE_CHECKING

from flightid.record.channel import Channel
from flightid.record.history import Step
from flightid.record.hold import InputHold, InputShape
from flightid.record.interpolation import Interpolation
from flightid.record.record import Record
from flightid.record.stamps import StampPolicy
from flightid.record.timebase import GapPolicy, to_uniform
from flightid.record.uniform_base import UniformBase, UniformSpan

if TYPE_CHECKING:
    from flightid.record.read import read_records
    from flightid.record.store import write_records

_HOMES = {"read_records": "flightid.record.read", "write_records": "flightid.record.store"}

__all__ = [
    "Channel",
    "GapPolicy",
    "InputHold",
    "InputShape",
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


def __getattr__(name: str) -> object:
    home = _HOMES.get(name)
    if home is None:
        raise AttributeError(f"module 'flightid.record' has no attribute {name!r}")
    value: object = getattr(import_module(home), name)
    globals()[name] = value
    return value
