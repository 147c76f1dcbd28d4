"""flightid: flight logs and rig records to validated flight-dynamics models.

The public surface is the names listed in ``__all__``; ARCHITECTURE.md says which stage each one
belongs to. A stage is loaded when its first name is used, so that ``import flightid`` and
``flightid --help`` cost nothing: add a public name to the three lists below (a contract test
compares them).
"""

from importlib import import_module
from typing import TYPE_CHECKING

from flightid.version import VERSION as __version__

if TYPE_CHECKING:
    from flightid import excitation
    from flightid.errors import FlightidError
    from flightid.findings import Finding
    from flightid.logs import Log, LogTable, read_log
    from flightid.record import Channel, Record, read_records, write_records
    from flightid.responses import FrequencyResponse, PairResponse, estimate_response
    from flightid.simulation.simulate import LinearSystem, simulate
    from flightid.table import Table

# Name -> the module that holds it (a public module is its own home).
_HOMES = {
    "Channel": "flightid.record",
    "Finding": "flightid.findings",
    "FlightidError": "flightid.errors",
    "FrequencyResponse": "flightid.responses",
    "LinearSystem": "flightid.simulation.simulate",
    "Log": "flightid.logs",
    "LogTable": "flightid.logs",
    "PairResponse": "flightid.responses",
    "Record": "flightid.record",
    "Table": "flightid.table",
    "estimate_response": "flightid.responses",
    "excitation": "flightid.excitation",
    "read_log": "flightid.logs",
    "read_records": "flightid.record",
    "simulate": "flightid.simulation.simulate",
    "write_records": "flightid.record",
}

__all__ = [
    "Channel",
    "Finding",
    "FlightidError",
    "FrequencyResponse",
    "LinearSystem",
    "Log",
    "LogTable",
    "PairResponse",
    "Record",
    "Table",
    "__version__",
    "estimate_response",
    "excitation",
    "read_log",
    "read_records",
    "simulate",
    "write_records",
]


def __getattr__(name: str) -> object:
    home = _HOMES.get(name)
    if home is None:
        raise AttributeError(f"module 'flightid' has no attribute {name!r}")
    module = import_module(home)
    return module if home == f"flightid.{name}" else getattr(module, name)


def __dir__() -> list[str]:
    return sorted(__all__)
