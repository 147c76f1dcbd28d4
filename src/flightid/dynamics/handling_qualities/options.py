"""Options of handling qualities; see `flightid.handling_qualities`."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from flightid.options import Options, option


@dataclass(frozen=True)
class QualitiesOptions(Options):
    """Which standard, which case of it, and which channels.

    Example
    -------
    >>> QualitiesOptions(axes={"roll": "p/aileron"}).of_verb()["axes"]
    {'roll': ('p', 'aileron')}
    """

    vehicle: str = option(
        "rotorcraft",
        choices=("rotorcraft", "aeroplane"),
        doc="By ADS-33E, or by MIL-F-8785C and MIL-STD-1797A.",
    )
    response_type: str = option(
        "rate", choices=("rate", "attitude"), doc="What a held control settles."
    )
    band_rad_s: tuple[float, float] = option(
        (0.1, 100.0), unit="rad/s", above=0.0, doc="Where bandwidths are looked for."
    )
    speed: str = option("hover", choices=("hover", "forward"), doc="Flight of a rotorcraft.")
    task: str = option(
        "other", choices=("other", "tracking"), doc="Target tracking, or all other tasks."
    )
    attention: str = option(
        "full", choices=("full", "divided"), doc="Divided, or with poor visual cues."
    )
    category: str = option("A", choices=("A", "B", "C"), doc="Flight phase of an aeroplane.")
    aircraft_class: str = option(
        "I", choices=("I", "II", "II-L", "II-C", "III", "IV"), doc="Class of an aeroplane."
    )
    n_alpha: float | None = option(
        None, unit="g/rad", doc="Load factor by angle of attack; default: of the model."
    )
    axes: Mapping[str, str] | None = option(
        None, doc="Channels by axis as output/input, roll=p/aileron; default: by usual names."
    )
    signs: Mapping[str, float] | None = option(
        None, doc="-1 for an axis whose control pulls the other way; default: by the phase."
    )
    charts: str | None = option(None, doc="File of charts in place of ours.")

    def of_verb(self) -> dict[str, Any]:
        """Arguments of `flightid.handling_qualities`."""
        pairs = None
        if self.axes is not None:
            pairs = {axis: tuple(text.split("/")) for axis, text in self.axes.items()}
        return {**vars(self), "axes": pairs}


@dataclass(frozen=True)
class CutoffOptions(Options):
    """Which control, and which of its power counts; see `flightid.pilot_cutoff`.

    Example
    -------
    >>> CutoffOptions(channel="lat").band_rad_s is None
    True
    """

    channel: str = option(doc="Control as the pilot moved it.")
    band_rad_s: tuple[float, float] | None = option(
        None, unit="rad/s", above=0.0, doc="Band whose power counts, above slow trim changes."
    )
