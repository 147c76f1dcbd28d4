"""Samples between samples: anti-aliased and band-limited interpolation by a windowed sinc.

One kernel serves decimation, interpolation and fractional delay: a sinc under a Kaiser window,
symmetric in time (zero phase), with 100 dB between pass band and stop band.
"""

from __future__ import annotations

from enum import StrEnum

import numpy as np
from numpy.typing import NDArray

from flightid import _native
from flightid.record.history import JITTERED
from flightid.record.stamps import StampedSamples

ATTENUATION_DB = 100.0
KAISER_BETA = 0.1102 * (ATTENUATION_DB - 8.7)
TRANSITION = 0.1
"""Width of the transition band as a fraction of the lower sampling rate."""
HALF_LENGTH = (ATTENUATION_DB - 7.95) / (2 * 14.36 * TRANSITION)
"""Half length of the kernel in samples of the lower rate (Kaiser's formula)."""
SAME_RATE = 0.05
"""Relative difference of a grid from a source's mean spacing that counts as the same rate: the
mean of jittered stamps lies on either side of their nominal spacing."""
FEWEST_ON_LINE = 3
"""Samples in a step of the grid that tell a line."""
NEW_VALUES, BETWEEN_NEW = ", rows of new values", ", between rows of new values"
"""Ends of what is said of a channel that repeats its values: on a grid as slow, on a finer one."""
FILLED = {
    "zero": ((0.5, 8 / 18), (0.5 - 0.15**0.5, 5 / 18), (0.5 + 0.15**0.5, 5 / 18)),
    "first": ((0.0, 7 / 12), (-(0.4**0.5), 5 / 24), (0.4**0.5, 5 / 24)),
}
"""What a sample stands for between the samples, as Gauss points (in samples after it) and weights:
a step of one sample's length, whose middle is half a sample late, or a triangle of two. A low-pass
that leaves them out makes a lag behind a held input too long by half a sample."""
CLOCK_JITTER = 0.15
"""Largest jitter, as a fraction of a sample, of stamps that belong to a clock."""


class Interpolation(StrEnum):
    """How samples arise between the stamps of the source.

    `BAND_LIMITED`: windowed sinc (jittered stamps first pass through a cubic spline on the true
    stamps). `CUBIC`: spline. `LINEAR`: straight lines, which lose amplitude near the source's
    Nyquist frequency. `PREVIOUS`: the last value holds, stamps that jitter counting for the grid
    point they belong to; for modes and other discrete values. `POINT`: the value at the instant,
    by a straight line fitted to the samples since the grid point before (between both neighbours
    where those are fewer than three). These two are never low-passed without phase: a sample does
    not know what a held input does after it; what lies above the grid's Nyquist frequency folds
    back, as in any logger at that rate.

    Example
    -------
    >>> Interpolation("previous")
    <Interpolation.PREVIOUS: 'previous'>
    """

    BAND_LIMITED = "band-limited"
    CUBIC = "cubic"
    LINEAR = "linear"
    PREVIOUS = "previous"
    POINT = "point"


def sample_at(
    source: StampedSamples,
    time_s: NDArray[np.float64],
    sample_time_s: float,
    method: Interpolation,
    hold: str | None = None,
) -> tuple[NDArray[np.float64], str]:
    """Values of a channel on a uniform grid, low-passed first where the grid is coarser by 5 %.

    Parameters
    ----------
    source : StampedSamples
        Channel without gaps.
    time_s : ndarray, shape (n,)
        Uniform grid inside the channel's span, s.
    sample_time_s : float
        Spacing of the grid, s.
    method : Interpolation
        Choice where the grid is not coarser than the source.
    hold : str or None
        What is known of the channel between its samples: "zero" and "first" are low-passed as the
        steps and straight lines that they are.

    Returns
    -------
    values : ndarray, shape (n,)
    done : str
        What was done, for the history.

    Reference
    ---------
    Oppenheim & Schafer, Discrete-Time Signal Processing (3rd ed.), section 4.6 and eqs. 7.75-7.76
    (Kaiser window).

    Example
    -------
    >>> from flightid.record.stamps import StampPolicy, stamped
    >>> ramp = stamped("ramp", [0.0, 1.0, 2.0], [0.0, 10.0, 20.0], StampPolicy.ERROR)
    >>> sample_at(ramp, np.array([0.5, 1.0, 1.5]), 0.5, Interpolation.LINEAR)
    (array([ 5., 10., 15.]), 'linear')
    """
    if method is Interpolation.PREVIOUS:
        index = np.searchsorted(source.time_s, time_s + slack_s(source, sample_time_s), "right") - 1
        same = abs(sample_time_s / source.sample_time_s - 1) <= SAME_RATE
        done = JITTERED if same and source.jitter > CLOCK_JITTER else "previous value"
        return source.values[np.maximum(index, 0)], done
    if _is_same_grid(source, time_s):
        first = int(np.argmin(np.abs(source.time_s - time_s[0])))
        return source.values[first : first + time_s.size].copy(), "copied"
    if method is Interpolation.POINT:
        return _read_at(source, time_s, sample_time_s), "value at the instant"
    step = source.sample_time_s
    coarser = is_coarser(sample_time_s, step)
    if not coarser and method is Interpolation.LINEAR:
        return np.interp(time_s, source.time_s, source.values), "linear"
    if not coarser and method is Interpolation.CUBIC:
        return spline(source, time_s), "cubic spline"
    return _filtered(source, time_s, sample_time_s if coarser else None, hold)


def _filtered(
    source: StampedSamples,
    time_s: NDArray[np.float64],
    coarser_s: float | None,
    hold: str | None,
) -> tuple[NDArray[np.float64], str]:
    """Values by the kernel: low-passed on a grid that is coarser, else band-limited."""
    start, step, values = uniform_samples(source)
    if coarser_s is None:
        # Exactly at the old Nyquist frequency the sinc passes through every given sample.
        return windowed_sinc(values, (time_s - start) / step, 0.5, 1.0), "band-limited"
    # Decimation stops at the new Nyquist frequency.
    rate = 1 / coarser_s
    cutoff_hz = rate * (1 - TRANSITION) / 2
    done = f"low-pass {cutoff_hz:.6g} Hz, zero phase"
    if hold in FILLED:
        done += f", of {'steps' if hold == 'zero' else 'straight lines'}"
    parts = (
        weight
        * windowed_sinc(values, (time_s - start) / step - after, cutoff_hz * step, rate * step)
        for after, weight in FILLED.get(hold or "", ((0.0, 1.0),))
    )
    return np.asarray(sum(parts)), done


def usual_method(hold: str | None, source_s: float, sample_time_s: float) -> Interpolation:
    """How an input with this hold is brought to a grid where nobody says how.

    Steps stay steps and straight lines stay lines, unless the grid is coarser than the samples:
    then inputs are low-passed as outputs are.

    Parameters
    ----------
    hold : str or None
        What the input does between samples, as a record knows it.
    source_s, sample_time_s : float
        Mean spacing of its samples, and spacing of the grid, s.

    Example
    -------
    >>> usual_method("zero", 0.0998, 0.1).value, usual_method("zero", 0.02, 0.1).value
    ('previous', 'band-limited')
    """
    if hold == "zero" and not is_coarser(sample_time_s, source_s):
        return Interpolation.PREVIOUS
    return Interpolation.LINEAR if hold == "first" else Interpolation.BAND_LIMITED


def is_coarser(sample_time_s: float, source_s: float) -> bool:
    """Tell whether a grid is so much coarser than its source that it takes a low-pass.

    Example
    -------
    >>> is_coarser(0.1, 0.0998), is_coarser(0.1, 0.09)
    (False, True)
    """
    return sample_time_s > source_s * (1 + SAME_RATE)


def _read_at(
    source: StampedSamples, time_s: NDArray[np.float64], sample_time_s: float
) -> NDArray[np.float64]:
    """Ends of straight lines fitted to the samples of each step up to its grid point."""
    near = 1e-6 * sample_time_s
    last = np.searchsorted(source.time_s, time_s + near, "right")
    first = np.searchsorted(source.time_s, time_s - sample_time_s + near, "right")
    count = last - first
    mean_t, mean_v, spread, product = np.zeros((4, time_s.size))
    for moments in (False, True):
        for back in range(1, int(np.max(count, initial=0)) + 1):
            at = np.maximum(last - back, 0)
            x, v = source.time_s[at] - time_s, source.values[at]
            weight = (back <= count) / np.maximum(count, 1)
            if moments:
                spread += weight * (x - mean_t) ** 2
                product += weight * (x - mean_t) * (v - mean_v)
            else:
                mean_t += weight * x
                mean_v += weight * v
    between = np.interp(time_s, source.time_s, source.values)
    line = mean_v - mean_t * product / np.where(spread > 0, spread, 1.0)
    return np.where(count >= FEWEST_ON_LINE, line, between)


def slack_s(source: StampedSamples, sample_time_s: float) -> float:
    """How much later than a grid point a stamp may be and still belong to it, s."""
    jitter = source.jitter
    # Rare events are no jittered clock: their stamps mean what they say.
    if jitter > CLOCK_JITTER or abs(sample_time_s / source.sample_time_s - 1) > SAME_RATE:
        jitter = 0.0
    return max(1e-6 * sample_time_s, 3 * jitter * source.sample_time_s)


def spline(source: StampedSamples, time_s: NDArray[np.float64]) -> NDArray[np.float64]:
    """Cubic spline through the samples at their true stamps; a line where there are only two."""
    if source.time_s.size < 3:
        return np.interp(time_s, source.time_s, source.values)
    return _native.cubic_spline(source.time_s, source.values, time_s)


def uniform_samples(source: StampedSamples) -> tuple[float, float, NDArray[np.float64]]:
    """Start, step and values of a channel on a uniform grid of its own mean rate."""
    count = source.time_s.size
    start = float(source.time_s[0])
    span = float(source.time_s[-1]) - start
    if source.is_uniform():
        return start, span / (count - 1), source.values
    count = max(2, round(span / source.sample_time_s) + 1)
    grid = np.linspace(start, float(source.time_s[-1]), count)
    return start, span / (count - 1), spline(source, grid)


def windowed_sinc(
    values: NDArray[np.float64],
    position: NDArray[np.float64],
    cutoff: float,
    rate: float,
) -> NDArray[np.float64]:
    """Evaluate uniform samples at fractional positions under a Kaiser-windowed sinc.

    The ends are continued by odd reflection, which carries a line on. A line comes out exactly:
    each row of weights sums to one about its position. Positions count to 1e-9 of a sample.

    Parameters
    ----------
    values : ndarray, shape (n,)
        Samples at positions 0, 1, … n − 1.
    position : ndarray, shape (m,)
        Where to evaluate, in samples of `values`.
    cutoff : float
        −6 dB frequency, cycles per sample of `values`.
    rate : float
        The lower of the two sampling rates, per sample of `values`; sets the kernel's length.

    Returns
    -------
    ndarray, shape (m,)
    """
    half = int(np.ceil(HALF_LENGTH / rate))
    return _native.windowed_sinc(values, position, cutoff, half, KAISER_BETA)


def _is_same_grid(source: StampedSamples, time_s: NDArray[np.float64]) -> bool:
    first = int(np.argmin(np.abs(source.time_s - time_s[0])))
    part = source.time_s[first : first + time_s.size]
    if part.size != time_s.size or part.size < 2:
        return False
    step = (time_s[-1] - time_s[0]) / (time_s.size - 1)
    return bool(np.max(np.abs(part - time_s)) <= 1e-6 * step)
