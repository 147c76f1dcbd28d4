"""Records as comma-separated values, for other programs."""

from __future__ import annotations

import csv
import io
from pathlib import Path

from flightid.files import write_atomically
from flightid.record.record import Record
from flightid.units import DIMENSIONLESS


def write_sheet(record: Record, path: str | Path) -> Path:
    """Write stamps and channels of a record as comma-separated values, units in the headings.

    Every number is written so that it is read back as the same number; trims, roles and history
    are left out (`write_records` keeps them).

    Parameters
    ----------
    record : Record
    path : str or Path
        Written whole or not at all.

    Returns
    -------
    Path
        `path`.

    Raises
    ------
    OSError
        The folder is missing or cannot be written.

    Example
    -------
    >>> import tempfile
    >>> record = Record.from_arrays([0.0, 0.5], outputs={"p": [0.1, 0.3]}, units={"p": "rad/s"})
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     print(write_sheet(record, Path(folder) / "flight.csv").read_text())
    time [s],p [rad/s]
    0.0,0.1
    0.5,0.3
    """
    sheet = io.StringIO()
    writer = csv.writer(sheet, lineterminator="\n")
    units = {name: channel.unit for name, channel in record.channels.items()}
    marks = {name: "" if unit == DIMENSIONLESS else f" [{unit}]" for name, unit in units.items()}
    writer.writerow(["time [s]", *(f"{name}{mark}" for name, mark in marks.items())])
    for stamp, *row in zip(record.time_s, *(record[name] for name in units), strict=True):
        writer.writerow([repr(float(stamp)), *(repr(float(value)) for value in row)])
    return write_atomically(path, sheet.getvalue())
