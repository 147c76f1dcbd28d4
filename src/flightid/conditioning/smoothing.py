"""Smoothing and derivatives: local quadratic fits, and Fourier series under a Wiener filter."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import scipy
from numpy.typing import ArrayLike, NDArray

from flightid.conventions import Role
from flightid.errors import DataError, OptionError
from flightid.frozen import dataclass
from flightid.record import Channel, Record, Step
from flightid.table import Cell
from flightid.units import canonical

CHI_SQUARE_MEDIAN = 0.4549
"""Median of a chi-square variable with one degree of freedom."""


@dataclass(frozen=True)
class SmoothSignal:
    """A smoothed signal with its derivative.

    Attributes
    ----------
    values, derivative : ndarray, shape (n,)
        Smoothed samples, and their derivative per s.
    cutoff_hz : float
        Frequency at which the filter passes half, Hz.
    noise : float
        Estimated standard deviation of the noise that was removed, in the signal's unit.

    Example
    -------
    >>> import numpy as np
    >>> time_s = np.arange(200) / 50
    >>> fourier_smooth(np.sin(time_s), 0.02, cutoff_hz=5.0)
    SmoothSignal(200 samples, cut-off 5 Hz)
    """

    values: NDArray[np.float64]
    derivative: NDArray[np.float64]
    cutoff_hz: float
    noise: float

    def __repr__(self) -> str:
        """Length and cut-off on one line."""
        return f"SmoothSignal({self.values.size} samples, cut-off {self.cutoff_hz:.4g} Hz)"


def local_derivative(
    values: ArrayLike, sample_time_s: float, *, half_width: int = 2
) -> NDArray[np.float64]:
    """Derivative by a least-squares parabola over neighbouring samples (Savitzky–Golay).

    At the ends the parabola of the first or last full window is used, off its centre.

    Parameters
    ----------
    values : array_like, shape (n,)
        Samples.
    sample_time_s : float
        Sample time, s.
    half_width : int
        Neighbours on each side; 2 is the usual five-point formula.

    Returns
    -------
    ndarray, shape (n,)
        Derivative, unit per s.

    Raises
    ------
    OptionError
        `half_width` below 1, or a sample time that is not positive.
    DataError
        Fewer samples than the window.

    Reference
    ---------
    Klein & Morelli, Aircraft System Identification, chapter 11 (local numerical
    differentiation); Savitzky & Golay (1964), Analytical Chemistry 36(8).

    Example
    -------
    >>> local_derivative([1.0, 4.0, 9.0, 16.0, 25.0], 1.0).round(9)
    array([ 2.,  4.,  6.,  8., 10.])
    """
    samples = np.asarray(values, dtype=np.float64)
    window = 2 * half_width + 1
    if half_width < 1 or not sample_time_s > 0:
        raise OptionError(
            "a local derivative needs neighbours and a sample time",
            found=f"half width {half_width}, sample time {sample_time_s} s",
            needed="at least 1, and above 0 s",
        )
    if samples.ndim != 1 or samples.size < window:
        raise DataError(
            "too few samples for a local derivative", found=samples.shape, needed=f"{window}"
        )
    places = np.arange(-half_width, half_width + 1.0)
    bend = places**2 - np.mean(places**2)
    slope = np.empty_like(samples)
    slope[half_width:-half_width] = np.correlate(samples, places / np.sum(places**2), "valid")
    for outside, inside in (
        (slice(half_width), slice(window)),
        (slice(-half_width, None), slice(-window, None)),
    ):
        last = samples[inside]
        curvature = 2.0 * (bend @ last) / np.sum(bend**2)
        slope[outside] = places @ last / np.sum(places**2) + curvature * places[outside]
    return np.asarray(slope / sample_time_s)


def local_mean(values: ArrayLike, *, half_width: int = 2) -> NDArray[np.float64]:
    """Local mean that belongs to `local_derivative`: that of the derivative is its output.

    A parabola's slope over a window is, without approximation, a weighed mean of the true slope
    there. The same mean of the right side of a differential equation therefore equals the local
    derivative of the left side: the smoothing biases neither. Between samples the values are
    followed by cubics.

    Parameters
    ----------
    values : array_like, shape (..., n)
        Samples, time last.
    half_width : int
        As for `local_derivative`.

    Returns
    -------
    ndarray, shape (..., n - 2 half_width - 2)
        Means about the samples `half_width` + 1 to n − `half_width` − 2.

    Raises
    ------
    OptionError
        `half_width` below 1.
    DataError
        Fewer samples than the mean needs.

    Reference
    ---------
    Shinbrot (1957), On the analysis of linear and nonlinear systems, Trans. ASME 79 (method of
    moment functions).

    Example
    -------
    >>> time_s = np.arange(9) * 0.1
    >>> slope = local_derivative(time_s**3, 0.1)[3:-3]
    >>> np.allclose(local_mean(3 * time_s**2), slope, atol=1e-14)
    True
    """
    samples = np.asarray(values, dtype=np.float64)
    if half_width < 1:
        raise OptionError("a local mean needs neighbours", found=half_width, needed="at least 1")
    kernel = _mean_kernel(half_width)
    if samples.shape[-1] < kernel.size:
        raise DataError(
            "too few samples for a local mean", found=samples.shape[-1], needed=kernel.size
        )
    count = samples.shape[-1] - kernel.size + 1
    result = np.zeros((*samples.shape[:-1], count))
    for place, weight in enumerate(kernel):
        result += weight * samples[..., place : place + count]
    return result


def _mean_kernel(half_width: int) -> NDArray[np.float64]:
    """Weights of 2 half_width + 3 samples in `local_mean`."""
    place = np.arange(-half_width, half_width + 1)
    slope = place / np.sum(place**2)
    # The parabola's slope counts the change over each interval by the samples beyond it.
    interval = np.concatenate(
        (-np.cumsum(slope[:half_width]), np.cumsum(slope[:half_width:-1])[::-1])
    )
    return np.convolve(interval, np.array([-1.0, 13.0, 13.0, -1.0]) / 24.0)


def fourier_smooth(
    values: ArrayLike, sample_time_s: float, *, cutoff_hz: float | None = None
) -> SmoothSignal:
    """Smooth a signal by a sine series under a Wiener filter; differentiate the series exactly.

    The line through the end points is removed, what is left is continued oddly and expanded in
    sines, whose coefficients fall with the cube of their number for a smooth signal while those of
    white noise stay level. The Wiener filter ``(k0/k)^6 / (1 + (k0/k)^6)`` turns where the two
    meet: at the knee found in the coefficients, or at `cutoff_hz`.

    Assumes: noise that is white over the upper half of the band. Biased when: the signal itself
    holds steps, or the end samples are noisy outliers.

    Parameters
    ----------
    values : array_like, shape (n,)
        Samples.
    sample_time_s : float
        Sample time, s.
    cutoff_hz : float, optional
        Cut-off, Hz; default: the knee.

    Raises
    ------
    DataError
        Fewer than 16 samples, or no knee: the signal does not stand out of the noise.
    OptionError
        A cut-off or sample time that is not positive, or a cut-off above Nyquist.

    Reference
    ---------
    Klein & Morelli, Aircraft System Identification, chapter 11 (global Fourier smoothing);
    Morelli (1995), Estimating noise characteristics from flight test data, J. Aircraft 32(4).

    Example
    -------
    >>> import numpy as np
    >>> time_s = np.arange(500) / 100
    >>> noise = 0.01 * np.random.default_rng(0).standard_normal(500)
    >>> smooth = fourier_smooth(np.sin(3 * time_s) + noise, 0.01)
    >>> bool(np.std(smooth.values - np.sin(3 * time_s)) < 0.004)
    True
    """
    samples = np.asarray(values, dtype=np.float64)
    _require_series(samples)
    if not sample_time_s > 0 or (cutoff_hz is not None and not 0 < cutoff_hz * sample_time_s < 0.5):
        raise OptionError(
            "cut-off does not lie in the band",
            found=f"{cutoff_hz} Hz at a sample time of {sample_time_s} s",
            needed="between 0 and half the sampling rate",
        )
    count = samples.size
    line, coefficients, level = _sines(samples)
    frequency_hz = np.arange(1, count - 1) / (2 * (count - 1) * sample_time_s)
    knee = _knee(coefficients**2, level) if cutoff_hz is None else None
    cutoff = float(frequency_hz[knee]) if knee is not None else float(cutoff_hz or 0.0)
    weight = 1 / (1 + (frequency_hz / cutoff) ** 6)
    kept = weight * coefficients
    # A sine series and its derivative, a cosine series, back by the same transforms.
    inside = scipy.fft.dst(kept, type=1) / 2
    cosines = np.concatenate(([0.0], kept * 2 * np.pi * frequency_hz, [0.0]))
    slope = scipy.fft.dct(cosines, type=1) / 2 + (samples[-1] - samples[0]) / (
        (count - 1) * sample_time_s
    )
    smooth = line + np.concatenate(([0.0], inside, [0.0]))
    return SmoothSignal(smooth, np.asarray(slope), cutoff, _deviation(level, count))


def white_deviation(samples: NDArray[np.float64]) -> float:
    """Standard deviation of the white noise of a signal, as `fourier_smooth` finds it.

    Raises
    ------
    DataError
        Fewer than 16 samples.

    Example
    -------
    >>> noise = np.random.default_rng(0).standard_normal(4000)
    >>> round(white_deviation(np.sin(np.arange(4000) / 50) + noise), 1)
    1.0
    """
    _require_series(samples)
    return _deviation(_sines(samples)[2], samples.size)


def _require_series(samples: NDArray[np.float64]) -> None:
    if samples.ndim != 1 or samples.size < 16:
        raise DataError("too few samples for a Fourier series", found=samples.shape, needed="16")


def _sines(
    samples: NDArray[np.float64],
) -> tuple[NDArray[np.float64], NDArray[np.float64], float]:
    """Line through the ends, coefficients of what is left, and the level of their upper half."""
    count = samples.size
    line = samples[0] + (samples[-1] - samples[0]) * (np.arange(count) / (count - 1))
    coefficients = np.asarray(scipy.fft.dst((samples - line)[1:-1], type=1) / (count - 1))
    upper = coefficients[count // 2 :]
    return line, coefficients, float(np.median(upper**2)) / CHI_SQUARE_MEDIAN


def _deviation(level: float, count: int) -> float:
    """Each coefficient of white noise of deviation s has variance 2 s² / (n - 1)."""
    return float(np.sqrt(level * (count - 1) / 2))


def _knee(power: NDArray[np.float64], level: float) -> int:
    """Last place at which the running mean of the power stands above twice the noise level."""
    width = max(5, power.size // 50)
    running = np.convolve(power, np.ones(width) / width, mode="same")
    # A mean of `width` chi-squares exceeds this limit by chance about once in 30,000.
    limit = level * max(2.0, 1 + 4 * np.sqrt(2 / width))
    above = np.flatnonzero(running > limit)
    if above.size == 0:
        raise DataError(
            "the signal does not stand out of its noise",
            found=f"no Fourier coefficient above a noise level of {np.sqrt(level):.3g}",
            needed="a signal that is smooth against the sampling",
            action="give cutoff_hz, or take a record with excitation",
        )
    return int(above[-1])


def differentiate(
    record: Record,
    channels: Mapping[str, str],
    *,
    half_width: int | None = 2,
    cutoff_hz: float | None = None,
) -> Record:
    """Add derivatives of channels: local by default, global with ``half_width=None``.

    Parameters
    ----------
    record : Record
        Data.
    channels : mapping of str to str
        Name of the derivative by channel, for example ``{"p": "p_dot"}``.
    half_width : int or None
        Neighbours on each side of the local parabola; None: `fourier_smooth`.
    cutoff_hz : float, optional
        Cut-off of the global smoother, Hz; default: its knee.

    Returns
    -------
    Record
        Copy with one channel more for each, of role "other", its unit per second.

    Raises
    ------
    UnknownNameError
        There is no such channel.
    OptionError
        A name is taken, or `cutoff_hz` is given with the local method.
    DataError
        Too few samples, or no knee.

    Reference
    ---------
    Klein & Morelli, Aircraft System Identification, chapter 11.

    Example
    -------
    >>> record = Record.from_arrays([0, 1, 2, 3, 4], outputs={"p": [1, 4, 9, 16, 25]},
    ...                             units={"p": "rad/s"})
    >>> added = differentiate(record, {"p": "p_dot"})
    >>> added["p_dot"].round(9).tolist(), added.unit("p_dot")
    ([2.0, 4.0, 6.0, 8.0, 10.0], 'rad/s^2')
    """
    if half_width is not None and cutoff_hz is not None:
        raise OptionError(
            "a cut-off belongs to the global method",
            found=f"half_width={half_width} and cutoff_hz={cutoff_hz}",
            needed="half_width=None with cutoff_hz",
        )
    labels = record.channels
    samples: dict[str, NDArray[np.float64]] = {}
    options: dict[str, Cell] = {"half_width": half_width, "cutoff_hz": cutoff_hz}
    for name, new in channels.items():
        unit = record.unit(name)
        if new in labels:
            raise OptionError("the name is taken", found=new, needed="a new name")
        if half_width is None:
            smooth = fourier_smooth(record[name], record.sample_time_s, cutoff_hz=cutoff_hz)
            samples[new] = smooth.derivative
            options[f"{name}_cutoff_hz"] = smooth.cutoff_hz
        else:
            samples[new] = local_derivative(
                record[name], record.sample_time_s, half_width=half_width
            )
        per_second = canonical(f"({unit})/s") if unit != "1" else "1/s"
        labels[new] = Channel(new, per_second, Role.OTHER, f"derivative of {name}")
    step = Step("conditioning.differentiate", options)
    return record.replace(samples, channels=labels.values(), step=step)
