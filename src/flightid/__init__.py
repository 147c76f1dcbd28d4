"""flightid: flight logs and rig records to validated flight-dynamics models.

The public surface is the names listed in ``__all__``; ARCHITECTURE.md says which stage each one
belongs to.
"""

from flightid.errors import FlightidError
from flightid.findings import Finding
from flightid.record import Channel, Record
from flightid.table import Table
from flightid.version import VERSION as __version__

__all__ = ["Channel", "Finding", "FlightidError", "Record", "Table", "__version__"]
