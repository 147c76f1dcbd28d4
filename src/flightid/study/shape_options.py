"""What a table of a study says of the inputs between samples, their repetition and the loop."""

from __future__ import annotations

from dataclasses import fields

from flightid.frozen import dataclass
from flightid.options import Options, option
from flightid.record.hold import HOLDS, LOOPS, InputShape


@dataclass(frozen=True, kw_only=True)
class ShapeOptions(Options):
    """What a table says of the inputs between samples, their repetition and the loop."""

    hold: str | None = option(None, choices=HOLDS, doc="Inputs between samples.")
    period_s: float | None = option(
        None, unit="s", above=0.0, doc="Time after which the inputs repeat exactly."
    )
    loop: str | None = option(
        None, choices=LOOPS, doc="Whether a loop was closed; default: a test decides."
    )

    @property
    def shape(self) -> InputShape:
        """The same as a record knows it."""
        return InputShape(**{each.name: getattr(self, each.name) for each in fields(InputShape)})
