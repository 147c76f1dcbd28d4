"""That a file ends inside a record, as a reader of bytes sees it: not yet what it costs.

Autopilots write in blocks, so a log that the battery ended nearly always ends so. Whether a flight
was cut, `inspection/log_end.py` tells.
"""

from __future__ import annotations

from flightid.conventions import Light
from flightid.findings import Finding

LOG_CUT = "log-cut"
"""Code of the finding."""
INSIDE = "the file ends inside"
"""What readers of bytes say of the last range that they could not take."""


def log_cut(said: str) -> Finding:
    """The finding on a file that its writer did not end, without a light.

    Parameters
    ----------
    said : str
        How it ends, for example ``"the file ends inside a message"``.

    Example
    -------
    >>> print(log_cut(f"{INSIDE} a message"))
    [not judged] the file ends inside a message
    """
    return Finding(LOG_CUT, Light.UNKNOWN, said)
