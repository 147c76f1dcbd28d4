"""Clock skew: the same motion in two streams, and how late one shows it."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from flightid.frozen import dataclass
from flightid.inspection.axes import axes_of
from flightid.inspection.signals import Signal, Span, place_of, places
from flightid.inspection.thresholds import SKEW_CORRELATION
from flightid.logs import Log
from flightid.uncertainty.quantiles import half_width

LONGEST_LAG_S = 0.3
"""Lags that are looked at, s, to either side."""
COARSE, FINE = 61, 41
"""Lags over the whole range, then between the neighbours of the best one."""
APART = 5
"""Of the fine lags one in so many is tried first, then those about the best of these."""
ENOUGH_COARSE = 2_500
"""Samples that tell which coarse lag is near."""
ENOUGH = 20_000
"""Samples that settle a correlation; more only cost time."""
FEWEST = 50
"""Samples of the slower stream without which nothing is compared."""
RESOLVED = 0.1
"""Share of the slower step below which a lag means nothing."""
PARTS = 10
"""Stretches of equal length, each left out in turn, whose scatter makes the interval."""


@dataclass(frozen=True)
class StreamSkew:
    """How late one stream shows the same motion as another.

    Attributes
    ----------
    quantity : str
        Canonical name of the motion.
    first, second : str
        Where it was logged.
    lag_s : float
        Positive where the second is later, s.
    correlation : float
        Of the two at that lag.
    resolution_s : float
        A tenth of the slower interval: lags below it mean nothing, s.
    half_width_s : float
        Half of the 95 % interval of the lag, s: jackknife over ten stretches, so that errors may be
        coloured. Bias: a filter's delay is part of the lag.
    """

    quantity: str
    first: str
    second: str
    lag_s: float
    correlation: float
    resolution_s: float
    half_width_s: float

    @property
    def is_told(self) -> bool:
        """Whether the streams are dense enough, and agree enough, to tell this lag from none."""
        return abs(self.lag_s) > max(self.resolution_s, self.half_width_s)

    def exceeds(self, limit_s: float) -> bool:
        """Whether the whole interval lies beyond a limit, s, and beyond the resolution."""
        return abs(self.lag_s) - self.half_width_s > max(limit_s, self.resolution_s)


def stream_skews(log: Log, spans: tuple[Span, ...]) -> tuple[StreamSkew, ...]:
    """Skew between every two streams that hold the same body rate, where they agree on it.

    The streams are filtered differently, and a filter's delay is part of the lag.
    """
    found = [
        _skew(axis.rate, streams[0], second, spans)
        for axis in axes_of(log.vehicle).values()
        if (streams := places(log, axis.rate))
        for second in streams[1:]
    ]
    return tuple(skew for skew in found if skew is not None)


def _skew(
    quantity: str, first: Signal, second: Signal, spans: tuple[Span, ...]
) -> StreamSkew | None:
    slow, fast = sorted((first, second), key=lambda signal: signal.rate_hz)
    part = place_of(slow.time_s, spans)
    stamps, values = slow.time_s[part], slow.values[part]
    if stamps.size < FEWEST or np.ptp(values) == 0:
        return None
    every = max(1, stamps.size // ENOUGH)
    stamps, values = stamps[::every], values[::every]

    coarse = np.linspace(-LONGEST_LAG_S, LONGEST_LAG_S, COARSE)
    apart = max(1, stamps.size // ENOUGH_COARSE)
    thin = _Alike(stamps[::apart], values[::apart], fast)
    near = float(coarse[int(np.argmax([thin.at(lag) for lag in coarse.tolist()]))])
    step = float(coarse[1] - coarse[0])
    lags = np.linspace(near - step, near + step, FINE)
    correlations = _about_the_best(_Alike(stamps, values, fast), lags)
    best = max(correlations, key=correlations.__getitem__)
    left, middle, right = (correlations.get(best + side) for side in (-1, 0, 1))
    if left is None or middle is None or right is None or middle < SKEW_CORRELATION.value:
        return None
    curvature = left - 2.0 * middle + right
    fraction = 0.5 * (left - right) / curvature if curvature < 0 else 0.0
    # The fast stream read `lag` later matches the slow one: the fast one is later by `lag`.
    lag = float(lags[best] + fraction * (lags[1] - lags[0]))
    later = lag if fast is second else -lag
    return StreamSkew(
        quantity,
        first.label,
        second.label,
        later,
        float(middle),
        RESOLVED / slow.rate_hz,
        _half_width_s(values, stamps + lag, fast, float(lags[1] - lags[0])),
    )


class _Alike:
    """How alike a slow stream and a fast one are that is read a lag later."""

    def __init__(
        self, stamps: NDArray[np.float64], values: NDArray[np.float64], fast: Signal
    ) -> None:
        self._stamps, self._fast = stamps, fast
        self._off = values - values.mean()
        self._size = float(np.linalg.norm(self._off))

    def at(self, lag: float) -> float:
        """Correlation at a lag, s."""
        moved = np.interp(self._stamps + lag, self._fast.time_s, self._fast.values)
        moved -= moved.mean()
        spread = self._size * float(np.linalg.norm(moved))
        return float(self._off @ moved) / spread if spread > 0 else 0.0


def _about_the_best(alike: _Alike, lags: NDArray[np.float64]) -> dict[int, float]:
    """Correlations by the place of their lag: a few over the range, all about the best of these."""
    found = {place: alike.at(float(lags[place])) for place in range(0, lags.size, APART)}
    top = max(found, key=found.__getitem__)
    for place in range(max(0, top - APART + 1), min(lags.size, top + APART)):
        if place not in found:
            found[place] = alike.at(float(lags[place]))
    return found


def _half_width_s(
    values: NDArray[np.float64], moved_s: NDArray[np.float64], fast: Signal, step_s: float
) -> float:
    """Half of the 95 % interval of a lag that is already found, s."""

    def read(shift_s: float) -> NDArray[np.float64]:
        made = np.interp(moved_s + shift_s, fast.time_s, fast.values)
        return np.asarray(made - made.mean())

    moved, slope = read(0.0), (read(step_s) - read(-step_s)) / (2.0 * step_s)
    regressors = np.column_stack([moved, slope])
    parts = np.array_split(np.arange(values.size), PARTS)
    squares = np.array([regressors[part].T @ regressors[part] for part in parts])
    products = np.array([regressors[part].T @ (values - values.mean())[part] for part in parts])
    left = [
        np.linalg.lstsq(squares.sum(0) - square, products.sum(0) - product)[0]
        for square, product in zip(squares, products, strict=True)
    ]
    lags = np.array([delay / gain for gain, delay in left])
    spread = np.sqrt((PARTS - 1) / PARTS * np.sum((lags - lags.mean()) ** 2))
    return float(half_width(freedom=PARTS - 1) * spread)
