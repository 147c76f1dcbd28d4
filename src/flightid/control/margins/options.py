"""Options of reading margins; see `flightid.margins`."""

from __future__ import annotations

from dataclasses import dataclass

from flightid.control.margins.loop_source import Given
from flightid.options import Options, option


@dataclass(frozen=True)
class MarginOptions(Options):
    """Which loop, what it is, and what is asked of it.

    Example
    -------
    >>> MarginOptions().phase_guide_deg
    45.0
    """

    inputs: str | None = option(None, doc="Input of the loop, where there are several.")
    outputs: str | None = option(None, doc="Output of the loop, where there are several.")
    given: Given = option(
        "broken", choices=("broken", "closed", "sensitivity"), doc="What the model is of the loop."
    )
    band_rad_s: tuple[float, float] | None = option(
        None, unit="rad/s", above=0.0, doc="Where crossings are looked for; default: by the model."
    )
    unstable_poles: int | None = option(
        None, minimum=0, doc="Of the broken loop, where a response cannot tell; default: counted."
    )
    phase_guide_deg: float = option(45.0, unit="deg", minimum=0.0, doc="Least phase margin.")
    gain_guide_db: float = option(6.0, unit="dB", minimum=0.0, doc="Least gain margin.")
