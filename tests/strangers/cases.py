"""All conditions, one module a family: a new family adds its module here."""

from __future__ import annotations

from tests.strangers import aircraft, holds, output_error, parts
from tests.strangers.counting import Case

CASES: tuple[Case, ...] = (
    *output_error.CASES,
    *aircraft.CASES,
    *holds.CASES,
    *parts.CASES,
)
