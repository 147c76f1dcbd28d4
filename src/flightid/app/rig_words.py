"""What the screen Records calls the options of a reader: refusals name its fields alone."""

from __future__ import annotations

import re

from flightid.surface import GIVEN, replaced

FIELDS = {
    "time_column": "the role “time” of a column",
    "sample_time_s": "Sample time",
    "resample_to_s": "Resample to",
    "hold": "Inputs between samples",
}
"""By option its field under Columns."""


def as_laid(text: str) -> str:
    """Options of a reader of tables as the fields of the screen.

    Example
    -------
    >>> as_laid("needed time_column=<name of the column> or sample_time_s=<seconds>")
    'needed the role “time” of a column or Sample time'
    >>> as_laid("give resample_to_s=0.02")
    'give Resample to = 0.02'
    """

    def field(found: re.Match[str]) -> str:
        called = FIELDS.get(found["name"])
        if called is None:
            return found[0]
        value = found["value"] or ""
        return called if not value or value[0] in "<…." else f"{called} = {value}"

    return replaced(GIVEN, field, text)
