"""Which format a file has, judged by its content; the name only confirms text."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path

from flightid.errors import FileFormatError
from flightid.reading import require_file
from flightid.record.formats.foreign import foreign, is_text, unknown_kind

TEXT_SUFFIXES = {".csv", ".txt", ".tsv", ".dat"}
SNIFFED = 4096
OTHERS = (
    "hand in the autopilot's own log as it lies on the card, or export the data as CSV or Parquet: "
    "flightid inspect FILE shows what either holds"
)
MCAP, ROSBAG, SQLITE = b"\x89MCAP0\r\n", b"#ROSBAG V2.0\n", b"SQLite format 3\x00"
"""First bytes of bags."""
BAG_SUFFIXES = (".mcap", ".db3")
"""Of the files in the folder of a bag."""
HDF5_SIGNATURE = b"\x89HDF\r\n\x1a\n"


class FileFormat(StrEnum):
    """Formats of record files."""

    CSV = "csv"
    PARQUET = "parquet"
    MATLAB = "matlab"
    MATLAB_HDF5 = "matlab-hdf5"
    NETCDF_CLASSIC = "netcdf-classic"
    NETCDF = "netcdf"
    BAG = "ros-bag"


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
    require_file(path)
    if path.is_dir():
        return FileFormat.BAG
    with path.open("rb") as stream:
        head = stream.read(SNIFFED)
    if not head:
        raise FileFormatError(
            f"{path.name} is an empty file",
            needed="an autopilot's log, or records as a table",
            action="copy it again",
        )
    suffix = path.suffix.lower()
    strange = foreign(head)
    found = None if strange else _by_content(head, suffix)
    if found is None:
        if strange is None and is_text(head):
            strange = "text", f"if it is a table, give it a name that ends in .csv, not {suffix!r}"
        what, action = strange or (unknown_kind(head), OTHERS)
        raise FileFormatError(
            f"{path.name} is of no format that holds records or a flight",
            found=what,
            needed="CSV text, Parquet, MATLAB .mat, netCDF, a ROS bag, or an autopilot's log",
            action=action,
        )
    return found


def _by_content(head: bytes, suffix: str) -> FileFormat | None:
    hdf5 = FileFormat.MATLAB_HDF5 if suffix == ".mat" else FileFormat.NETCDF
    # Level 5 MATLAB files begin with a text and end their header with a byte-order mark.
    signs = (
        (head.startswith((MCAP, ROSBAG, SQLITE)), FileFormat.BAG),
        (head[:4] == b"PAR1", FileFormat.PARQUET),
        (head[:4] in (b"CDF\x01", b"CDF\x02", b"CDF\x05"), FileFormat.NETCDF_CLASSIC),
        (head[:8] == HDF5_SIGNATURE, hdf5),
        (head[512:520] == HDF5_SIGNATURE, FileFormat.MATLAB_HDF5),
        (head[:6] == b"MATLAB" or head[126:128] in (b"IM", b"MI"), FileFormat.MATLAB),
        (suffix in TEXT_SUFFIXES and is_text(head), FileFormat.CSV),
    )
    return next((kind for is_met, kind in signs if is_met), None)


def is_bag(path: Path) -> bool:
    """Whether a file or folder is a bag of ROS.

    Parameters
    ----------
    path : Path
    """
    if path.is_dir():
        return any(each.suffix in BAG_SUFFIXES for each in path.iterdir())
    with path.open("rb") as stream:
        return stream.read(len(SQLITE)).startswith((MCAP, ROSBAG, SQLITE))
