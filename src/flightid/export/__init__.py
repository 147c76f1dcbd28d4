"""Export of models to other tools."""

from flightid.export.exported import ExportFiles

__all__ = ["ExportFiles"]
