"""Skew between channels: its estimate with an interval, and its removal by fractional delay."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import scipy
from numpy.typing import NDArray

from flightid.conventions import Light
from flightid.errors import DataError, OptionError
from flightid.findings import Finding
from flightid.frozen import dataclass
from flightid.record import Record, Step
from flightid.record.interpolation import windowed_sinc
from flightid.result import Result
from flightid.table import Column, Table
from flightid.uncertainty.estimate import Estimate
from flightid.uncertainty.quantiles import interval_words, shown
from flightid.units import require_match

HANN_NEIGHBOURS = 2.000
"""Growth of the variance of a weighted sum over frequency beyond that of its terms: estimates under
half-overlapped Hann windows are correlated over neighbouring frequencies, in one window (by (2/3)²
and (1/6)²) and across two."""
FEWEST_FREE = 0.25
HANN_OVERLAP = 1 + 2 * (1 / 6) ** 2
"""Growth of the variance of an average over Hann windows that overlap by half."""
ROUNDS = 4


@dataclass(frozen=True)
class Skew(Result, schema="flightid.skew/1"):
    """By how much one channel lags another.

    Attributes
    ----------
    reference, channel : str
        Names.
    lag : Estimate
        Of `channel` behind `reference`, s; negative where it leads.
    coherence : float
        Mean squared coherence over the band, as the fit weighed it.
    band_rad_s : (float, float)
        Band used, rad/s.
    sample_time_s : float
        Sample time of the record, s.
    findings : tuple of Finding
        Doubts.

    Example
    -------
    >>> Skew("p", "phi_dot", Estimate("skew", 0.012, "s", 0.001), 0.98, (0.6, 31.4), 0.01)
    Skew('phi_dot' behind 'p': 0.012 (0.01004 to 0.01396) s, coherence 0.98)
    """

    reference: str
    channel: str
    lag: Estimate
    coherence: float
    band_rad_s: tuple[float, float]
    sample_time_s: float
    findings: tuple[Finding, ...] = ()

    @property
    def skew_s(self) -> float:
        """Lag of `channel` behind `reference`, s."""
        return self.lag.value

    def summary(self, *, level: float | None = None) -> Table:
        """Table of the estimate with its interval at a level."""
        level = shown(level)
        low, high = self.lag.interval(level) or (None, None)
        columns = (
            Column("channel"),
            Column("behind"),
            Column("skew", "s"),
            Column(f"{interval_words(level)} from", "s"),
            Column("to", "s"),
            Column("samples"),
            Column("coherence"),
        )
        row = (
            self.channel,
            self.reference,
            self.skew_s,
            low,
            high,
            self.skew_s / self.sample_time_s,
            self.coherence,
        )
        return Table("Skew", columns, (row,), tuple(map(str, self.findings)))

    def __repr__(self) -> str:
        """Skew with its interval on one line."""
        return (
            f"Skew({self.channel!r} behind {self.reference!r}: {self.lag.text}, "
            f"coherence {self.coherence:.2g})"
        )


def estimate_skew(
    record: Record,
    reference: str,
    channel: str,
    *,
    band_rad_s: tuple[float, float] | None = None,
    window_s: float | None = None,
    largest_s: float = 0.5,
) -> Skew:
    """Lag of a channel behind another that shows the same quantity, to a fraction of a sample.

    The peak of the cross-correlation gives the whole samples; the slope of the cross-spectrum's
    phase over frequency, weighted by coherence (each phase has variance (1 − γ²)/(2 n γ²)), gives
    the rest. The skew found is removed by a fractional delay and the slope taken again until
    nothing remains, so that windows see aligned channels.

    Assumes: both channels show one quantity, up to a constant factor (two sensors of one rate, a
    rate and the derivative of the angle). Biased when: a filter or a sensor's own dynamics lie
    between them: then this is their mean delay in the band, not a clock error.

    Parameters
    ----------
    record : Record
        Data.
    reference, channel : str
        Channels of one unit.
    band_rad_s : (float, float), optional
        Band to use, rad/s; default: from two cycles a window to 40 % of the sampling rate.
    window_s : float, optional
        Window length, s; default: an eighth of the record.
    largest_s : float
        Largest skew that is searched, s.

    Raises
    ------
    UnknownNameError
        There is no such channel.
    UnitError
        The channels differ in unit.
    OptionError
        A band without frequencies, or a window or search range that the record does not hold.
    DataError
        A channel that does not move.

    Reference
    ---------
    Bendat & Piersol, Engineering Applications of Correlation and Spectral Analysis (2nd ed.),
    chapter 6 (time delay); Carter (1987), Coherence and time delay estimation, Proc. IEEE 75(2).

    Example
    -------
    >>> random = np.random.default_rng(0)
    >>> time_s = np.arange(4000) / 100
    >>> wave = np.cumsum(random.standard_normal(4000)) / 10
    >>> wave -= np.linspace(wave[0], wave[-1], 4000)
    >>> late = np.interp(time_s - 0.035, time_s, wave)
    >>> record = Record.from_arrays(time_s, outputs={"a": wave, "b": late})
    >>> round(estimate_skew(record, "a", "b", band_rad_s=(1.0, 30.0)).skew_s, 3)
    0.035
    """
    require_match(channel, record.unit(channel), record.unit(reference))
    step = record.sample_time_s
    length = record.n_samples // 8 if window_s is None else round(window_s / step)
    usual = 2 / (length * step) if length else 0.0, 0.4 / step
    low, high = usual if band_rad_s is None else (float(w) / (2 * np.pi) for w in band_rad_s)
    if not 16 <= length <= record.n_samples // 2 or not 0 < largest_s < length * step / 2:
        raise OptionError(
            "window or search range do not suit the record",
            found=f"window {length} samples, search ±{largest_s} s, {record.n_samples} samples",
            needed="a window of at least 16 samples that is twice in the record and holds the "
            "search range twice",
            action="give window_s or largest_s, or take a longer record",
        )
    first, second = (scipy.signal.detrend(record[name]) for name in (reference, channel))
    for name, values in ((reference, first), (channel, second)):
        if not np.std(values) > 0:
            raise DataError(f"channel {name!r} does not move", needed="a varying signal")
    skew, sign = _coarse(first, second, round(largest_s / step))
    slope = _Slope(0.0, 0.0, 0.0)
    for _ in range(ROUNDS):
        moved = sign * shifted(second, skew)
        slope = _phase_slope(*_inner(first, moved, skew), length, (low * step, high * step))
        skew += slope.lag
        if abs(slope.lag) < 1e-5:
            break
    return Skew(
        reference,
        channel,
        Estimate("skew", skew * step, "s", slope.stderr * step),
        slope.coherence,
        (2.0 * np.pi * low, 2.0 * np.pi * high),
        step,
        _findings(sign, slope, channel, reference, skew * step, largest_s),
    )


@dataclass(frozen=True)
class _Slope:
    """Lag and standard error, in samples, with the mean coherence."""

    lag: float
    stderr: float
    coherence: float


def _coarse(
    first: NDArray[np.float64], second: NDArray[np.float64], largest: int
) -> tuple[float, float]:
    """Whole samples of lag, and the sign of the relation."""
    correlation = scipy.signal.correlate(second, first, mode="full", method="fft")
    middle = first.size - 1
    near = correlation[middle - largest : middle + largest + 1]
    best = int(np.argmax(np.abs(near)))
    return float(best - largest), float(np.sign(near[best]))


def _inner(
    first: NDArray[np.float64], second: NDArray[np.float64], skew: float
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Both channels without the ends that the shift had to continue."""
    cut = int(np.ceil(abs(skew))) + 4
    return first[cut:-cut], second[cut:-cut]


def _phase_slope(
    first: NDArray[np.float64],
    second: NDArray[np.float64],
    length: int,
    band: tuple[float, float],
) -> _Slope:
    frequency, cross = _spectrum(first, second, length)
    power = _spectrum(first, first, length)[1].real
    other = _spectrum(second, second, length)[1].real
    used = (frequency >= band[0]) & (frequency <= band[1]) & (power * other > 0)
    if np.count_nonzero(used) < 3:
        raise OptionError(
            "the band holds too few frequencies",
            found=np.count_nonzero(used),
            needed="at least 3",
            action="widen band_rad_s or lengthen window_s",
        )
    frequency, cross = frequency[used], cross[used]
    coherence = np.clip(np.abs(cross) ** 2 / (power * other)[used], 1e-12, 1 - 1e-12)
    n_windows = 1 + (first.size - length) // (length - length // 2)
    n_free = n_windows / HANN_OVERLAP
    information = 2 * n_free * coherence / (1 - coherence)
    omega = 2 * np.pi * frequency
    # A lag turns the phase of the cross-spectrum by -omega lag; aligned channels never wrap it.
    total = float(np.sum(information * omega**2))
    lag = -float(np.sum(information * omega * np.angle(cross))) / total
    mean_coherence = float(np.sum(coherence * information) / np.sum(information))
    # Weights from n averages are too large by n/(n - 2) in the mean, and their scatter makes the
    # sum less exact by (n - 2)/(n - 3): moments of the inverse of a gamma of n - 1.
    scatter = n_free / max(n_free - 3, FEWEST_FREE)
    return _Slope(lag, float(np.sqrt(scatter * HANN_NEIGHBOURS / total)), mean_coherence)


def _spectrum(
    first: NDArray[np.float64], second: NDArray[np.float64], length: int
) -> tuple[NDArray[np.float64], NDArray[np.complex128]]:
    frequency, density = scipy.signal.csd(
        first,
        second,
        fs=1.0,
        window="hann",
        nperseg=length,
        noverlap=length // 2,
        detrend="constant",
    )
    return np.asarray(frequency), np.asarray(density, dtype=np.complex128)


def _findings(
    sign: float, slope: _Slope, channel: str, reference: str, skew_s: float, largest_s: float
) -> tuple[Finding, ...]:
    found = []
    if sign < 0:
        found.append(
            Finding(
                "sign-reversed",
                Light.RED,
                f"{channel} moves against {reference}",
                "check the sign convention; conditioning.flip_sign or convert_axes",
            )
        )
    if slope.coherence < 0.6:
        found.append(
            Finding(
                "skew-coherence-low",
                Light.AMBER,
                f"{channel} and {reference} are coherent by {slope.coherence:.2f} only",
                "use a record with more motion, or a narrower band",
            )
        )
    if abs(skew_s) > 0.98 * largest_s:
        found.append(
            Finding(
                "skew-at-limit",
                Light.RED,
                f"the skew lies at the limit of {largest_s} s",
                "search further",
            )
        )
    return tuple(found)


def shifted(values: NDArray[np.float64], lag_samples: float) -> NDArray[np.float64]:
    """Samples moved earlier by a fraction of samples, band-limited; the ends continued oddly."""
    position = np.asarray(np.arange(values.size) + lag_samples, dtype=np.float64)
    if float(lag_samples).is_integer():
        whole = int(lag_samples)
        padded = np.pad(values, abs(whole), mode="reflect", reflect_type="odd")
        return padded[abs(whole) + whole : abs(whole) + whole + values.size]
    pad = int(np.ceil(abs(lag_samples))) + 1
    padded = np.pad(values, pad, mode="reflect", reflect_type="odd")
    return windowed_sinc(padded, position + pad, 0.5, 1.0)


def align(record: Record, skews_s: Mapping[str, float]) -> Record:
    """Move channels earlier by their skew, by band-limited fractional delay.

    The record is cut to the span in which every channel still has samples: nothing is invented.

    Parameters
    ----------
    record : Record
        Data.
    skews_s : mapping of str to float
        Lag by channel, s, as `estimate_skew` gives it; channels left out stay.

    Returns
    -------
    Record
        Shorter by the largest skew at each end where one channel runs out.

    Raises
    ------
    UnknownNameError
        There is no such channel.
    OptionError
        A skew that is not finite.
    DataError
        A skew as long as the record.

    Reference
    ---------
    Laakso, Välimäki, Karjalainen & Laine (1996), Splitting the unit delay, IEEE Signal Processing
    Magazine 13(1).

    Example
    -------
    >>> record = Record.from_arrays([0, 1, 2, 3], outputs={"a": [0, 1, 2, 3], "b": [9, 0, 1, 2]})
    >>> align(record, {"b": 1.0})["b"].tolist()
    [0.0, 1.0, 2.0]
    """
    step = record.sample_time_s
    lags = {}
    for name, skew in skews_s.items():
        record.unit(name)
        if not np.isfinite(skew):
            raise OptionError(f"skew of {name!r} is not finite", found=skew, needed="seconds")
        lags[name] = skew / step
    # Rounding of a whole number of samples must not cost one more.
    head = int(np.ceil(max(0.0, -min(lags.values(), default=0.0)) - 1e-9))
    tail = int(np.ceil(max(0.0, max(lags.values(), default=0.0)) - 1e-9))
    if head + tail > record.n_samples - 2:
        raise DataError(
            "a skew is as long as the record",
            found=f"{max(map(abs, skews_s.values())):.6g} s",
            needed=f"well below {record.duration_s:.6g} s",
        )
    kept = slice(head, record.n_samples - tail)
    samples = {name: record[name][kept] for name in record.channels}
    for name, lag in lags.items():
        samples[name] = shifted(record[name], lag)[kept]
    done = Step("conditioning.align", {f"{k}_skew_s": float(skew) for k, skew in skews_s.items()})
    broken = any(not float(lags.get(name, 0.0)).is_integer() for name in record.inputs)
    # Steps and lines that are moved by part of a sample no longer end at the samples.
    shape = record.input_shape.without_hold() if broken and record.hold != "band_limited" else None
    return record.replace(samples, time_s=record.time_s[kept], step=done, input_shape=shape)
