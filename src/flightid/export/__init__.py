"""Export of models to other tools."""

from flightid.export.exported import Exported

__all__ = ["Exported"]
