"""The part of a flight in which an angle controller is proportional, so that its step is of all."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from flightid.control.autopilots.angle_law import AngleLaw, angle_law
from flightid.control.autopilots.from_log import autopilot_of
from flightid.errors import DataError
from flightid.frozen import dataclass
from flightid.inspection.signals import Span
from flightid.logs import Log
from flightid.record import Record


@dataclass(frozen=True)
class Excess:
    """Where the error of an attitude was larger than what the controller is proportional to.

    Attributes
    ----------
    axis : str
    spans : tuple of Span
        s on the autopilot's clock.
    most_rad : float
        Largest error.
    law : AngleLaw
    """

    axis: str
    spans: tuple[Span, ...]
    most_rad: float
    law: AngleLaw

    @property
    def words(self) -> str:
        """How large errors became, and where the controller stops to be proportional."""
        errors = self.most_rad, self.law.proportional_to_rad
        most, limit = (f"{math.degrees(each):.2g}" for each in errors)
        return (
            f"errors reached {most} deg, and {self.law.bound} makes the angle controller answer "
            f"less than in proportion beyond {limit} deg"
        )

    @property
    def action(self) -> str:
        """What to fly so that the controller is proportional."""
        limit = math.degrees(self.law.proportional_to_rad)
        return (
            f"fly a minute of quick moves of the {self.axis} stick by {limit:.2g} deg at once, or "
            "less"
        )


def bounded_law(log: Log, axis: str) -> AngleLaw | None:
    """The angle controller of a log, where it stops to be proportional at some error.

    Parameters
    ----------
    log : Log
        Whose parameters count.
    axis : str

    Returns
    -------
    AngleLaw or None
        None where it is proportional to all errors, or nothing tells it.
    """
    try:
        law = angle_law(autopilot_of(log), log.parameters, axis)
    except DataError:
        return None
    return law if law is not None and math.isfinite(law.proportional_to_rad) else None


def excess_of(law: AngleLaw, axis: str, pieces: Sequence[Record]) -> Excess | None:
    """Where the attitude was farther from its set-point than the controller is proportional to.

    Parameters
    ----------
    law : AngleLaw
        See `bounded_law`.
    axis : str
    pieces : sequence of Record
        With channels ``"set_point"`` and ``"measured"``, rad.

    Returns
    -------
    Excess or None
        None where errors stayed small.
    """
    spans: list[Span] = []
    most_rad = 0.0
    for piece in pieces:
        error = np.asarray(piece["measured"]) - np.asarray(piece["set_point"])
        error = np.abs((error + np.pi) % (2.0 * np.pi) - np.pi)
        most_rad = max(most_rad, float(error.max()))
        spans += _runs(piece.time_s, error > law.proportional_to_rad)
    return Excess(axis, tuple(spans), most_rad, law) if spans else None


def _runs(time_s: np.ndarray, marked: np.ndarray) -> list[Span]:
    """Spans of marked samples with the sample before and the one behind."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], marked, [False]]).astype(int)))
    last = time_s.size - 1
    return [
        (float(time_s[max(begin - 1, 0)]), float(time_s[min(end, last)]))
        for begin, end in zip(edges[::2], edges[1::2], strict=True)
    ]
