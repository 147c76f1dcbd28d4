"""Options of handling qualities; see `flightid.handling_qualities`."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

from flightid.dynamics.handling_qualities.handling_qualities import ATTITUDES
from flightid.errors import OptionError
from flightid.frozen import dataclass
from flightid.options import Options, option, options_of

CASES = {
    "rotorcraft": ("speed", "task", "attention"),
    "aeroplane": ("category", "aircraft_class", "n_alpha"),
}
"""Options of one kind of vehicle alone, which its standard asks for."""


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
    axes: Mapping[str, Any] | None = option(
        None, doc="Channels by axis as output/input, roll=p/aileron; default: by usual names."
    )
    signs: Mapping[str, float] | None = option(
        None, doc="-1 for an axis whose control pulls the other way; default: by the phase."
    )
    charts: str | None = option(None, doc="File of charts in place of ours.")

    def __post_init__(self) -> None:
        super().__post_init__()
        for axis in (*(self.axes or {}), *(self.signs or {})):
            if axis not in ATTITUDES:
                raise OptionError("axis is not known", found=axis, needed=", ".join(ATTITUDES))
        for axis, pair in (self.pairs or {}).items():
            if len(pair) != len(("output", "control")):
                raise OptionError(
                    f"channels of {axis} do not fit", found=pair, needed="an output and a control"
                )
        for axis, sign in (self.signs or {}).items():
            if sign not in (1, -1):
                raise OptionError(f"sign of {axis} does not fit", found=sign, needed="1 or -1")

    @property
    def pairs(self) -> dict[str, tuple[str, ...]] | None:
        """Output and control by axis; None: by their usual names."""
        if self.axes is None:
            return None
        parts = {k: v.split("/") if isinstance(v, str) else v for k, v in self.axes.items()}
        return {axis: tuple(pair) for axis, pair in parts.items()}

    def require_case(self, given: Iterable[str]) -> None:
        """Refuse what was given for another kind of vehicle.

        Raises
        ------
        OptionError
            An option that this vehicle's standard does not know.
        """
        for other, names in CASES.items():
            stray = [name for name in names if name in given and other != self.vehicle]
            if stray:
                raise OptionError(
                    f"{stray[0]} is of the standards of vehicle={other!r}",
                    found=f"vehicle={self.vehicle!r}",
                    needed=", ".join(CASES[self.vehicle]),
                )

    def of_verb(self) -> dict[str, Any]:
        """Arguments of `flightid.handling_qualities`."""
        own = {each.name: getattr(self, each.name) for each in options_of(QualitiesOptions)}
        return {**own, "axes": self.pairs}


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
