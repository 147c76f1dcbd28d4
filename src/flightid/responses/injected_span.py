"""Frequencies that what was injected into a loop has power at, by the records themselves."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from flightid.record import Record
from flightid.responses.excited_band import STRONG

WINDOWS = 5
"""Windows that a record is cut into, each with half of the next."""
LEAST_SAMPLES = 16
BLUR = 3
"""Lines by which a window of Hann spreads a sharp end of a spectrum down to 20 dB."""
QUARTER = 0.25
"""Of the power beside an end that a sweep has at the frequency where it begins or stops."""


def injected_span(records: Sequence[Record]) -> tuple[float, float] | None:
    """Lowest and highest frequency of the excitations in records, rad/s.

    Beyond them ω·S(ω) of each stays 20 dB below its most, so that what hangs together there is the
    loop, or leakage that excitation and outputs share; what a window spreads a sharp end by is
    taken off. None where no record holds any.

    Parameters
    ----------
    records : sequence of Record
        With the signals that were injected as excitations.

    Reference
    ---------
    Welch, *IEEE Transactions on Audio and Electroacoustics* 15 (1967), 70–73.

    Example
    -------
    >>> t = np.arange(0.0, 60.0, 0.01)
    >>> swept = np.sin(2.0 * np.pi * (0.2 * t + 0.04 * t**2))
    >>> record = Record.from_arrays(t, inputs={"u": swept}, outputs={"y": swept},
    ...                             excitations={"injected": swept})
    >>> low, high = injected_span([record])
    >>> bool(0.5 < low / (2.0 * np.pi) + 0.3 < 0.7), bool(4.8 < high / (2.0 * np.pi) < 5.6)
    (True, True)
    """
    spans = [
        span
        for record in records
        for name in record.excitations
        if (span := _span(record, name)) is not None
    ]
    if not spans:
        return None
    lows, highs = zip(*spans, strict=True)
    return min(lows), max(highs)


def _span(record: Record, name: str) -> tuple[float, float] | None:
    values = np.asarray(record[name], dtype=np.float64)
    length = len(values) // WINDOWS * 2
    if length < LEAST_SAMPLES or np.ptp(values) == 0.0:
        return None
    # The ends count as much as the middle: a sweep's highest frequency is its last.
    whole = np.pad(values - values.mean(), length // 2)
    starts = range(0, len(whole) - length + 1, length // 2)
    parts = np.array([whole[k : k + length] for k in starts])
    power = np.abs(np.fft.rfft(np.hanning(length) * parts, axis=1)) ** 2
    omega = 2.0 * np.pi * np.fft.rfftfreq(length, record.sample_time_s)
    level = omega * power.mean(axis=0)
    level[:2] = 0.0  # a trim and what the window blurs of it
    strong = np.flatnonzero(level >= STRONG * level.max())
    first, last = int(strong[0]), int(strong[-1])
    low = first + _spread(level[first : last + 1])
    high = last - _spread(level[first : last + 1][::-1])
    return float(omega[min(low, high)]), float(omega[max(low, high)])


def _spread(level: NDArray[np.float64]) -> int:
    """Lines from the end of a spectrum to where a quarter of the power beside it is."""
    beside = level[: BLUR + 1]
    return int(np.argmax(beside >= QUARTER * beside.max()))
