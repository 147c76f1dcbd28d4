"""Which format a file has, judged by its content; the name only confirms text."""

from __future__ import annotations

import codecs
from enum import StrEnum
from pathlib import Path

from flightid.errors import FileFormatError

TEXT_SUFFIXES = {".csv", ".txt", ".tsv", ".dat"}
HDF5_SIGNATURE = b"\x89HDF\r\n\x1a\n"


class FileFormat(StrEnum):
    """Formats of record files."""

    CSV = "csv"
    PARQUET = "parquet"
    MATLAB = "matlab"
    MATLAB_HDF5 = "matlab-hdf5"
    NETCDF_CLASSIC = "netcdf-classic"
    NETCDF = "netcdf"


def file_format(path: Path) -> FileFormat:
    """Format of a file by its first bytes.

    Parameters
    ----------
    path : Path
        The file.

    Raises
    ------
    FileFormatError
        The content is of no known format, or contradicts the suffix.
    OSError
        The file cannot be read.

    Example
    -------
    >>> from flightid.files import write_atomically
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     file_format(write_atomically(Path(folder) / "a.csv", "time,p"))
    <FileFormat.CSV: 'csv'>
    """
    with path.open("rb") as stream:
        head = stream.read(1024)
    suffix = path.suffix.lower()
    found = _by_content(head, suffix)
    if found is None:
        raise FileFormatError(
            f"{path.name} is of no format that holds records",
            found=f"first bytes {head[:8]!r}" if head else "an empty file",
            needed="CSV text, Parquet, MATLAB .mat or netCDF",
            action="read autopilot logs with read_log; export other data as CSV or Parquet",
        )
    return found


def _is_text(head: bytes) -> bool:
    return head[:2] in (codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE) or (
        bool(head) and b"\x00" not in head
    )


def _by_content(head: bytes, suffix: str) -> FileFormat | None:
    hdf5 = FileFormat.MATLAB_HDF5 if suffix == ".mat" else FileFormat.NETCDF
    # Level 5 MATLAB files begin with a text and end their header with a byte-order mark.
    signs = (
        (head[:4] == b"PAR1", FileFormat.PARQUET),
        (head[:4] in (b"CDF\x01", b"CDF\x02", b"CDF\x05"), FileFormat.NETCDF_CLASSIC),
        (head[:8] == HDF5_SIGNATURE, hdf5),
        (head[512:520] == HDF5_SIGNATURE, FileFormat.MATLAB_HDF5),
        (head[:6] == b"MATLAB" or head[126:128] in (b"IM", b"MI"), FileFormat.MATLAB),
        (suffix in TEXT_SUFFIXES and _is_text(head), FileFormat.CSV),
    )
    return next((kind for is_met, kind in signs if is_met), None)
