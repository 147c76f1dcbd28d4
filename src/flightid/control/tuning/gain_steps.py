"""Gains before and after, and the steps between them."""

from __future__ import annotations

from collections.abc import Mapping

from flightid.frozen import dataclass

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
        near = AT_LIMIT * self.high
        return self.new >= self.high - near or self.new <= self.low + near


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
