"""Where a record that is alone is cut into what is fitted and what stays unseen."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from flightid.record import Record

LEFT = 0.25
"""Part of a record that stays unseen, where every sweep allows that."""
SHORTEST_LEFT = 0.1
"""Part of a record below which what a longer fitted part leaves verifies nothing."""
REST = 0.01
"""Part of a record for which a channel stands still between two sweeps, at the least."""
MOST_OF_SWEEP = 0.7
"""Part of a sweep that counts as the sweep: of one over the whole record a quarter is left."""
AS_LIVELY = 0.5
"""Standard deviation of what is left, of that of the record, from which something moves in it."""

Span = tuple[float, float]


def cut_that_keeps(
    record: Record, moved: Sequence[str], *, rises: bool
) -> tuple[Span, Span] | None:
    """Span that is fitted and the one that stays unseen, s; None: no cut leaves all swept.

    Each channel that moves keeps a sweep in what is fitted. A quarter is left unseen, or what
    the sweeps leave of it.

    Parameters
    ----------
    record : Record
    moved : sequence of str
        Channels of it that move, with sweeps in them.
    rises : bool
        Whether the beginning is left rather than the end, as of a rising sweep.

    Example
    -------
    Two sticks, each swept once, and twice:

    >>> once = np.sin(np.arange(400.0)) * (np.arange(400) % 200 > 20)
    >>> first, second = (np.where((np.arange(400) < 200) == k, once, 0.0) for k in (1, 0))
    >>> flown = Record.from_arrays(np.arange(400.0), inputs={"lat": first, "lon": second})
    >>> cut_that_keeps(flown, ["lat", "lon"], rises=False)
    >>> two = {"lat": [*first, *first], "lon": [*second, *second]}
    >>> flown = Record.from_arrays(np.arange(800.0), inputs=two)
    >>> cut_that_keeps(flown, ["lat", "lon"], rises=False)
    ((0.0, 599.2), (599.2, 799.0))
    """
    time_s = record.time_s
    start, stop = float(time_s[0]), float(time_s[-1])
    sweeps = [[*_sweeps(record[name], time_s)] for name in moved]
    for begins in (rises, not rises):
        share = LEFT if begins else 1.0 - LEFT
        cut = float(f"{start + share * (stop - start):.4g}")
        # A sweep that a cut of a quarter goes through is kept to its end.
        if begins:
            needed = [max(_latest(each, cut)) for each in sweeps]
            cut = min([cut, *needed])
        else:
            needed = [min(_earliest(each, cut)) for each in sweeps]
            cut = max([cut, *needed])
        fitted, left = ((cut, stop), (start, cut)) if begins else ((start, cut), (cut, stop))
        if left[1] - left[0] >= SHORTEST_LEFT * (stop - start) and _lively(record, moved, left):
            return fitted, left
    return None


def _sweeps(samples: NDArray[np.float64], time_s: NDArray[np.float64]) -> Iterator[Span]:
    """Stretches in which a channel moves, between those in which it stands still, s."""
    steps = np.flatnonzero(np.diff(samples))
    rests = np.flatnonzero(np.diff(steps) > REST * samples.size)
    for begin, end in zip([0, *(rests + 1)], [*rests, steps.size - 1], strict=True):
        yield float(time_s[steps[begin]]), float(time_s[steps[end] + 1])


def _earliest(sweeps: Sequence[Span], cut: float) -> Iterator[float]:
    """Where what is fitted may end for each sweep to be in it, s."""
    for begin, end in sweeps:
        held = cut - begin >= MOST_OF_SWEEP * (end - begin)
        yield min(cut, end) if held else end


def _latest(sweeps: Sequence[Span], cut: float) -> Iterator[float]:
    """Where what is fitted may begin for each sweep to be in it, s."""
    for begin, end in sweeps:
        held = end - cut >= MOST_OF_SWEEP * (end - begin)
        yield max(cut, begin) if held else begin


def _lively(record: Record, moved: Sequence[str], span_s: Span) -> bool:
    """Whether something moves in a stretch that models can be verified on."""
    inside = (record.time_s >= span_s[0]) & (record.time_s <= span_s[1])
    names = dict.fromkeys((*moved, *record.inputs))
    told = (record[name] for name in names)
    return any(np.std(each[inside]) >= AS_LIVELY * np.std(each) > 0.0 for each in told)
