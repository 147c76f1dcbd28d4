"""Frequency sweeps: the exponential one of Tischler & Remple, and ArduPilot's chirp as flown.

ArduPilot's waveform is computed by `ardupilot_chirp.rs`.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from flightid import _native
from flightid.errors import OptionError
from flightid.excitation.checks import (
    require_band,
    require_not_negative,
    require_positive,
    whole_samples,
)
from flightid.excitation.excitation import Excitation
from flightid.recursive_filter import filtered

C1, C2 = 4.0, 0.0187
"""Growth of the sweep (Tischler & Remple, section 5.11); C2 (exp C1 - 1) is 1.002."""

ARDUPILOT_DELAY_S = 1.0
"""Copter's wait between entering the mode and the first moment of the chirp."""


def sweep(
    *,
    band_rad_s: tuple[float, float],
    amplitude: float,
    duration_s: float,
    sample_rate_hz: float,
    hold_cycles: float = 2.0,
    fade_in_s: float | None = None,
    fade_out_s: float | None = None,
    noise_fraction: float = 0.0,
    seed: int = 0,
    name: str = "u",
    unit: str = "1",
) -> Excitation:
    """Exponential frequency sweep with a dwell at its lowest frequency.

    After `hold_cycles` cycles at the lowest frequency it runs, over the rest T of the record, as
    ``omega = low + K (high - low)``, ``K = 0.0187 (exp(4 t/T) - 1)``: most of the time goes to low
    frequencies, where few cycles fit.

    Parameters
    ----------
    band_rad_s : tuple of float
        Lowest and highest frequency, rad/s.
    amplitude : float
        Largest magnitude of the signal, in `unit`, noise included.
    duration_s : float
        Length with the dwell and both fades, s; a whole number of samples.
    sample_rate_hz : float
        Samples per second, Hz.
    hold_cycles : float
        Cycles at the lowest frequency before the sweep.
    fade_in_s, fade_out_s : float, optional
        Raised-cosine fades, s; default: a quarter of the slowest cycle in, two of the fastest out.
    noise_fraction : float
        Root mean square of low-passed noise over `amplitude`; it enriches the spectrum and breaks
        the correlation with other inputs. The sum is scaled back to `amplitude`.
    seed : int
        Seed of the noise.
    name, unit : str
        Label of the input.

    Raises
    ------
    OptionError
        An option without meaning, or a record too short for dwell and fades.

    Reference
    ---------
    Tischler & Remple, Aircraft and Rotorcraft System Identification, 2nd ed., section 5.11.

    Example
    -------
    >>> sweep(band_rad_s=(0.5, 20.0), amplitude=0.1, duration_s=60.0, sample_rate_hz=50.0)
    Excitation('sweep', 1 input, 3000 samples, 50 Hz, 60 s, relative peak factor 1.01)
    """
    low, high = require_band(band_rad_s, sample_rate_hz)
    require_positive(amplitude=amplitude, duration_s=duration_s)
    fade_in = 0.5 * math.pi / low if fade_in_s is None else fade_in_s
    fade_out = 4 * math.pi / high if fade_out_s is None else fade_out_s
    require_not_negative(
        hold_cycles=hold_cycles,
        fade_in_s=fade_in,
        fade_out_s=fade_out,
        noise_fraction=noise_fraction,
    )
    hold_s = hold_cycles * 2 * math.pi / low
    if hold_s + fade_out >= duration_s or fade_in + fade_out > duration_s:
        raise OptionError(
            "the record is too short for the dwell and the fades",
            found=f"{duration_s:.4g} s",
            needed=f"more than {max(hold_s + fade_out, fade_in + fade_out):.4g} s",
            action="lengthen the record, raise the lowest frequency or hold fewer cycles",
        )
    count = whole_samples(duration_s, sample_rate_hz, "duration")
    time_s = np.arange(count) / sample_rate_hz
    phase, _ = sweep_phase(time_s, low, high, hold_s=hold_s, duration_s=duration_s)
    signal = np.sin(phase)
    if noise_fraction > 0:
        signal = signal + noise_fraction * _coloured_noise(count, high / sample_rate_hz, seed)
    signal = signal * _fades(time_s, duration_s, fade_in, fade_out)
    largest = float(np.max(np.abs(signal)))
    options = {
        "amplitude": amplitude,
        "duration_s": duration_s,
        "hold_cycles": hold_cycles,
        "fade_in_s": fade_in,
        "fade_out_s": fade_out,
        "noise_fraction": noise_fraction,
        "seed": seed,
    }
    signals = amplitude * (signal / max(1.0, largest))[None, :]
    return Excitation(signals, 1 / sample_rate_hz, (name,), unit, "sweep", (low, high), options)


def sweep_phase(
    time_s: NDArray[np.float64], low: float, high: float, *, hold_s: float, duration_s: float
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Phase in rad (its integral in closed form) and frequency in rad/s of the sweep."""
    span = duration_s - hold_s
    swept = np.maximum(time_s - hold_s, 0.0)
    growth = np.exp(C1 * swept / span) - 1.0
    phase = low * time_s + (high - low) * C2 * (span / C1 * growth - swept)
    return phase, low + (high - low) * C2 * growth


def ardupilot_chirp(
    *,
    magnitude: float,
    start_hz: float,
    stop_hz: float,
    record_s: float,
    fade_in_s: float,
    fade_out_s: float,
    axis: int = 10,
    sample_rate_hz: float = 400.0,
    whole_run: bool = False,
    single_precision: bool = True,
    name: str = "excitation",
) -> Excitation:
    """ArduPilot's system-identification chirp, as SIDD.Targ logs it.

    Two cycles at the start frequency, then exponential growth to the stop frequency at the end of
    the record, under raised-cosine fades.

    Parameters
    ----------
    magnitude : float
        SID_MAGNITUDE, in the unit of the axis.
    start_hz, stop_hz : float
        SID_F_START_HZ and SID_F_STOP_HZ, Hz.
    record_s, fade_in_s, fade_out_s : float
        SID_T_REC, SID_T_FADE_IN and SID_T_FADE_OUT, s.
    axis : int
        SID_AXIS, 1 to 19; decides the unit (deg, deg/s, 1, m, m/s).
    sample_rate_hz : float
        Main loop rate, Hz.
    whole_run : bool
        Include Copter's first second and the silent end of a run, as one log of the mode holds.
    single_precision : bool
        Compute as the autopilot does; False gives the exact waveform.
    name : str
        Name of the input.

    Raises
    ------
    OptionError
        A setting that the autopilot refuses: a record no longer than the two cycles, an axis
        that does not exist.

    Reference
    ---------
    ArduPilot, libraries/AP_Math/chirp.cpp and ArduCopter/mode_systemid.cpp (Copter 4.6).

    Example
    -------
    >>> chirp = ardupilot_chirp(magnitude=0.15, start_hz=0.05, stop_hz=5.0, record_s=130.0,
    ...                         fade_in_s=5.0, fade_out_s=5.0)
    >>> round(float(chirp.signals[0, 2000]), 6)
    0.15
    """
    unit = ardupilot_axis_unit(axis)
    require_positive(magnitude=magnitude, sample_rate_hz=sample_rate_hz, start_hz=start_hz)
    span_s = record_s
    delay_s = 0.0
    if whole_run:
        delay_s = ARDUPILOT_DELAY_S
        span_s += delay_s + fade_in_s + 2.0 / start_hz + fade_out_s
    stamps = np.arange(round(span_s * sample_rate_hz) + 1) / sample_rate_hz
    values, _ = _native.ardupilot_chirp(
        stamps - delay_s,
        magnitude,
        start_hz,
        stop_hz,
        record_s,
        fade_in_s,
        fade_out_s,
        None,
        single_precision,
    )
    edges = 2 * math.pi * min(start_hz, stop_hz), 2 * math.pi * max(start_hz, stop_hz)
    require_band(edges, sample_rate_hz)
    options = {
        "axis": axis,
        "magnitude": magnitude,
        "start_hz": start_hz,
        "stop_hz": stop_hz,
        "record_s": record_s,
        "fade_in_s": fade_in_s,
        "fade_out_s": fade_out_s,
        "whole_run": whole_run,
        "single_precision": single_precision,
    }
    return Excitation(
        values[None, :], 1 / sample_rate_hz, (name,), unit, "ardupilot_chirp", edges, options
    )


def ardupilot_axis_unit(axis: int) -> str:
    """Unit of SID_MAGNITUDE for an axis; yaw is commanded as a rate.

    Raises
    ------
    OptionError
        There is no such axis.
    """
    groups = {
        "deg": (1, 2, 4, 5),
        "deg/s": (3, 6, 7, 8, 9),
        "1": (10, 11, 12, 13),
        "m": (14, 15),
        "m/s": (16, 17, 18, 19),
    }
    for unit, axes in groups.items():
        if axis in axes:
            return unit
    raise OptionError("SID_AXIS has no such value", found=axis, needed="1 to 19")


def _fades(
    time_s: NDArray[np.float64], duration_s: float, fade_in_s: float, fade_out_s: float
) -> NDArray[np.float64]:
    window = np.ones_like(time_s)
    if fade_in_s > 0:
        rising = time_s < fade_in_s
        window[rising] *= 0.5 - 0.5 * np.cos(np.pi * time_s[rising] / fade_in_s)
    if fade_out_s > 0:
        # The last sample is the one that ends in trim.
        left_s = np.maximum(duration_s - (time_s[1] - time_s[0]) - time_s, 0.0)
        falling = left_s < fade_out_s
        window[falling] *= 0.5 - 0.5 * np.cos(np.pi * left_s[falling] / fade_out_s)
    return window


def _coloured_noise(count: int, cutoff_rad: float, seed: int) -> NDArray[np.float64]:
    """First-order low-passed Gaussian noise of unit deviation; cutoff in rad per sample."""
    pole = math.exp(-cutoff_rad)
    white = np.random.default_rng(seed).standard_normal(count)
    return np.asarray(math.sqrt(1 - pole**2) * filtered([1.0], [1.0, -pole], white))
