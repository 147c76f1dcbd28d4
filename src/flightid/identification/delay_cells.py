"""Delays of held inputs that outputs feel at once, and the whole samples at which a cost jumps.

A step that is held and fed straight through moves an output by a whole sample when its delay
passes one. A search that goes by slopes ends in front of such a jump, or just behind one. What a
filter predicts is one sample ahead, where any held step acts through one sample or the next: its
cost has a kink at whole samples, where noises and derivatives settle for a delay that is none.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from flightid.errors import FlightidError
from flightid.frozen import dataclass
from flightid.identification.multistart import End
from flightid.models import GreyBoxModel, StateSpaceModel
from flightid.simulation.model_outputs import systems_of

Array = NDArray[np.float64]
Bounds = tuple[Array, Array]
E = TypeVar("E", bound=End)

DIFFERENCE = 1e-5
"""Relative change of a parameter for derivatives of delays."""
WHOLE = 1e-9
"""Samples by which a delay may miss a whole number of them."""
JUST = 1e-6
"""Samples by which a delay stands clear of the jumps at its ends: on one, cost and slope are of
different sides, and a search stalls."""
ACROSS = 0.01
"""Share of a cell by which the other side of a jump is tried."""
NEAR = 0.02
"""Share of a cell from a jump within which a search may have stumbled at it."""
LOOK = 2
"""Steps of a search across a jump, by which it must be lower to go on there."""
MOST_CROSSINGS = 8
"""Jumps that one search passes in turn."""
LOWER = 1e-9
"""Relative change of a cost that rounding may make."""


@dataclass(frozen=True)
class DelayCells:
    """Where delays may move without a held input reaching another sample.

    Attributes
    ----------
    sample_times_s : tuple of float
        Of the records, each once.
    hold : {"band_limited", "first", "zero"}
    kinks : bool
        Whether delays count that are not fed straight through: of predictions one sample ahead.

    Example
    -------
    >>> from flightid import load_model
    >>> DelayCells((0.02,), "first").around(load_model("rate_first_order")) is None
    True
    """

    sample_times_s: tuple[float, ...]
    hold: str
    kinks: bool = False

    def delays(self, model: GreyBoxModel) -> Array:
        """Delays of held inputs at whose whole samples a cost jumps or has a kink, s."""
        if self.hold != "zero":
            return np.zeros(0)
        systems = systems_of(model)
        if self.kinks:
            return np.concatenate([each.delays_s for each in systems])
        return np.concatenate(
            [each.delays_s[np.any(each.matrices[3] != 0.0, axis=0)] for each in systems]
        )

    def lags(self, model: GreyBoxModel) -> Array:
        """Whole samples that each of these delays reaches back, by sample time."""
        steps = np.array(self.sample_times_s)[:, None]
        return np.asarray(np.ceil(self.delays(model) / steps - WHOLE))

    def around(self, model: GreyBoxModel) -> Bounds | None:
        """Bounds of the free parameters between which no held input reaches another sample.

        None where nothing jumps.
        """
        delays = self.delays(model)
        if not len(delays):
            return None
        steps, last = np.array(self.sample_times_s)[:, None], self.lags(model)
        low = np.max((last - 1.0 + JUST) * steps, axis=0) - delays
        high = np.min((last - JUST) * steps, axis=0) - delays
        free = model.parameters.free
        bounds = np.full((2, len(free)), [[-np.inf], [np.inf]])
        for place in _moving_delays(model):
            value = free[place].value or 0.0
            change = DIFFERENCE * (abs(value) or 1.0)
            moved = self.delays(model.with_values({free[place].name: value + change}))
            slope = (moved - delays) / change
            for each in np.flatnonzero(slope):
                ends = np.sort([low[each] / slope[each], high[each] / slope[each]])
                bounds[0, place] = max(bounds[0, place], value + ends[0])
                bounds[1, place] = min(bounds[1, place], value + ends[1])
        return bounds[0], bounds[1]

    def within(self, limits: Bounds, around: Bounds) -> Bounds:
        """Bounds of a cell inside limits; a limit at a jump leaves of the cell that limit alone."""
        lower = np.maximum(limits[0], around[0])
        return lower, np.maximum(lower, np.minimum(limits[1], around[1]))


def later_by(model: GreyBoxModel, time_s: float) -> Array:
    """Values of the free parameters with all delays longer by so much, as far as they are free.

    Parameters
    ----------
    model : TransferFunctionModel or StateSpaceModel
    time_s : float
        Below zero: shorter. Bounds are kept.

    Returns
    -------
    ndarray, shape (n_free,)

    Raises
    ------
    FlightidError
        Equations without linearisation at their trim.

    Example
    -------
    >>> from flightid import load_model
    >>> model = load_model("rate_first_order")
    >>> (later_by(model, 0.01) - later_by(model, 0.0)).round(6).tolist()
    [0.0, 0.0, 0.01]
    """
    free = model.parameters.free
    values = np.array([parameter.value or 0.0 for parameter in free])
    delays = _delays_of(model)
    slopes = np.zeros((len(delays), len(free)))
    for place in _moving_delays(model):
        change = DIFFERENCE * (abs(values[place]) or 1.0)
        moved = _delays_of(model.with_values({free[place].name: values[place] + change}))
        slopes[:, place] = (moved - delays) / change
    moves = np.linalg.lstsq(slopes, np.full(len(delays), time_s))[0] if slopes.size else 0.0
    lower, upper = (np.array([getattr(p, end) for p in free]) for end in ("minimum", "maximum"))
    return np.asarray(np.clip(values + moves, lower, upper), dtype=np.float64)


def _moving_delays(model: GreyBoxModel) -> Sequence[int]:
    """Places of free parameters that may move a delay."""
    if not isinstance(model, StateSpaceModel):
        return range(len(model.parameters.free))
    values, free = model.parameters.independent_values(), model.parameters.free_indices
    late = np.asarray(model.parameters.tape(model.delays.values()).jacobian(values, free))
    return np.flatnonzero(np.any(late.reshape(-1, len(free)) != 0.0, axis=0)).tolist()


def _delays_of(model: GreyBoxModel) -> Array:
    return np.concatenate([np.ravel(each.delays_s) for each in systems_of(model)])


def beyond_jumps(
    end: E,
    model: GreyBoxModel,
    cells: DelayCells,
    limits: Bounds,
    search: Callable[[E, Array, Bounds, int | None], E | None],
) -> E:
    """The end of a search, or a lower one across jumps beside it.

    Parameters
    ----------
    end : End
        Its first numbers are the free parameters.
    model : TransferFunctionModel or StateSpaceModel
    cells : DelayCells
    limits : tuple of ndarray
        Of the free parameters.
    search : callable
        From an end, with other free parameters, inside bounds, in so many steps or to its end.

    Returns
    -------
    End
        Its steps are those of all searches that led there.
    """
    free = [parameter.name for parameter in model.parameters.free]
    best = end
    seen: set[bytes] = set()
    rounding = LOWER * abs(end.cost)
    for turn in range(MOST_CROSSINGS):
        here = model.with_values(dict(zip(free, map(float, best.x), strict=False)))
        found, inside = best, limits
        for start, bounds in _around(here, cells, limits, seen, own=turn == 0):
            tried = search(best, start, bounds, LOOK)
            if tried is not None and tried.cost < found.cost - rounding:
                found, inside = _after(best, tried), bounds
        if found is best:
            break
        gone_on = search(found, found.x[: len(free)], inside, None)
        # A look ends where its steps do; where the search goes on to the same cost, its end counts.
        best = found
        if gone_on is not None and gone_on.cost <= found.cost + rounding:
            best = _after(found, gone_on)
    return best


def _after(before: E, end: E) -> E:
    """An end, with the steps of the search before it."""
    return replace(end, iterations=before.iterations + end.iterations)


def _around(
    model: GreyBoxModel, cells: DelayCells, limits: Bounds, seen: set[bytes], *, own: bool
) -> Iterator[tuple[Array, Bounds]]:
    """Points just across each jump around a model, with the bounds of their cells.

    The point itself too, where `own` and a jump is so near that steps may have stumbled at it.
    Cells that were `seen` are left out.
    """
    try:
        around = cells.around(model)
    except FlightidError:
        # Equations that have no linearisation at their trim.
        around = None
    if around is None:
        return
    seen.add(cells.lags(model).tobytes())
    low, high = limits
    free = model.parameters.free
    values = np.array([parameter.value or 0.0 for parameter in free])
    with np.errstate(invalid="ignore"):
        apart = np.minimum(values - around[0], around[1] - values) / (around[1] - around[0])
    if own and np.any(apart <= NEAR):
        yield values, cells.within(limits, around)
    for edges, way in zip(around, (-1.0, 1.0), strict=True):
        for place in np.flatnonzero(np.isfinite(edges)):
            there = values.copy()
            width = around[1][place] - around[0][place]
            there[place] = edges[place] + way * ACROSS * width
            if not low[place] <= there[place] <= high[place]:
                continue
            moved = model.with_values({free[place].name: float(there[place])})
            cell, place_of_cell = cells.around(moved), cells.lags(moved).tobytes()
            if cell is not None and place_of_cell not in seen:
                seen.add(place_of_cell)
                yield there, cells.within(limits, cell)
