"""Readers of record files: bytes of a known format to named columns, one file for each format."""

from flightid.record.formats.columns import ColumnTable
from flightid.record.formats.sniff import FileFormat, file_format

__all__ = ["ColumnTable", "FileFormat", "file_format"]
