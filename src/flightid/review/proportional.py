"""The part of a flight in which an angle controller is proportional, so that its step is of all."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from flightid.control.autopilots.angle_law import AngleLaw, angle_law
from flightid.control.autopilots.from_log import autopilot_of
from flightid.errors import DataError, FlightidError
from flightid.frozen import dataclass
from flightid.inspection.signals import Span
from flightid.logs import Log
from flightid.record import Record
from flightid.review.deconvolution import closed_loop
from flightid.review.loop_samples import loop_samples
from flightid.review.thresholds import BEYOND, FASTEST_ATTITUDE

Array = NDArray[np.float64]
MOST_ANSWERED_RAD = 10.0
"""Beyond it a loop of all of the flight runs away, and tells no errors."""


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


def excess_of(
    law: AngleLaw,
    axis: str,
    pieces: Sequence[Record],
    expected: Sequence[Array] | None = None,
) -> Excess | None:
    """Where the attitude was farther from its set-point than the controller is proportional to.

    What is left out for errors that were measured is chosen by gusts as well, and steps read from
    the rest would go by them: spans are those of errors that the set-point alone makes expected,
    where that is known.

    Parameters
    ----------
    law : AngleLaw
        See `bounded_law`.
    axis : str
    pieces : sequence of Record
        With channels ``"set_point"`` and ``"measured"``, rad.
    expected : sequence of ndarray, optional
        Error at each sample of each piece that its set-point alone makes, rad.

    Returns
    -------
    Excess or None
        None where errors stayed small.
    """
    spans: list[Span] = []
    most_rad = 0.0
    for place, piece in enumerate(pieces):
        error = _errors(piece)
        most_rad = max(most_rad, float(error.max()))
        chosen = error if expected is None else np.abs(expected[place])
        spans += _runs(piece.time_s, chosen > law.proportional_to_rad)
    if most_rad <= law.proportional_to_rad:
        return None
    return Excess(axis, tuple(spans), most_rad, law)


def expected_errors(pieces: Sequence[Record], pace_s: float) -> list[Array] | None:
    """Errors that the set-point alone makes of the loop as all of the flight tells it, row by row.

    None where the flight does not tell it.

    Parameters
    ----------
    pieces : sequence of Record
        See `excess_of`.
    pace_s : float
        See `closed_loop`.
    """
    samples = loop_samples(pieces, FASTEST_ATTITUDE.value)
    try:
        answers = closed_loop(samples, pace_s=pace_s).answers(samples)
    except FlightidError:
        return None
    if not all(np.abs(each).max() < MOST_ANSWERED_RAD for each in answers):
        return None
    wanted = np.split(samples.set_point, np.cumsum(samples.lengths)[:-1])
    rows = round(samples.sample_time_s / pieces[0].sample_time_s)
    made = []
    for piece, one, other in zip(pieces, wanted, answers, strict=True):
        errors = np.repeat(one - other, rows)
        made.append(np.pad(errors, (0, piece.n_samples - errors.size), mode="edge"))
    return made


def is_proportional(law: AngleLaw, pieces: Sequence[Record]) -> bool:
    """Whether errors in pieces were as small as the controller is proportional to, but for gusts.

    Parameters
    ----------
    law : AngleLaw
    pieces : sequence of Record
        See `excess_of`.
    """
    beyond = np.concatenate([_errors(piece) > law.proportional_to_rad for piece in pieces])
    return bool(beyond.mean() <= BEYOND.value)


def _errors(piece: Record) -> Array:
    error = np.asarray(piece["measured"]) - np.asarray(piece["set_point"])
    return np.asarray(np.abs((error + np.pi) % (2.0 * np.pi) - np.pi))


def _runs(time_s: np.ndarray, marked: np.ndarray) -> list[Span]:
    """Spans of marked samples with the sample before and the one behind."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], marked, [False]]).astype(int)))
    last = time_s.size - 1
    return [
        (float(time_s[max(begin - 1, 0)]), float(time_s[min(end, last)]))
        for begin, end in zip(edges[::2], edges[1::2], strict=True)
    ]
