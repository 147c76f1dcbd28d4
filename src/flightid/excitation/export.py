"""Excitations out of flightid: samples as CSV; settings of autopilots are in `planning`."""

from __future__ import annotations

import csv
import io
from pathlib import Path

from flightid.excitation.excitation import Excitation
from flightid.files import write_atomically


def write_csv(excitation: Excitation, path: str | Path) -> Path:
    """Write stamps and samples as comma-separated values, units in the headings.

    Parameters
    ----------
    excitation : Excitation
        What to write.
    path : str or Path
        File to write, whole or not at all.

    Returns
    -------
    Path
        `path`.

    Raises
    ------
    OSError
        The folder is missing or cannot be written.

    Reference
    ---------
    RFC 4180 (format of comma-separated values).

    Example
    -------
    >>> import tempfile
    >>> from flightid.excitation.multistep import doublet
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     made = doublet(amplitude=0.1, step_s=0.5, sample_rate_hz=50.0)
    ...     write_csv(made, Path(folder) / "doublet.csv").read_text().split()[0]
    'time_s,u'
    """
    sheet = io.StringIO()
    writer = csv.writer(sheet, lineterminator="\n")
    unit = "" if excitation.unit == "1" else f" [{excitation.unit}]"
    writer.writerow(["time_s", *(f"{name}{unit}" for name in excitation.names)])
    for stamp, samples in zip(excitation.time_s, excitation.signals.T, strict=True):
        writer.writerow([f"{stamp:.12g}", *(f"{sample:.12g}" for sample in samples)])
    return write_atomically(path, sheet.getvalue())
