"""How many samples pass before each input acts: structures with every delay, compared on the data.

A pulse response tells a delay only where the input is white. Here a few poles stand for the
response and the noise is whitened, so that slow, periodic and band-limited inputs tell it too.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np
import scipy
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

from flightid.evidence.feedback import loop_seen
from flightid.frozen import dataclass
from flightid.identification.advice.delayed_output_error import (
    DelayedSignals,
    Ended,
    criterion,
    output_error,
    refined,
)
from flightid.identification.prediction_error.linear_regression import regress
from flightid.models.sampled.channels import SampledChannels, gather_channels
from flightid.record import Record

Array = NDArray[np.float64]
LEVEL = 0.01
"""Share of inputs without effect that are said to act."""
PAST = (2, 4, 8, 16)
"""Coefficients of A in the first scan."""
WINDOW = (2, 4, 8)
"""Coefficients of B in the first scan."""
POLES = (1, 2, 3)
"""Orders of the second scan."""
COARSE = 4
"""Samples between delays that output-error structures try before those around the best."""
AROUND = 4
"""Delays on either side of the best of these that are tried one by one."""
NEAR = 0.1
"""Share by which squares of a first search may lie above the least for its minimum to be sought."""
LONG = 40
MOST_SAMPLES = 6_000
"""The second scan takes the first records up to so many samples."""
UNCERTAIN = 10.0
"""Difference of twice the log likelihood above which a delay is refused: odds of 1 to 150."""
WIDE = 2
"""Most samples between the ends of a range for its best value to be told."""
LONGEST = 39
"""Longest delay that is looked for before a scan, samples."""
BEFORE, BEHIND = 2, 1
"""Delays of a scan on either side of what the data do not refuse: weak first samples drown."""
UNTOLD = (1, 2, 3)
"""Delays of a scan where no effect stands out, or a controller's may."""


@dataclass(frozen=True)
class InputDelay:
    """Samples until an input acts.

    Attributes
    ----------
    samples : int or None
        None where no effect stands out, or the data leave more than a sample either way.
    interval : tuple of int or None
        Smallest and largest delay that the data do not refuse; None without an effect.

    Example
    -------
    >>> InputDelay.of(5, [4, 5, 6]).samples, InputDelay.of(5, [3, 4, 5, 6]).samples
    (5, None)
    """

    samples: int | None = None
    interval: tuple[int, int] | None = None

    @classmethod
    def of(cls, best: int, alike: Sequence[int]) -> InputDelay:
        """The best delay among those that do about as well."""
        low, high = min(alike), max(alike)
        return cls(best if high - low <= WIDE else None, (low, high))


def find_delays(data: SampledChannels, largest: int) -> list[InputDelay]:
    """Delay of each input.

    ARX structures of all orders and delays are compared from one triangle by the Bayesian
    information criterion. Where an input moves in a narrow band they take almost any delay: a
    few of all delays beside the best are compared by output-error structures on whitened signals,
    then those about the best of them.

    Parameters
    ----------
    data : SampledChannels
        Means removed.
    largest : int
        Longest delay to try, samples.

    Returns
    -------
    list of InputDelay
        With the delays that do almost as well as the best.

    Assumes
    -------
    Few poles; where they leave more than noise, as of modes that stiffen, ranges are as much wider,
    and a delay may still be told wrong. A response whose first samples drown in noise is said to
    begin later.

    Reference
    ---------
    Björklund & Ljung, "A review of time-delay estimation techniques", *IEEE CDC* 2003 (section 4.2,
    explicit one-parameter methods in the time domain); McCullagh & Nelder, *Generalized Linear
    Models*, 2nd ed., section 4.5 (what is more than noise); Steiglitz & McBride (1965),
    IEEE Trans. AC 10.
    """
    scan = _ArxScan.of(data, largest)
    acts = [scan.acts(place) for place in range(len(data.inputs))]
    first = [scan.best(place) for place in range(len(data.inputs))]
    whitened, noise = _whitened(_shortened(data))
    for place in (i for i, seen in enumerate(acts) if seen):
        costs = _costs(whitened, first, place, {*range(0, scan.largest + 1, COARSE), first[place]})
        first[place] = min(costs, key=lambda delay: costs[delay])
    found = []
    for place, seen in enumerate(acts):
        if not seen:
            found.append(InputDelay())
            continue
        low, high = max(0, first[place] - AROUND), min(first[place] + AROUND, scan.largest)
        costs = _costs(whitened, first, place, range(low, high + 1))
        least = min(costs.values())
        first[place] = min(costs, key=lambda delay: costs[delay])
        # Likelihoods count for as much less as few poles leave more than noise (quasi-likelihood).
        more = float(np.exp(least / sum(whitened.lengths))) / noise
        near = least + UNCERTAIN * max(more, 1.0)
        alike = [delay for delay, cost in costs.items() if cost <= near]
        found.append(InputDelay.of(first[place], alike))
    return found


def _costs(
    data: DelayedSignals, delays: Sequence[int], place: int, tried: Iterable[int]
) -> dict[int, float]:
    """Least criterion of each delay of one input, each search begun by the poles of neighbours.

    From below first, then from above; one pole ends alike from both sides.
    """
    way = sorted(tried)
    skip = max(*delays, *way) + max(POLES)

    def searched(delay: int, order: int, start: Array) -> Ended:
        asked = [*delays[:place], delay, *delays[place + 1 :]]
        return output_error(data, asked, order, skip, start)

    ends: dict[int, list[Ended]] = {}
    poles = [np.ones(1)] * len(POLES)
    for delay in way:
        ends[delay] = list(map(searched, [delay] * len(POLES), POLES, poles))
        poles = [found for _, found in ends[delay]]
    for i, order in enumerate(POLES[1:], 1):
        start = ends[way[-1]][i][1]
        for delay in reversed(way[:-1]):
            again = searched(delay, order, start)
            start = again[1]
            ends[delay][i] = min(ends[delay][i], again, key=lambda each: each[0])
    near = min(cost for each in ends.values() for cost, _ in each) + NEAR * sum(data.lengths)
    for i, order in enumerate(POLES):
        for delay in (each for each in way if ends[each][i][0] <= near):
            asked = [*delays[:place], delay, *delays[place + 1 :]]
            ends[delay][i] = refined(data, asked, order, skip, ends[delay][i])
    return {delay: min(cost for cost, _ in each) for delay, each in ends.items()}


def delays_to_scan(
    records: Sequence[Record], inputs: Sequence[str], output: str
) -> tuple[int, ...]:
    """Delays that a scan has to try, alike for all inputs: about those that data do not refuse.

    Along a loop data refuse what the controller does not do, turned round: from one on then.

    Parameters
    ----------
    records : sequence of Record
    inputs : sequence of str
    output : str

    Raises
    ------
    DataError
        Constant channels, or sample times that differ.
    """
    data = gather_channels(list(records), output, tuple(inputs), "mean")
    data.require_change()
    ends: list[tuple[int, int]] = []
    if not loop_seen(tuple(records), tuple(inputs), (output,)).may_turn_round:
        ends = [each.interval for each in find_delays(data, LONGEST) if each.interval is not None]
    if not ends:
        return UNTOLD
    low, high = min(end[0] for end in ends), max(end[1] for end in ends)
    return tuple(range(max(low - BEFORE, min(low, 1)), high + BEHIND + 1))


@dataclass(frozen=True, eq=False)
class _ArxScan:
    """The triangle of the longest ARX model, from which all others follow."""

    triangle: Array
    n_rows: int
    past: int
    span: int
    n_inputs: int

    @classmethod
    def of(cls, data: SampledChannels, largest: int) -> _ArxScan:
        m, n = len(data.inputs), data.output.size
        past = min(max(PAST), max(n // 20, 1), min(data.lengths) // 4)
        room = (n // 3 - past) // m
        span = max(min(largest + max(WINDOW), room, min(data.lengths) // 2), 2)
        made = regress(
            data.output, data.inputs, data.lengths, past, [span] * m, [0] * m, levels=data.levels
        )
        return cls(made.triangle, made.n_rows, past, span, m)

    @property
    def largest(self) -> int:
        """Longest delay whose smallest window fits."""
        return max(self.span - WINDOW[0], 0)

    def _block(self, place: int) -> range:
        first = self.past + place * self.span
        return range(first, first + self.span)

    def _others(self, place: int) -> list[int]:
        return [k for i in range(self.n_inputs) if i != place for k in self._block(i)]

    def _squares(self, columns: Sequence[int]) -> float:
        return _left(self.triangle, [*columns, -1])

    def acts(self, place: int) -> bool:
        """Whether chance explains what all lags of an input explain."""
        own = list(range(self.past))
        without = self._squares([*own, *self._others(place)])
        whole = float(self.triangle[-1, -1] ** 2)
        free = self.n_rows - self.triangle.shape[1] + 1
        if whole <= 0.0 or free < 1:
            return without > whole
        ratio = (without - whole) / self.span / (whole / free)
        return float(scipy.special.fdtrc(self.span, free, ratio)) < LEVEL / self.n_inputs

    def best(self, place: int) -> int:
        """Delay of the best structure, the other inputs with all their lags."""
        others = self._others(place)
        # What the other inputs need is taken out once.
        order = [*others, *range(self.past), *self._block(place), -1]
        triangle = np.asarray(np.linalg.qr(np.take(self.triangle, order, axis=1), mode="r"))
        rest = triangle[len(others) :, len(others) :]
        found = []
        for n_a in [n for n in PAST if n <= self.past] or [self.past]:
            # Below the first rows is what so many past outputs leave of the input's lags.
            left = rest[n_a:, self.past :]
            for n_b in [n for n in WINDOW if n <= self.span]:
                windows = sliding_window_view(left[:, :-1], n_b, axis=1).transpose(1, 0, 2)
                windows = windows[: self.largest + 1]
                target = np.broadcast_to(left[:, -1:], (*windows.shape[:2], 1))
                both = np.concatenate([windows, target], axis=2)
                squares = np.asarray(np.linalg.qr(both, mode="r"))[:, -1, -1] ** 2
                best = int(np.argmin(squares))
                found.append((criterion(squares[best], self.n_rows, n_a + n_b), best))
        return min(found)[1]


def _left(triangle: Array, columns: Sequence[int]) -> float:
    """What the other columns leave of the last, squared."""
    kept = np.asarray(np.linalg.qr(np.take(triangle, columns, axis=1), mode="r"))
    return float(kept[-1, -1] ** 2)


def _shortened(data: SampledChannels) -> DelayedSignals:
    """The first records, or the first samples of the first."""
    lengths: list[int] = []
    for length in data.lengths:
        room = MOST_SAMPLES - sum(lengths)
        if lengths and room < length:
            break
        lengths.append(min(length, room))
        if lengths[-1] < length:
            break
    n = sum(lengths)
    return DelayedSignals(np.vstack([data.output, data.inputs])[:, :n], tuple(lengths), data.levels)


def _whitened(data: DelayedSignals) -> tuple[DelayedSignals, float]:
    """Signals filtered so that what a long model leaves of the output is white, and its variance.

    Starts are cut off.
    """
    output, inputs = data.rows[0], data.rows[1:]
    m, n = inputs.shape
    long = max(1, min(LONG, n // (8 * (m + 1)), min(data.lengths) // 4))
    made = regress(output, inputs, data.lengths, long, [long + 1] * m, [0] * m, levels=data.levels)
    # The longer an ARX model, the more its A is the inverse of the noise model alone.
    white = data.filtered(np.concatenate([[1.0], made.shortest[:long]]), np.ones(1))
    kept = np.concatenate([np.arange(span.start + long, span.stop) for span in data.spans])
    lengths = tuple(length - long for length in data.lengths)
    # A pulse at the start of each record answers as whatever state it began in.
    pulses = np.zeros(kept.size)
    pulses[np.cumsum((0, *lengths[:-1]))] = 1.0
    free = max(made.n_rows - len(made.triangle) + 1, 1)
    noise = max(float(made.triangle[-1, -1] ** 2) / free, np.finfo(float).tiny)
    return DelayedSignals(np.vstack([white[:, kept], pulses]), lengths, data.levels), noise
