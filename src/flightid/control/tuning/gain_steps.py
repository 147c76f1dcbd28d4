"""Gains before and after, and the steps between them."""

from __future__ import annotations

from collections.abc import Mapping

from flightid.frozen import dataclass

GENTLER = 2.0
"""Ratio by which a gain may lie below one that flew below its documented range."""
TIME = "s"
"""Unit of gains that are time constants."""
AT_LIMIT = 1.1e-3
"""Of the range's upper end: with it the least value that a search takes counts as an end."""


@dataclass(frozen=True)
class TunedGain:
    """One parameter before and after.

    Attributes
    ----------
    name, unit : str
        The autopilot's name.
    flown : float or None
        None where nothing has flown.
    new : float
    low, high : float
        Range of the autopilot's documentation.

    Example
    -------
    >>> TunedGain("ATC_RAT_RLL_P", "1/(rad/s)", 0.1, 0.15, 0.01, 0.5).ratio
    1.4999999999999998
    """

    name: str
    unit: str
    flown: float | None
    new: float
    low: float
    high: float

    @property
    def ratio(self) -> float | None:
        """New over flown; None where nothing was flown."""
        return self.new / self.flown if self.flown and self.flown > 0.0 else None

    @property
    def at_limit(self) -> bool:
        """Whether the new value stands at an end of the range."""
        (low, high), near = self.ends, AT_LIMIT * self.high
        return self.new >= high - near or self.new <= low + near

    @property
    def ends(self) -> tuple[float, float]:
        """Of its range, which reaches what flew."""
        return reached(self.low, self.high, self.flown, self.unit)


def reached(low: float, high: float, flown: float | None, unit: str = "") -> tuple[float, float]:
    """A range of the autopilot's documentation, made as wide as to hold what flew.

    Documented ranges are for usual vehicles. One that flew gentler than the gentlest of them may
    have to fly gentler still: there the range reaches one safe step (`GENTLER`) further.

    Parameters
    ----------
    low, high : float
        As documented.
    flown : float or None
    unit : str
        Of the parameter: of a time constant the larger value is the gentler one.

    Example
    -------
    >>> reached(3.0, 12.0, 2.2), reached(3.0, 12.0, 14.0), reached(3.0, 12.0, None)
    ((1.1, 12.0), (3.0, 14.0), (3.0, 12.0))
    >>> reached(0.2, 1.0, 1.4, TIME)
    (0.2, 2.8)
    """
    if flown is None:
        return low, high
    if unit == TIME:
        return min(low, flown), GENTLER * flown if flown > high else high
    return flown / GENTLER if flown < low else low, max(high, flown)


@dataclass(frozen=True)
class Stage:
    """One step of gains on the way.

    Attributes
    ----------
    gains : mapping of str to float
        By the autopilot's names.
    stable : bool
        For every plant that the data allow.
    phase_margin_deg, gain_margin_db : float or None
        Least ones of all loops and plants, at the output.
    """

    gains: Mapping[str, float]
    stable: bool
    phase_margin_deg: float | None
    gain_margin_db: float | None
