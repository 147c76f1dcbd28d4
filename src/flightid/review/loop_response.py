"""The closed loop of one axis: its step with intervals, or why there is none and what to fly."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from flightid.errors import UnknownNameError
from flightid.frozen import dataclass
from flightid.result import Result
from flightid.review.step_features import creep
from flightid.table import Cell, Column, Table
from flightid.uncertainty.estimate import Reading
from flightid.uncertainty.quantiles import LEVEL, interval_words, shown, tails

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False, repr=False)
class LoopResponse(
    Result, schema="flightid.loop_response/1", untold={"draws": "what `band` is made of"}
):
    """What one loop of one axis does with its set-point, from ordinary flying.

    Attributes
    ----------
    axis, loop : str
        ``"roll"``, ``"pitch"`` or ``"yaw"``; ``"rate"`` or ``"attitude"``.
    set_point, measured : str
        Where they were logged; empty where they were not.
    rate_hz : float
        Samples per second that were used; 0 where nothing was.
    used_s : float
        Seconds of flight used.
    pieces : int
        Unbroken pieces of the flight.
    moved : float or None
        Standard deviation of the set-point where the step was read, rad/s or rad.
    tracking : Estimate or None
        Root mean square of what was measured less the set-point, in the same unit, of all pieces.
    time_s, step : ndarray, shape (n,)
        Answer to a step of the set-point by 1; empty where `reason` says why.
    draws : ndarray, shape (n_draws, n)
        Steps of loops that the data allow as well.
    readings : tuple of Estimate
        Level, delay, rise, overshoot, settling, phase delay, bandwidths.
    reason : str
        Why there is no step.
    action : str
        What to fly or log for one.
    beyond : str
        How far errors went beyond those to which the angle controller is proportional; empty where
        they did not.
    is_bent : bool
        Whether the step holds such moves: it is slower than that of small ones.
    proportional_rad : float or None
        Error up to which the angle controller is proportional, where parameters end it.
    asked : float or None
        Standard deviation of the set-point over the samples of `tracking`, in the same unit.
    fly_in : str
        Mode in which sticks would move this set-point, where the whole flight was by rates; else
        empty.

    Example
    -------
    >>> loop = fid.review_flight("flight.bin")["roll rate"]           # doctest: +SKIP
    >>> loop["rise time"]                                             # doctest: +SKIP
    Estimate(rise time = 0.084 (0.071 to 0.098) s)
    """

    axis: str
    loop: str
    set_point: str
    measured: str
    rate_hz: float
    used_s: float
    pieces: int
    moved: float | None
    tracking: Reading | None
    time_s: Array
    step: Array
    draws: Array
    readings: tuple[Reading, ...] = ()
    reason: str = ""
    action: str = ""
    beyond: str = ""
    is_bent: bool = False
    proportional_rad: float | None = None
    asked: float | None = None
    fly_in: str = ""

    @property
    def name(self) -> str:
        """Axis and loop."""
        return f"{self.axis} {self.loop}"

    @property
    def is_told(self) -> bool:
        """Whether the flight tells a step."""
        return self.step.size > 0

    @property
    def creeps(self) -> str:
        """``"still rises"`` or ``"still falls"`` of a step that does where it ends; else empty."""
        return creep(np.vstack([self.step, self.draws])) if self.is_told else ""

    def __getitem__(self, name: str) -> Reading:
        """Reading by its name, for example ``"rise time"``.

        Raises
        ------
        UnknownNameError
            There is no such reading.
        """
        for reading in self.readings:
            if reading.name == name:
                return reading
        raise UnknownNameError(
            f"the {self.name} loop has no such reading",
            found=name,
            needed="one of " + ", ".join(reading.name for reading in self.readings)
            if self.readings
            else self.reason,
        )

    def band(self, level: float | None = None) -> tuple[Array, Array]:
        """Lower and upper edge of the step's interval at each instant, shape (n,) each.

        Parameters
        ----------
        level : float, optional
            Probability that it holds the truth; default: that of the page, else 0.95.
        """
        low, high = np.quantile(self.draws, tails(shown(level)), axis=0)
        return np.asarray(low), np.asarray(high)

    def summary(self, level: float | None = None) -> Table:
        """Every reading with its interval.

        Parameters
        ----------
        level : float, optional
            Of the intervals; default: that of the page, else 0.95.
        """
        chosen = shown(level)
        around = Column(f"{interval_words(chosen)} interval")
        columns = (Column("what"), Column("value"), Column("unit"), around)
        rows: list[tuple[Cell, ...]] = [
            (r.name, r.value, r.unit, r.range_words(chosen) or r.reason) for r in self.all_readings
        ]
        notes = (self.how, self.reason and f"No step: {self.reason}.", self.action)
        return Table(
            f"Closed loop of {self.name}", columns, tuple(rows), tuple(filter(None, notes))
        )

    @property
    def all_readings(self) -> tuple[Reading, ...]:
        """Readings of the step, then the tracking error in degrees."""
        tracking = (self.tracking,) if self.tracking is not None else ()
        return (*self.readings, *tracking)

    @property
    def how(self) -> str:
        """What was used, in a sentence."""
        if not self.used_s:
            return ""
        pieces = f" in {self.pieces} pieces" if self.pieces > 1 else ""
        large = "" if self.is_bent else ": left out"
        beyond = f" In the flight {self.beyond}{large}." if self.beyond else ""
        return (
            f"{self.set_point} to {self.measured}, {self.used_s:.3g} s{pieces} at "
            f"{self.rate_hz:.3g} Hz.{beyond}"
        )

    def _computed(self) -> dict[str, object]:
        low, high = self.band(LEVEL) if self.is_told else (self.step, self.step)
        return {"lower95": low, "upper95": high}

    def __repr__(self) -> str:
        """Axis, loop and rise time on one line."""
        told = self["rise time"].text if self.readings else self.reason
        return f"LoopResponse({self.name}, rise {told})"
