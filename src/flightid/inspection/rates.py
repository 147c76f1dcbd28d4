"""How regularly each message was logged: rate, jitter, gaps, stamps out of order."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from flightid.frozen import dataclass
from flightid.inspection.signals import Span
from flightid.inspection.stamps import believed, longer_steps
from flightid.inspection.thresholds import GAP_FACTOR
from flightid.logs import Log

FEWEST_ROWS = 10
"""Messages with fewer stamped rows have no rate worth a line."""
FASTEST_HZ = 10_000.0
"""No autopilot samples anything faster: such spacing is that of the writing."""
BURST = 3.0
"""Rate of the median interval over the mean rate from which uneven rows come in bursts."""
SPREAD = (5, 95)
"""Percentiles of the steps between which jitter is told."""


@dataclass(frozen=True)
class StreamRate:
    """Regularity of one instance of one message.

    Attributes
    ----------
    message : str
        Message or topic.
    instance : int or None
        Instance.
    rows : int
        Stamped rows.
    rate_hz : float
        From the median interval.
    mean_hz : float
        Rows over the span: lower where rows are missing.
    jitter : float
        Half the spread between the 5th and the 95th percentile of the intervals, in medians.
    n_gaps : int
        Intervals above 2.5 medians.
    longest_gap_s : float
        Longest of them, s; 0 without.
    n_disordered : int
        Stamps that repeat, go back, or lie far from all others.
    """

    message: str
    instance: int | None
    rows: int
    rate_hz: float
    mean_hz: float
    jitter: float
    n_gaps: int
    longest_gap_s: float
    n_disordered: int

    @property
    def is_burst(self) -> bool:
        """Whether rows come many at once, so that the median interval tells no rate."""
        uneven = self.jitter > 1.0 and self.rate_hz > BURST * self.mean_hz
        return self.rate_hz > FASTEST_HZ or uneven

    @property
    def label(self) -> str:
        """Message with its instance."""
        return self.message if self.instance is None else f"{self.message}[{self.instance}]"


def stream_rates(log: Log) -> tuple[StreamRate, ...]:
    """Regularity of every message with enough stamped rows, fastest first."""
    found = []
    for info in log.messages.values():
        if info.rate_hz is None or info.first_s is None:
            continue
        for instance in info.instances or (None,):
            rate = _of(info.name, instance, log.table(info.name, instance).time_s)
            if rate is not None:
                found.append(rate)
    return tuple(sorted(found, key=lambda rate: -rate.rate_hz))


def _of(message: str, instance: int | None, stamps: NDArray[np.float64]) -> StreamRate | None:
    if stamps.size < FEWEST_ROWS:
        return None
    good = believed(stamps)
    if good.size < FEWEST_ROWS:
        return None
    forward = np.diff(good)
    # Sorted in place: the steps of a large log are not held twice.
    middle = float(np.median(forward, overwrite_input=True))
    low, high = np.percentile(forward, SPREAD, overwrite_input=True)
    gaps = np.array([stop - start for start, stop in _gaps(good, middle)])
    return StreamRate(
        message,
        instance,
        int(stamps.size),
        1.0 / middle,
        (good.size - 1) / float(np.ptp(good)),
        float(high - low) / (2.0 * middle),
        int(gaps.size),
        float(gaps.max()) if gaps.size else 0.0,
        int(stamps.size - good.size),
    )


def stream_gaps(stamps: NDArray[np.float64]) -> list[Span]:
    """Spans between increasing stamps that are longer than 2.5 median steps, s."""
    if stamps.size < 2:
        return []
    return _gaps(stamps, float(np.median(np.diff(stamps), overwrite_input=True)))


def _gaps(stamps: NDArray[np.float64], usual_s: float) -> list[Span]:
    return longer_steps(stamps, GAP_FACTOR.value * usual_s)
