"""Export of models to other tools."""

from flightid.simulation.export.exported import Exported

__all__ = ["Exported"]
