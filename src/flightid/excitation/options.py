"""Options of a design; see `flightid.excitation.plan`."""

from __future__ import annotations

from flightid.frozen import dataclass
from flightid.options import Options, option


@dataclass(frozen=True)
class DesignOptions(Options):
    """What a design of an input is asked for.

    Example
    -------
    >>> DesignOptions(band_rad_s=(1.0, 30.0)).n_records
    2
    """

    band_rad_s: tuple[float, float] = option(
        unit="rad/s", above=0.0, doc="Band in which a response is wanted."
    )
    amplitude: float | None = option(
        None, above=0.0, doc="Peak of the input; default: 80 % of the tightest limit."
    )
    duration_s: float | None = option(
        None, unit="s", above=0.0, doc="Length of one record; default: by the band and kind."
    )
    sample_rate_hz: float = option(400.0, unit="Hz", above=0.0, doc="Samples per second.")
    inputs: tuple[str, ...] = option(("u",), doc="Inputs to excite.")
    unit: str = option("1", doc="Unit of the inputs.")
    n_records: int = option(2, minimum=1, doc="Times it is flown.")
    seed: int = option(0, minimum=0, doc="Seed of random parts.")
    axis: int = option(10, minimum=1, maximum=19, doc="SID_AXIS of ArduPilot's chirp.")
