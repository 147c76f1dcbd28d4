"""Where a log begins on the autopilot's clock, of which every time of it is told."""

from __future__ import annotations

FROM_ZERO_S = 0.05
"""A log that begins earlier than this begins with its clock, s."""


def begins_later(start_s: float) -> bool:
    """Tell whether a log begins at another time than zero, so that zero must be told."""
    return abs(start_s) >= FROM_ZERO_S


def logged_words(start_s: float, duration_s: float) -> str:
    """How long a log is, and where it begins on the clock that all its times are of.

    Example
    -------
    >>> logged_words(24.92, 50.2)
    "50.2 s, from 24.9 to 75.1 s of the autopilot's clock, as all times here"
    >>> logged_words(0.0, 50.2)
    '50.2 s'
    """
    length = f"{duration_s:.1f} s"
    if not begins_later(start_s):
        return length
    span = f"from {start_s:.1f} to {start_s + duration_s:.1f} s"
    return f"{length}, {span} of the autopilot's clock, as all times here"
