"""Sample time of a new grid for a file whose stamps are not uniform: a proposal."""

from __future__ import annotations

from pathlib import Path

from flightid.errors import DataError
from flightid.frozen import dataclass
from flightid.record.formats.sniff import file_format
from flightid.record.options import RECORD_COLUMN
from flightid.record.rows import manoeuvres
from flightid.record.stamps import rounded_step_s
from flightid.record.tables import read_table
from flightid.record.time_columns import row_stamps, with_time, with_time_unit
from flightid.record.validation import uniform_sample_time


@dataclass(frozen=True)
class GridProposal:
    """A uniform grid for stamps that lie on none.

    Attributes
    ----------
    time_column : str
        Column of the stamps.
    step_s : float
        Their mean spacing in few digits, s.
    time_unit : str
        Unit that the file or the caller tells of them; empty: none, they are s.
    """

    time_column: str
    step_s: float
    time_unit: str = ""


def propose_grid(
    path: str | Path, *, time_column: str | None = None, time_unit: str | None = None
) -> GridProposal | None:
    r"""Sample time that `read_records` may be given as `resample_to_s`.

    Parameters
    ----------
    path : str or Path
        Table of samples.
    time_column, time_unit : str, optional
        As in `read_records`.

    Returns
    -------
    GridProposal or None
        None where stamps are uniform, or where there is no time that all rows share.

    Raises
    ------
    FileFormatError
        The content is of no known format, damaged or too large.

    Example
    -------
    >>> import tempfile
    >>> from flightid.files import write_atomically
    >>> rows = "".join(f"{0.02 * k + 0.001 * (k % 3)},1\n" for k in range(90))
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     propose_grid(write_atomically(Path(folder) / "a.csv", "time,u\n" + rows))
    GridProposal(time_column='time', step_s=0.02, time_unit='')
    """
    source = Path(path)
    table, name = with_time(read_table(source, file_format(source), ()), time_column)
    if name not in table.lengths:
        return None
    units = with_time_unit({}, name, time_unit)
    unit = units.get(name) or table.units.get(name) or ""
    stamps = row_stamps(table, name, units, None)
    label = RECORD_COLUMN if RECORD_COLUMN in table.lengths else None
    for part, _ in manoeuvres(table, label, stamps, split_gaps=True) if stamps.size else ():
        try:
            uniform_sample_time(stamps[part])
        except DataError:
            step = rounded_step_s(stamps[part]) if stamps[part].size > 1 else 0.0
            return GridProposal(name, step, unit) if step > 0.0 else None
    return None
