"""Power of a channel above the Nyquist frequency of the grid at whose instants it is read."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from flightid.conventions import Light
from flightid.findings import Finding
from flightid.record.sample_faults import SampleFault
from flightid.record.stamps import mean_spacing_s

Array = NDArray[np.float64]
LARGEST_FOLDED = 0.05
"""Share of a channel's power: folded into the band as noise, it leaves a coherence of 1 − share;
0.95 is what a flight plan asks for."""
SEGMENT, FEWEST = 1024, 64
"""Samples in a window of the spectrum, and in the shortest one."""


def folded_power(name: str, time_s: Array, samples: Array, step_s: float) -> SampleFault | None:
    """What a channel holds above half the rate of a grid that reads it without a low-pass.

    Parameters
    ----------
    name : str
        Channel.
    time_s, samples : ndarray, shape (n,)
        Stamps, s, of about one spacing, and samples of the channel.
    step_s : float
        Spacing of the grid, s.

    Returns
    -------
    SampleFault or None
        None where the share is at most 5 %, or where the samples are too few or too slow to tell.

    Reference
    ---------
    Welch (1967), *IEEE Transactions on Audio and Electroacoustics* 15(2): averaged periodograms.

    Example
    -------
    >>> t = np.arange(4000) / 400.0
    >>> motion = np.sin(2.0 * t)
    >>> folded_power("p", t, motion, 0.02) is None
    True
    >>> fault = folded_power("p", t, motion + np.sin(2 * np.pi * 83.0 * t), 0.02)
    >>> print(fault.finding.message.split(":")[1])
     45 % of its power lies above 25 Hz, most at 82.8 Hz, which folds to 17.2 Hz
    """
    good = np.isfinite(samples) & np.isfinite(time_s)
    time_s, values = time_s[good], samples[good]
    if values.size < FEWEST:
        return None
    rate_hz, new_hz = 1.0 / mean_spacing_s(time_s), 1.0 / step_s
    frequency, power = _spectrum(values - values.mean(), rate_hz)
    above = frequency > 0.5 * new_hz
    total = float(power.sum())
    if not total > 0.0 or not np.any(above):
        return None
    share = float(power[above].sum()) / total
    if share <= LARGEST_FOLDED:
        return None
    line_hz = float(frequency[above][np.argmax(power[above])])
    folded_hz = abs(line_hz - new_hz * round(line_hz / new_hz))
    said = (
        f"{name}: {100.0 * share:.0f} % of its power lies above {0.5 * new_hz:.3g} Hz, most at "
        f"{line_hz:.3g} Hz, which folds to {folded_hz:.3g} Hz: it is read at the instants of the "
        "inputs, without a low-pass"
    )
    action = f"interpolation={{'{name}': 'band-limited'}}, or log the inputs as fast as {name}"
    finding = Finding("folded-power", Light.AMBER, said, action)
    return SampleFault(name, float(time_s[0]), float(time_s[-1]), finding)


def _spectrum(values: Array, rate_hz: float) -> tuple[Array, Array]:
    """Averaged power of Hann windows with half overlap, and its frequencies, Hz."""
    length = min(SEGMENT, values.size)
    frames = np.lib.stride_tricks.sliding_window_view(values, length)[:: length // 2]
    taper = np.hanning(length + 1)[:-1]
    power = np.zeros(length // 2 + 1)
    for frame in frames:
        power += np.abs(np.fft.rfft(taper * frame)) ** 2
    return np.asarray(np.arange(power.size) * (rate_hz / length), np.float64), power
