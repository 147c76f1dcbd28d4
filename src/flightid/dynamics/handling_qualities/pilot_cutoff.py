"""Pilot cut-off frequency: below it lies half the power of what the hands did."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import scipy
from numpy.typing import NDArray

from flightid.conventions import Light
from flightid.errors import DataError, OptionError
from flightid.excitation.spectrum import power_spectrum
from flightid.findings import Finding
from flightid.frozen import dataclass
from flightid.record import Record
from flightid.record.several import as_records
from flightid.responses.spectrum_measures import band_rms, cutoff_frequency
from flightid.result import Result
from flightid.table import Table
from flightid.uncertainty.estimate import Estimate, Reading, estimate_table
from flightid.uncertainty.quantiles import shown
from flightid.uncertainty.uneven import LogarithmicEnds

TAPER = 0.1
"""Share of a record in its two cosine ends: steep spectra leak without it."""
NEIGHBOURHOOD = 1.6
"""The density at the cut-off is the mean from the cut-off over this to the cut-off times this."""
FIRST_HARMONICS = 3
FEWEST_PERIODS = 25.0
"""Periods of the cut-off in all records, below which intervals cover less than they say."""
SHARE_AT_END = 0.45
"""Cut-off over the band's end beyond which the power is white over the band; white has a half."""
Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False, repr=False)
class PilotCutoff(Result, schema="flightid.pilot_cutoff/1"):
    """Result of `pilot_cutoff`.

    Attributes
    ----------
    channel, unit : str
        Control, and its unit.
    cutoff : Estimate
        Pilot cut-off frequency, rad/s, with its 95 % interval.
    rms : Estimate
        Root mean square of the control over the band.
    omega_rad_s, density : ndarray, shape (n_f,)
        One-sided spectrum of all records together, unit² per Hz.
    findings : tuple of Finding

    Example
    -------
    >>> PilotCutoff("lat", "1", Estimate("pilot cut-off frequency", 2.0, "rad/s", 0.2),
    ...             Estimate("rms", 0.1), np.ones(2), np.ones(2))
    PilotCutoff(lat, 2 (1.608 to 2.392) rad/s)
    """

    channel: str
    unit: str
    cutoff: Reading
    rms: Reading
    omega_rad_s: Array
    density: Array
    findings: tuple[Finding, ...] = ()

    def __repr__(self) -> str:
        """Channel and cut-off on one line."""
        return f"PilotCutoff({self.channel}, {self.cutoff.text})"

    def summary(self, *, level: float | None = None) -> Table:
        """Table of cut-off and root mean square."""
        level = shown(level)
        notes = tuple(map(str, self.findings))
        return estimate_table(
            f"Pilot's use of {self.channel}", (self.cutoff, self.rms), notes, level=level
        )


@dataclass(frozen=True)
class _Periodogram:
    """Spectrum of one tapered record, with the factor by which its taper adds variance."""

    omega: Array
    density: Array
    n_samples: int
    variance_factor: float

    @property
    def step(self) -> float:
        """Spacing of the harmonics, rad/s."""
        return float(self.omega[1])


def pilot_cutoff(
    records: Record | Sequence[Record],
    channel: str,
    *,
    band_rad_s: tuple[float, float] | None = None,
) -> PilotCutoff:
    """Frequency below which half the mean square of a control lies.

    Parameters
    ----------
    records : Record or sequence of Record
        Flights of one task; longer ones count more.
    channel : str
        Control as the pilot moved it.
    band_rad_s : tuple of float, optional
        Band whose power counts, rad/s; default: all. Begin it above slow trim changes,
        which are no tracking.

    Raises
    ------
    DataError
        A control that does not move, or a band that the records do not hold.
    OptionError
        The band has no meaning.
    UnknownNameError
        A record lacks the channel.

    Assumes
    -------
    The control is stationary and nearly Gaussian: biased low by slow trim changes, and its interval
    is too narrow for a few large inputs on a quiet background. A designed sweep is no pilot's work:
    its cut-off says what was flown, not how tightly.

    Reference
    ---------
    Tischler & Remple, *Aircraft and Rotorcraft System Identification*, 2nd ed., section 5.5 (half
    of the mean square, 0.707 of the root mean square); interval: variance of integrals of a
    periodogram, Priestley, *Spectral Analysis and Time Series* (1981), section 6.2.

    Example
    -------
    >>> import flightid as fid
    >>> time_s = np.arange(6000) * 0.02
    >>> hands = np.random.default_rng(1).standard_normal(6000)
    >>> record = fid.Record.from_arrays(time_s, inputs={"lat": hands})
    >>> found = pilot_cutoff(record, "lat")  # white: half of Nyquist's 157 rad/s
    >>> bool(found.cutoff.interval95[0] < 78.5 < found.cutoff.interval95[1])
    True
    """
    given = as_records(records)
    if not given:
        raise DataError("there is no record", needed="one or more")
    parts = [_periodogram(each, channel) for each in given]
    low, high = _band(parts, band_rad_s)
    omega, density = _together(parts, low, high)
    cutoff = cutoff_frequency(omega, density)
    rms = band_rms(omega, density)
    of_cutoff, of_rms = _relative_errors(parts, omega, density, cutoff)
    unit = given[0].unit(channel)
    return PilotCutoff(
        channel,
        unit,
        _positive("pilot cut-off frequency", cutoff, "rad/s", of_cutoff),
        _positive("root mean square", rms, unit, of_rms),
        omega,
        density,
        _judge(channel, parts, cutoff, float(omega[-1])),
    )


def _periodogram(record: Record, channel: str) -> _Periodogram:
    values = np.asarray(record[channel], dtype=np.float64)
    moved = values - values.mean()
    if not np.any(np.abs(moved) > 1e-12 * max(1e-300, float(np.max(np.abs(values))))):
        raise DataError(f"{channel} does not move", found="a constant", needed="a pilot's control")
    taper = scipy.signal.windows.tukey(len(moved), TAPER)
    power = np.mean(taper**2)
    shaped = taper * (moved - np.sum(taper * moved) / np.sum(taper)) / np.sqrt(power)
    spectrum = power_spectrum(shaped[None], record.sample_time_s, (channel,), record.unit(channel))
    factor = float(np.mean(taper**4) / power**2)
    density = spectrum.density[0].copy()
    # The mean went with the trim: below the first harmonic lies what lies at the first few.
    density[0] = np.mean(density[1 : 1 + FIRST_HARMONICS])
    return _Periodogram(spectrum.omega_rad_s, density, len(values), factor)


def _band(parts: Sequence[_Periodogram], given: tuple[float, float] | None) -> tuple[float, float]:
    lowest = max(part.step for part in parts)
    highest = min(float(part.omega[-1]) for part in parts)
    if given is None:
        return 0.0, highest
    low, high = given
    if not (np.isfinite(high) and 0.0 < low < high):
        raise OptionError("band_rad_s has no meaning", found=given, needed="0 < low < high")
    if low < 0.999 * lowest or high > 1.001 * highest:
        raise DataError(
            "the records do not hold the band",
            found=f"{low:.4g} to {high:.4g} rad/s",
            needed=f"a part of {lowest:.4g} to {highest:.4g} rad/s",
        )
    return low, high


def _together(parts: Sequence[_Periodogram], low: float, high: float) -> tuple[Array, Array]:
    """Mean density on the finest grid, records weighted by their lengths."""
    finest = max(parts, key=lambda part: part.n_samples).omega
    inner = finest[(finest > low) & (finest < high)]
    omega = np.concatenate([[low], inner, [high]])
    total = sum(part.n_samples for part in parts)
    density = sum(
        part.n_samples / total * np.interp(omega, part.omega, part.density) for part in parts
    )
    return omega, np.asarray(density)


def _relative_errors(
    parts: Sequence[_Periodogram], omega: Array, density: Array, cutoff: float
) -> tuple[float, float]:
    """Standard errors of cut-off and root mean square over their values.

    The cut-off is where ∫ g S vanishes for g = ½ below it and −½ above; ordinates of a periodogram
    are independent with variance S², and their own squares, halved, estimate it.
    """
    total = sum(part.n_samples for part in parts)
    variance = 0.0
    for part in parts:
        inside = (part.omega >= omega[0]) & (part.omega <= omega[-1])
        squares = 0.5 * float(np.sum(part.density[inside] ** 2)) * part.step
        variance += (part.n_samples / total) ** 2 * part.variance_factor * part.step * squares
    running = scipy.integrate.cumulative_trapezoid(density, omega, initial=0)
    low = max(cutoff / NEIGHBOURHOOD, float(omega[0]))
    high = min(cutoff * NEIGHBOURHOOD, float(omega[-1]))
    near = float(np.interp(high, omega, running) - np.interp(low, omega, running)) / (high - low)
    deviation = float(np.sqrt(variance))
    return 0.5 * deviation / (near * cutoff), 0.5 * deviation / float(running[-1])


def _positive(name: str, value: float, unit: str, relative: float) -> Estimate:
    """An estimate of what is positive: its interval is even on a logarithmic scale."""
    return Estimate(name, value, unit, relative * value, ends=LogarithmicEnds(value, relative))


def _judge(
    channel: str, parts: Sequence[_Periodogram], cutoff: float, end: float
) -> tuple[Finding, ...]:
    found = []
    periods = sum(cutoff / part.step for part in parts)
    if periods < FEWEST_PERIODS:
        found.append(
            Finding(
                "few-periods",
                Light.AMBER,
                f"{channel}: the records hold {periods:.1f} periods of the cut-off",
                f"fly longer, {FEWEST_PERIODS:g} periods at least, or begin the band above slow "
                "trim changes",
            )
        )
    if cutoff > SHARE_AT_END * end:
        found.append(
            Finding(
                "power-to-the-end",
                Light.AMBER,
                f"{channel}: half the power lies above {cutoff:.3g} rad/s, near the end of the "
                f"band at {end:.3g} rad/s",
                "look for noise or quantisation on the channel, and end the band below it",
            )
        )
    return tuple(found)
