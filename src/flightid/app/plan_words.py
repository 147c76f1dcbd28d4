"""What the screen Plan calls the options of a plan: its advice names fields, not Python's words."""

from __future__ import annotations

import re

from flightid.surface import GIVEN, replaced

FIELDS = {
    "axes": "the axes",
    "amplitude": "Amplitude",
    "band_rad_s": "From and To",
    "duration_s": "Sweep",
    "n_records": "Sweeps of each axis",
    "rate_rad_s": "Rate at most",
    "attitude_rad": "Attitude at most",
    "loop_rate_hz": "Rate of the loop",
}
"""By option its field; `control` has none, and is a key of the study alone."""


def as_asked(text: str) -> str:
    """Options of a plan as the fields of the screen.

    Example
    -------
    >>> as_asked("say it: loop_rate_hz=…")
    'say it: Rate of the loop, under Asked for'
    """

    def field(found: re.Match[str]) -> str:
        called = FIELDS.get(found["name"])
        return found[0] if called is None else f"{called}, under Asked for"

    return replaced(GIVEN, field, text)
