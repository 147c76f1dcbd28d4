"""What a log holds of one loop, at the rate that its step needs: means of its rows."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np
from numpy.typing import NDArray

from flightid.frozen import dataclass
from flightid.record import Record

Array = NDArray[np.float64]
Piece = tuple[Array, Array, Array | None]
"""Set-point, measured, attitude of one piece of flight, row by row."""


@dataclass(frozen=True, eq=False)
class LoopSamples:
    """A set-point and what followed, piece by piece at one sample time, means removed.

    Attributes
    ----------
    set_point, measured : ndarray, shape (n,)
        In the same unit.
    forerunner : ndarray, shape (n,), or None
        What the set-point was made from, before the filters of `measured`.
    lengths : tuple of int
        Samples of each piece.
    sample_time_s : float
    mean_errors : tuple of float, optional
        Set-point less measured, the mean of each piece; zeros where nobody tells.
    """

    set_point: Array
    measured: Array
    forerunner: Array | None
    lengths: tuple[int, ...]
    sample_time_s: float
    mean_errors: tuple[float, ...] = ()

    @classmethod
    def of(cls, pieces: Iterable[Piece], row_s: float, rows: int) -> LoopSamples:
        """Samples that are the means of so many rows each.

        Set-points jump between samples, wherever a stick or a mode moves them. One row of each
        sample would place a jump up to a sample late, by chance, and what is driven by a misplaced
        input comes out too small: a percent of the level of a loop flown by steps. Means of both
        sides are of the same loop, and a set-point knows of a gust what the attitude in its rows
        does, and no more.

        Parameters
        ----------
        pieces : iterable of tuple
            Set-point, measured, attitude or None, shape (n,) each.
        row_s : float
            Between rows, s.
        rows : int

        Example
        -------
        >>> made = LoopSamples.of([(np.arange(6.0), np.zeros(6), None)], 0.01, 2)
        >>> made.set_point, made.sample_time_s, made.lengths
        (array([-2.,  0.,  2.]), 0.02, (3,))
        """
        step_s, set_points, measured, slopes = rows * row_s, [], [], []
        for wanted, followed, attitude in pieces:
            set_points.append(_means(wanted, rows))
            measured.append(_means(followed, rows))
            if attitude is not None:
                turned = np.diff(_means(attitude, rows)) / step_s
                slopes.append(np.concatenate([[0.0], turned]))
        lengths = tuple(each.size for each in set_points)
        ahead = _joined(slopes) if slopes else None
        both = zip(set_points, measured, strict=True)
        means = tuple(float(one.mean() - other.mean()) for one, other in both)
        return cls(_joined(set_points), _joined(measured), ahead, lengths, step_s, means)

    def sums_of_errors(self) -> Array:
        """Running sum of set-point less measured in each piece, as an integrator has it.

        Of the channels as they are: without its mean the sum of a piece ends where it began, and an
        integrator that took up a slow gust does not.
        """
        ends = np.cumsum(self.lengths)[:-1]
        parts = np.split(self.set_point - self.measured, ends)
        means = self.mean_errors or (0.0,) * len(parts)
        return np.concatenate(
            [np.cumsum(part + mean) for part, mean in zip(parts, means, strict=True)]
        )

    @property
    def duration_s(self) -> float:
        """Seconds in all."""
        return self.sample_time_s * sum(self.lengths)


def loop_samples(pieces: Sequence[Record], fastest_hz: float) -> LoopSamples:
    """Pieces one behind the other, no faster than a step needs.

    Parameters
    ----------
    pieces : sequence of Record
        With channels ``"set_point"``, ``"measured"`` and maybe ``"attitude"``, at one rate.
    fastest_hz : float
    """
    row_s, has = pieces[0].sample_time_s, pieces[0].channels
    signals = (
        (
            np.asarray(piece["set_point"]),
            np.asarray(piece["measured"]),
            np.asarray(piece["attitude"]) if "attitude" in has else None,
        )
        for piece in pieces
    )
    return LoopSamples.of(signals, row_s, max(1, round(1.0 / (row_s * fastest_hz))))


def _means(values: Array, rows: int) -> Array:
    return np.asarray(values[: values.size // rows * rows].reshape(-1, rows).mean(axis=1))


def _joined(parts: list[Array]) -> Array:
    """One behind the other, the mean of each removed."""
    return np.concatenate([part - part.mean() for part in parts])
