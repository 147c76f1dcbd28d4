"""How fast a set-point moves a loop: the quick readings of a slow one are those of the prior."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from flightid.review.loop_samples import LoopSamples
from flightid.review.step_features import BANDWIDTH
from flightid.review.thresholds import COHERENT, RISE_BAND
from flightid.uncertainty.estimate import Estimate, Reading

Array = NDArray[np.float64]
WINDOW_S = 1.0
"""Of the spectra, in units of `pace_s`."""
RISE = "rise time"
ASKED = "quicker sticks"
QUICK = (RISE, BANDWIDTH, "frequency at -90 deg", "frequency at -180 deg")


def told_hz(samples: LoopSamples, *, pace_s: float = 1.0) -> float:
    """Up to where a set-point is seen in what followed, Hz: coherence from below, windows halved.

    Reference: Bendat & Piersol, *Random Data*, section 6.1 (ordinary coherence).
    """
    n = round(WINDOW_S * pace_s / samples.sample_time_s)
    pairs = list(_windows(samples, n))
    if not pairs:
        return 0.0
    wanted, followed = np.fft.rfft(np.hanning(n) * np.array(pairs), axis=-1).transpose(1, 0, 2)
    power = np.mean(np.abs(wanted) ** 2, axis=0) * np.mean(np.abs(followed) ** 2, axis=0)
    cross = np.abs(np.mean(wanted.conj() * followed, axis=0)) ** 2
    seen = cross >= COHERENT.value * np.where(power > 0.0, power, np.inf)
    lost = np.flatnonzero(~seen[1:])
    steps = lost[0] if lost.size else seen.size - 1
    return float(steps / (n * samples.sample_time_s))


def _windows(samples: LoopSamples, n: int) -> Iterator[Array]:
    """Set-point and measured, shape (2, n), of windows that overlap by half, means removed."""
    begin = 0
    for length in samples.lengths:
        for start in range(begin, begin + length - n + 1, max(1, n // 2)):
            both = np.array(
                [each[start : start + n] for each in (samples.set_point, samples.measured)]
            )
            yield both - both.mean(axis=1, keepdims=True)
        begin += length


def told_by(readings: Sequence[Reading], seen_hz: float) -> tuple[Reading, ...]:
    """Readings; of a rise that is quicker than the set-point ever moved the loop, no quick ones.

    A step that rises in T asks for frequencies up to 0.4 / T. Where the set-point holds less, the
    smoothness that the kernels assume decides: rises come out long, their intervals too short.
    """
    rise = next((each for each in readings if each.name == RISE), None)
    ends = None if rise is None else rise.interval95
    if ends is None or ends[1] * seen_hz >= RISE_BAND.value:
        return tuple(readings)
    why = (
        f"the set-point moves this loop up to {seen_hz:.2g} Hz, a rise within {ends[1]:.2g} s asks "
        f"for {RISE_BAND.value / ends[1]:.2g} Hz: {ASKED}"
    )
    return tuple(
        Estimate(each.name, None, each.unit, reason=why) if each.name in QUICK else each
        for each in readings
    )


def is_too_quick(reading: Reading) -> bool:
    """Whether `told_by` took the number: the set-point was too slow for it."""
    return reading.value is None and reading.reason.endswith(ASKED)
