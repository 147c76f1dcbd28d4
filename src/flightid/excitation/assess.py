"""The forecast: what an excitation does to a guessed vehicle, frequency by frequency."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from flightid.errors import OptionError
from flightid.excitation import verdicts
from flightid.excitation.checks import require_positive
from flightid.excitation.excitation import COVERAGE_POINTS, Excitation
from flightid.excitation.plan import AxisForecast, Limits, Plan
from flightid.excitation.spectrum import smoothed_matrix
from flightid.excitation.vehicle import RateAxis

OVERLAP_FACTOR = math.sqrt(0.55)
"""Random error of half-overlapped Hann windows over that of separate ones."""
LEAST_CYCLES_IN_WINDOW = 2.0
LEAST_COHERENCE = 1e-12
"""Floor of predicted coherence: a random error of a million says enough."""


def assess(
    excitation: Excitation,
    vehicle: RateAxis | Mapping[str, RateAxis],
    *,
    band_rad_s: tuple[float, float] | None = None,
    limits: Limits | None = None,
    n_records: int = 2,
) -> Plan:
    """Predict what an excitation would do to a guessed vehicle and what could be identified.

    Parameters
    ----------
    excitation : Excitation
        What would be flown.
    vehicle : RateAxis or mapping of str to RateAxis
        Guess for every input, or by input name.
    band_rad_s : tuple of float, optional
        Band in which a response is wanted, rad/s; default: that of the excitation.
    limits : Limits, optional
        What the vehicle may do; the defaults of `Limits`.
    n_records : int
        Times it is flown.

    Raises
    ------
    OptionError
        A guess is missing, or no record is flown.
    ModelError
        The loop of a guess is unstable.

    Assumes
    -------
    Axes that do not couple, white noise on the rate, no turbulence and no saturation: errors in
    flight are larger. The bounds treat the total input as known.

    Reference
    ---------
    Tischler & Remple, Aircraft and Rotorcraft System Identification, 2nd ed., sections 5 and 7;
    Bendat & Piersol, Random Data, 4th ed., table 9.6 (random error); Klein & Morelli, Aircraft
    System Identification, section 9.1 (Cramér-Rao bound of a design).

    Example
    -------
    >>> from flightid.excitation.sweep import sweep
    >>> made = sweep(band_rad_s=(1.0, 20.0), amplitude=0.05, duration_s=60.0, sample_rate_hz=100.0)
    >>> assess(made, RateAxis(gain=10.0, time_constant_s=0.1, rate_feedback=0.1,
    ...                       attitude_feedback_per_s=4.0))
    Plan('sweep', 2 × 60 s, 1 to 20 rad/s, go)
    """
    if n_records < 1:
        raise OptionError("no record is flown", found=n_records, needed="one or more")
    band = excitation.band_rad_s if band_rad_s is None else band_rad_s
    low = max(band[0], 2 * math.pi / excitation.duration_s)
    band = (low, band[1])
    allowed = Limits() if limits is None else limits
    vehicles = _by_input(vehicle, excitation.names)
    windows = window_lengths(band, excitation.duration_s, n_records)
    omega = np.geomspace(*band, COVERAGE_POINTS)
    axes = tuple(
        _forecast(excitation, index, vehicles[name], omega, windows, n_records)
        for index, name in enumerate(excitation.names)
    )
    draft = Plan(excitation, band, n_records, vehicles, allowed, windows, omega, axes)
    findings = (*excitation.findings, *verdicts.go_no_go(draft))
    return replace(draft, findings=findings)


def window_lengths(
    band_rad_s: tuple[float, float], duration_s: float, n_records: int
) -> tuple[float, ...]:
    """Five window lengths for a composite estimate, longest first.

    The longest is half a record and a fifth of all records (five independent averages), the
    shortest twenty cycles of the highest frequency. None where the longest does not hold two
    cycles of the lowest frequency.

    Parameters
    ----------
    band_rad_s : tuple of float
        Lowest and highest frequency, rad/s.
    duration_s : float
        Length of one record, s.
    n_records : int
        Number of records.

    Returns
    -------
    tuple of float
        Lengths, s; one where longest and shortest meet.

    Raises
    ------
    OptionError
        A frequency or duration that is not positive.

    Reference
    ---------
    Tischler & Remple, Aircraft and Rotorcraft System Identification, 2nd ed., section 7.9.

    Example
    -------
    >>> [round(window, 2) for window in window_lengths((1.0, 20.0), 90.0, 2)]
    [36.0, 23.27, 15.04, 9.72, 6.28]
    """
    low, high = band_rad_s
    require_positive(low=low, high=high, duration_s=duration_s, n_records=n_records)
    longest = min(duration_s / 2, n_records * duration_s / 5)
    shortest = 20 * 2 * math.pi / high
    if longest < LEAST_CYCLES_IN_WINDOW * 2 * math.pi / low:
        return ()
    if shortest >= longest:
        return (longest,)
    return tuple(float(length) for length in np.geomspace(longest, shortest, 5))


def _by_input(
    vehicle: RateAxis | Mapping[str, RateAxis], names: tuple[str, ...]
) -> dict[str, RateAxis]:
    if isinstance(vehicle, RateAxis):
        return dict.fromkeys(names, vehicle)
    missing = [name for name in names if name not in vehicle]
    if missing:
        raise OptionError(
            "an input has no guess of its axis",
            found=f"none for {', '.join(missing)}",
            needed="a RateAxis for each input",
        )
    return {name: vehicle[name] for name in names}


def _forecast(
    excitation: Excitation,
    index: int,
    vehicle: RateAxis,
    omega: NDArray[np.float64],
    windows: tuple[float, ...],
    n_records: int,
) -> AxisForecast:
    dt = excitation.sample_time_s
    flown = vehicle.fly(excitation.signals[index], dt)
    control = flown["input"]
    density = np.real(smoothed_matrix(control[None, :], dt, omega)[0, 0])
    signal = np.abs(vehicle.response(omega)) ** 2 * density
    noise_density = vehicle.noise_density(omega, dt)
    coherence = np.maximum(signal / (signal + noise_density), LEAST_COHERENCE)
    total_s = n_records * excitation.duration_s
    averages = total_s / _window_at(omega, windows, excitation.duration_s)
    error = OVERLAP_FACTOR * np.sqrt((1 - coherence) / (2 * averages * coherence))
    return AxisForecast(
        excitation.names[index],
        density,
        coherence,
        error,
        float(np.max(np.abs(control))),
        float(np.max(np.abs(np.diff(control)))) / dt,
        float(np.max(np.abs(flown["rate"]))),
        float(np.max(np.abs(flown["attitude"]))),
        _bounds(n_records * vehicle.information(control, dt)),
    )


def _window_at(
    omega: NDArray[np.float64], windows: tuple[float, ...], duration_s: float
) -> NDArray[np.float64]:
    """Shortest window that holds two cycles; the whole record where none does."""
    chosen = np.full(omega.size, max(windows, default=duration_s))
    for window in sorted(windows, reverse=True):
        chosen[omega >= LEAST_CYCLES_IN_WINDOW * 2 * np.pi / window] = window
    return chosen


def _bounds(information: NDArray[np.float64]) -> tuple[float, float, float] | None:
    scale = np.sqrt(np.diag(information))
    if np.any(scale == 0):
        return None
    # Scaled to a unit diagonal: parameters of very different size are no reason for singularity.
    unit = information / np.outer(scale, scale)
    if np.linalg.cond(unit) > 1 / np.finfo(np.float64).eps:
        return None
    gain, lag, delay = np.sqrt(np.diag(np.linalg.inv(unit))) / scale
    return float(gain), float(lag), float(delay)
