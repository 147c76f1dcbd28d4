"""Samples that stand alone and are no damage: edges of commands, and outputs that answer them.

A controller with a derivative throws its output for a few samples where a pilot steps a stick: so
does a rig's quick output where its input steps. Damage is in one channel alone; a command moves
what was measured after it.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from flightid.conventions import Role
from flightid.frozen import dataclass

Array = NDArray[np.float64]
Places = NDArray[np.intp]
Signal = tuple[Array, Array]
"""Stamps, s, and samples, shape (n,) each."""
WITHIN = 12
"""Samples after an edge in which it is answered: the neighbours of `sample_faults`."""
ANSWERED = 5.0
"""Motion after an edge over the median one, from which an output answers it."""
LEAVES, SHARE_LEFT = 3, 0.04
"""Samples after the lone ones in which a controller still has so much of the edge's height."""
FEWEST_WINDOWS = 3
"""Times that window for which an output must be known elsewhere."""
SOON = 3
"""Samples after an edge in which a quick output stands alone."""
EDGE, FEWEST_EDGES, USUAL = 0.5, 2, 0.8
"""Part of the largest step that is an edge too; edges, and share of them that is answered, from
which lone samples of an output are answers."""
STILL = 0.05
"""Motion at an edge itself, over that of its answer, from which the output may have caused it."""


@dataclass(frozen=True)
class Surroundings:
    """What else was recorded when a channel was.

    Attributes
    ----------
    channels : tuple of (Role, time_s, samples)
        Stamps, s, and samples, finite or not.
    """

    channels: tuple[tuple[Role, Array, Array], ...] = ()

    def signals(self, *roles: Role) -> list[Signal]:
        """Channels of some roles, where they are finite: looked at when something stands alone."""
        found = [(t, y, np.isfinite(y) & np.isfinite(t)) for r, t, y in self.channels if r in roles]
        return [(t[known], y[known]) for t, y, known in found if np.count_nonzero(known) > 1]


def answered(command: Signal, alone: Places, outputs: Sequence[Signal]) -> NDArray[np.bool_]:
    """Which lone samples of a command were commanded: they wane, and some output answers them.

    Parameters
    ----------
    command : (time_s, samples)
    alone : ndarray of int, shape (k,)
        Places of samples that stand alone, increasing.
    outputs : sequence of (time_s, samples)

    Returns
    -------
    ndarray of bool, shape (k,)

    Example
    -------
    >>> time_s = 0.01 * np.arange(500)
    >>> kick = np.where(time_s < 2.0, 0.0, 5.0 * 0.2 ** (np.arange(500.0) - 200))
    >>> moved = np.where(time_s > 2.0, 1.0, 0.01 * np.sin(90.0 * time_s))
    >>> answered((time_s, kick), np.array([200]), [(time_s, moved)])
    array([ True])
    >>> answered((time_s, kick), np.array([200]), [(time_s, np.sin(90.0 * time_s))])
    array([False])
    """
    stamps, values = command
    begins = np.concatenate([[True], np.diff(alone) > 1])
    groups = np.split(alone, np.flatnonzero(begins)[1:])
    starts_s = stamps[alone[begins]]
    span_s = WITHIN * float(np.median(np.diff(stamps)))
    found = np.zeros(len(groups), dtype=np.bool_)
    for output in outputs:
        found |= _moves_after(output, starts_s, span_s)
    found &= [_wanes(values, group) for group in groups]
    return np.asarray(found[np.cumsum(begins) - 1])


def _wanes(values: Array, group: Places) -> bool:
    """Whether a command comes back little by little, as through a controller: damage is gone."""
    base = values[max(0, int(group[0]) - 1)]
    height = float(np.max(np.abs(values[group] - base)))
    after = values[group[-1] + 1 : group[-1] + 1 + LEAVES]
    return bool(np.any(np.abs(after - base) >= SHARE_LEFT * height))


def _moves_after(output: Signal, starts_s: Array, span_s: float) -> NDArray[np.bool_]:
    """Whether an output moves after some instants as it does not elsewhere."""
    time_s, values = output
    none = np.zeros(starts_s.size, dtype=np.bool_)
    step_s = float(np.median(np.diff(time_s))) if time_s.size > 1 else 0.0
    if step_s <= 0.0:
        return none
    width = max(2, round(span_s / step_s))
    # The last sample before each edge: what it moves from.
    before = np.searchsorted(time_s, starts_s) - 1
    known = (before >= 0) & (before + width < values.size)
    elsewhere = np.ones(values.size - width, dtype=np.bool_) if width < values.size else none[:0]
    for place in before:
        elsewhere[max(0, place - width) : max(0, place + 2 * width)] = False
    if np.count_nonzero(elsewhere) < FEWEST_WINDOWS * width:
        return none
    motion = _motion(values, width)
    usual = float(np.median(motion[elsewhere]))
    moved = motion[np.clip(before, 0, motion.size - 1)]
    return np.asarray(known & (moved > ANSWERED * usual))


def _motion(values: Array, width: int) -> Array:
    """Farthest that the next samples, so many, lie from each, but the last ones."""
    ahead = np.lib.stride_tricks.sliding_window_view(values[1:], width)
    base = values[: ahead.shape[0]]
    return np.asarray(np.maximum(ahead.max(axis=1) - base, base - ahead.min(axis=1)))


def answers(output: Signal, alone: Places, commands: Sequence[Signal]) -> NDArray[np.bool_]:
    """Which lone samples of an output are its answers to the edges of a command.

    The edges are few and nearly all answered, each just after it; an output that moves with the
    edge may be what a controller answered, and then it is damage.

    Parameters
    ----------
    output : (time_s, samples)
    alone : ndarray of int, shape (k,)
    commands : sequence of (time_s, samples)

    Returns
    -------
    ndarray of bool, shape (k,)

    Example
    -------
    >>> time_s = 0.01 * np.arange(500)
    >>> stepped = np.where(np.arange(500) // 100 % 2, 1.0, -1.0)
    >>> quick = np.concatenate([[0.0], np.diff(stepped)])
    >>> alone = np.flatnonzero(quick)
    >>> answers((time_s, np.roll(quick, 1)), alone + 1, [(time_s, stepped)])
    array([ True,  True,  True,  True])
    >>> answers((time_s, quick), alone, [(time_s, stepped)])
    array([False, False, False, False])
    """
    found = np.zeros(alone.size, dtype=np.bool_)
    for command in commands:
        found |= _follow(output, alone, command)
    return found


def _follow(output: Signal, alone: Places, command: Signal) -> NDArray[np.bool_]:
    time_s, values = output
    none = np.zeros(alone.size, dtype=np.bool_)
    steps = np.abs(np.diff(command[1]))
    if not steps.size or not steps.any():
        return none
    edges_s = command[0][1:][steps >= EDGE * steps.max()]
    span_s = SOON * float(np.median(np.diff(time_s)))
    seldom = edges_s.size * 2 * span_s < EDGE * (time_s[-1] - time_s[0])
    if edges_s.size < FEWEST_EDGES or not seldom:
        return none
    at_s = time_s[alone]
    latest = np.searchsorted(edges_s, at_s, side="left") - 1
    edge_s = edges_s[np.clip(latest, 0, None)]
    soon = (latest >= 0) & (at_s - edge_s <= span_s * (1 + 1e-9))
    place = np.clip(np.searchsorted(time_s, edge_s), 1, time_s.size - 1)
    moved = np.abs(values[place] - values[place - 1])
    still = moved <= STILL * np.abs(values[alone] - values[place - 1])
    explained = soon & still
    share = np.unique(latest[explained]).size / edges_s.size
    return np.asarray(explained if share >= USUAL else none)
