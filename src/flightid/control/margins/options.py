"""Options of reading margins of loops, one or several."""

from __future__ import annotations

from flightid.control.margins.disturbance_rejection import PEAK_GUIDE_DB
from flightid.control.margins.loop_source import GIVEN, Given
from flightid.control.margins.matrix_loop import PLACES, At
from flightid.frozen import dataclass
from flightid.options import Options, option

RIGID = (
    "Declares that nothing on the vehicle swings or bends above the band of its model: no "
    "resonance there is allowed for; nothing shows it, and what is promised says so."
)
"""What the declaration means, of every verb on margins."""


@dataclass(frozen=True)
class LoopOptions(Options):
    """Which single loop, and what the model is of it."""

    inputs: str | None = option(None, doc="Input of the loop, where there are several.")
    outputs: str | None = option(None, doc="Output of the loop, where there are several.")
    given: Given = option("broken", choices=GIVEN, doc="What the model is of the loop.")
    band_rad_s: tuple[float, float] | None = option(
        None, unit="rad/s", above=0.0, doc="Frequencies to look at; default: by the model."
    )
    unstable_poles: int | None = option(
        None, minimum=0, doc="Of the broken loop, where a response cannot tell; default: counted."
    )


@dataclass(frozen=True)
class MarginOptions(LoopOptions):
    """Which loop, what it is, and what is asked of it.

    Example
    -------
    >>> MarginOptions().phase_guide_deg
    45.0
    """

    phase_guide_deg: float = option(45.0, unit="deg", minimum=0.0, doc="Least phase margin.")
    gain_guide_db: float = option(6.0, unit="dB", minimum=0.0, doc="Least gain margin.")
    rigid: bool = option(False, doc=RIGID)


@dataclass(frozen=True)
class DiskMarginOptions(Options):
    """Which loops are moved together, and by which disk; see `flightid.disk_margin`.

    Example
    -------
    >>> DiskMarginOptions().at
    'outputs'
    """

    inputs: tuple[str, ...] | None = option(None, doc="Inputs of the loops; default: all.")
    outputs: tuple[str, ...] | None = option(None, doc="Outputs of the loops; default: all.")
    at: At = option("outputs", choices=PLACES, doc="Where loops around a plant are broken.")
    skew: float = option(0.0, doc="Of the disk: 0 balances rise and fall of gains.")
    band_rad_s: tuple[float, float] | None = option(
        None, unit="rad/s", above=0.0, doc="Frequencies to look at; default: by the model."
    )
    unstable_poles: int | None = option(
        None, minimum=0, doc="Of the broken loops, where a response cannot tell; default: counted."
    )


@dataclass(frozen=True)
class DisturbanceOptions(LoopOptions):
    """Which loop, and what is asked of it; see `flightid.disturbance_rejection`.

    Example
    -------
    >>> DisturbanceOptions().peak_guide_db
    5.0
    """

    bandwidth_guide_rad_s: float | None = option(
        None, unit="rad/s", above=0.0, doc="Least bandwidth; default: none, it depends on the task."
    )
    peak_guide_db: float = option(PEAK_GUIDE_DB, unit="dB", doc="Greatest peak.")
    rigid: bool = option(False, doc=RIGID)
