"""Options of conditioning; see `flightid.conditioning`."""

from __future__ import annotations

from typing import Any

from flightid.conditioning.filter import BANDS, Band, FilterDesign
from flightid.errors import OptionError
from flightid.frozen import dataclass
from flightid.options import Options, option


@dataclass(frozen=True)
class OutlierOptions(Options):
    """What counts as an outlier; see `flightid.conditioning.remove_outliers`.

    Example
    -------
    >>> OutlierOptions().deviations
    6.0
    """

    deviations: float = option(6.0, above=0.0, doc="Robust standard deviations beyond which.")
    half_width: int = option(3, minimum=1, doc="Neighbours on each side.")
    channels: tuple[str, ...] | None = option(None, doc="Channels; default: all outputs.")


@dataclass(frozen=True)
class FilterOptions(Options):
    """Band and kind of a filter; see `flightid.conditioning.filter_record`.

    Raises
    ------
    OptionError
        More edges than two.

    Example
    -------
    >>> FilterOptions(cutoff_hz=(20.0,)).of_verb()["cutoff_hz"]
    20.0
    """

    cutoff_hz: float | tuple[float, ...] = option(
        unit="Hz", above=0.0, doc="Edge, or the two edges of a band."
    )
    kind: Band = option(BANDS[0], choices=BANDS, doc="What passes.")
    design: str = option(
        str(FilterDesign.BUTTERWORTH), choices=map(str, FilterDesign), doc="Recursive, or FIR."
    )
    order: int = option(4, minimum=1, doc="Of a Butterworth filter.")
    zero_phase: bool = option(True, doc="Forwards and backwards, without lag.")
    channels: tuple[str, ...] | None = option(None, doc="Channels; default: all alike.")

    def __post_init__(self) -> None:
        super().__post_init__()
        if isinstance(self.cutoff_hz, tuple) and len(self.cutoff_hz) > len(("low", "high")):
            raise OptionError(
                "cutoff_hz does not fit", found=self.cutoff_hz, needed="one number or two"
            )

    def of_verb(self) -> dict[str, Any]:
        """Arguments of `flightid.conditioning.filter_record`."""
        edges = self.cutoff_hz
        one = isinstance(edges, tuple) and len(edges) == 1
        return {**vars(self), "cutoff_hz": edges[0] if one else edges}  # type: ignore[index]
