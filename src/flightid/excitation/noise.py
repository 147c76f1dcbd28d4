"""Random inputs: band-limited Gaussian noise, and uniform levels held for a clock period."""

from __future__ import annotations

import math

import numpy as np

from flightid.errors import OptionError
from flightid.excitation.checks import (
    require_band,
    require_not_negative,
    require_positive,
    whole_samples,
)
from flightid.excitation.excitation import Excitation
from flightid.excitation.prbs import HALF_POWER


def noise(
    *,
    band_rad_s: tuple[float, float],
    amplitude: float,
    duration_s: float,
    sample_rate_hz: float,
    seed: int,
    names: tuple[str, ...] = ("u",),
    unit: str = "1",
) -> Excitation:
    """Gaussian noise whose power lies wholly inside a band, independent between inputs.

    Made in the frequency domain: every harmonic of the record inside the band gets a complex
    Gaussian amplitude, all others none. It can be repeated without a jump.

    Parameters
    ----------
    band_rad_s : tuple of float
        Lowest and highest frequency, rad/s.
    amplitude : float
        Largest magnitude of each input, in `unit`.
    duration_s : float
        Length, s; a whole number of samples.
    sample_rate_hz : float
        Samples per second, Hz.
    seed : int
        Seed; the same seed gives the same samples.
    names : tuple of str
        Inputs.
    unit : str
        Unit of the inputs.

    Raises
    ------
    OptionError
        An option without meaning, or a band without a harmonic of the record.

    Reference
    ---------
    Pintelon & Schoukens, System Identification: A Frequency Domain Approach, 2nd ed., section 5.2.

    Example
    -------
    >>> noise(band_rad_s=(1.0, 12.0), amplitude=0.1, duration_s=60.0, sample_rate_hz=50.0,
    ...       seed=1).peak
    array([0.1])
    """
    low, high = require_band(band_rad_s, sample_rate_hz)
    require_positive(amplitude=amplitude)
    require_not_negative(seed=seed)
    count = whole_samples(duration_s, sample_rate_hz, "duration")
    omega = 2 * np.pi * np.fft.rfftfreq(count, 1 / sample_rate_hz)
    inside = (omega >= low) & (omega <= high)
    if not np.any(inside) or not names:
        raise OptionError(
            "no harmonic of the record lies inside the band",
            found=f"{duration_s:.4g} s, {low:.4g} to {high:.4g} rad/s, {len(names)} inputs",
            needed="a longer record or a wider band, and one input or more",
        )
    random = np.random.default_rng(seed)
    parts = random.standard_normal((len(names), 2, int(np.count_nonzero(inside))))
    transform = np.zeros((len(names), omega.size), dtype=np.complex128)
    transform[:, inside] = parts[:, 0] + 1j * parts[:, 1]
    signals = np.fft.irfft(transform, count, axis=1)
    signals *= amplitude / np.max(np.abs(signals), axis=1, keepdims=True)
    options = {"amplitude": amplitude, "duration_s": duration_s, "seed": seed}
    return Excitation(
        signals, 1 / sample_rate_hz, tuple(names), unit, "noise", (low, high), options
    )


def uniform_noise(
    *,
    clock_hz: float,
    amplitude: float,
    duration_s: float,
    sample_rate_hz: float,
    seed: int,
    names: tuple[str, ...] = ("u",),
    unit: str = "1",
) -> Excitation:
    """Independent uniform levels between -amplitude and amplitude, each held for a clock period.

    It visits all amplitudes, which a nonlinear model needs and a two-level sequence does not give.

    Parameters
    ----------
    clock_hz : float
        Levels per second, Hz; half the power lies below 0.443 of it.
    amplitude : float
        Largest possible level, in `unit`.
    duration_s : float
        Length, s; a whole number of samples.
    sample_rate_hz : float
        Samples per second, Hz; a whole multiple of the clock.
    seed : int
        Seed; the same seed gives the same samples.
    names : tuple of str
        Inputs, independent of one another.
    unit : str
        Unit of the inputs.

    Raises
    ------
    OptionError
        An option without meaning, or a sample rate that is not a multiple of the clock.

    Reference
    ---------
    Nelles, Nonlinear System Identification, section 17.7 (amplitude-modulated sequences).

    Example
    -------
    >>> uniform_noise(clock_hz=4.0, amplitude=1.0, duration_s=60.0, sample_rate_hz=20.0,
    ...               seed=1).kind
    'uniform noise'
    """
    require_positive(clock_hz=clock_hz, amplitude=amplitude)
    require_not_negative(seed=seed)
    held = whole_samples(1 / clock_hz, sample_rate_hz, "one level at this clock")
    count = whole_samples(duration_s, sample_rate_hz, "duration")
    random = np.random.default_rng(seed)
    levels = random.uniform(-amplitude, amplitude, (len(names), math.ceil(count / held)))
    signals = np.repeat(levels, held, axis=1)[:, :count]
    band = (2 * math.pi / duration_s, 2 * math.pi * HALF_POWER * clock_hz)
    options = {
        "clock_hz": clock_hz,
        "amplitude": amplitude,
        "duration_s": duration_s,
        "seed": seed,
    }
    return Excitation(
        signals, 1 / sample_rate_hz, tuple(names), unit, "uniform noise", band, options
    )
