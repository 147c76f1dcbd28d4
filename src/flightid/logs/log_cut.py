"""That a file ends inside a record: the flight may have gone on."""

from __future__ import annotations

from flightid.conventions import Light
from flightid.findings import Finding

INSIDE = "the file ends inside"
"""What readers of bytes say of the last range that they could not take."""


def log_cut(record: str) -> Finding:
    """The finding on a file that ends inside a record.

    Parameters
    ----------
    record : str
        What the format calls one.

    Example
    -------
    >>> log_cut("a message").message
    'the file ends inside a message: the log was cut short, or its writing was'
    """
    return Finding(
        "log-cut",
        Light.AMBER,
        f"{INSIDE} {record}: the log was cut short, or its writing was",
        "copy the log from the card again; what came before is read",
    )
