"""Pseudo-random binary sequences of maximal length, clocked below the sample rate."""

from __future__ import annotations

import math

import numpy as np
import scipy
from numpy.typing import ArrayLike, NDArray

from flightid.errors import OptionError
from flightid.excitation.checks import require_positive, whole_samples
from flightid.excitation.excitation import Excitation

LOWEST_ORDER, HIGHEST_ORDER = 2, 20
HALF_POWER = 0.443
"""Half-power frequency over the clock frequency: sinc²(0.443) = 1/2."""


def prbs(
    *,
    order: int,
    clock_hz: float,
    amplitude: float,
    sample_rate_hz: float,
    periods: int = 1,
    names: tuple[str, ...] = ("u",),
    unit: str = "1",
) -> Excitation:
    """Two-level sequence of maximal length 2^order - 1 from a shift register.

    Over a period its autocorrelation has two values only, 1 and -1/(2^order - 1). Several inputs
    get the same sequence moved by equal parts of a period, so that they are nearly uncorrelated
    over responses shorter than one part.

    Parameters
    ----------
    order : int
        Stages of the shift register, 2 to 20.
    clock_hz : float
        Levels per second, Hz; half the power lies below 0.443 of it.
    amplitude : float
        Level, in `unit`.
    sample_rate_hz : float
        Samples per second, Hz; a whole multiple of the clock.
    periods : int
        Repetitions of the sequence.
    names : tuple of str
        Inputs.
    unit : str
        Unit of the inputs.

    Returns
    -------
    Excitation
        Its band runs from one cycle in a period to the half-power frequency.

    Raises
    ------
    OptionError
        Order out of range, or a sample rate that is not a multiple of the clock.

    Assumes
    -------
    A linear system: two levels cannot show an even nonlinearity, and the square of this input is
    constant, so correlation tests with the squared input cannot be made. Use `uniform_noise` then.

    Reference
    ---------
    Ljung, System Identification, 2nd ed., section 13.3.

    Example
    -------
    >>> prbs(order=7, clock_hz=10.0, amplitude=0.1, sample_rate_hz=50.0)
    Excitation('prbs', 1 input, 635 samples, 50 Hz, 12.7 s, relative peak factor 0.71)
    """
    require_positive(clock_hz=clock_hz, amplitude=amplitude, sample_rate_hz=sample_rate_hz)
    if not LOWEST_ORDER <= order <= HIGHEST_ORDER or periods < 1 or not names:
        raise OptionError(
            "no such sequence",
            found=f"order {order}, {periods} periods, {len(names)} inputs",
            needed=f"order {LOWEST_ORDER} to {HIGHEST_ORDER}, one period and one input or more",
        )
    held = whole_samples(1 / clock_hz, sample_rate_hz, "one level at this clock")
    sequence = 2.0 * scipy.signal.max_len_seq(order)[0].astype(np.float64) - 1.0
    length = sequence.size
    moved = [np.roll(sequence, (index * length) // len(names)) for index in range(len(names))]
    signals = amplitude * np.repeat(np.tile(np.array(moved), periods), held, axis=1)
    band = (2 * math.pi * clock_hz / length, 2 * math.pi * HALF_POWER * clock_hz)
    options = {
        "order": order,
        "clock_hz": clock_hz,
        "amplitude": amplitude,
        "periods": periods,
    }
    return Excitation(signals, 1 / sample_rate_hz, tuple(names), unit, "prbs", band, options)


def held_density(
    omega_rad_s: ArrayLike, *, clock_hz: float, mean_square: float
) -> NDArray[np.float64]:
    """Power spectral density of independent levels held for a clock period.

    ``G = 2 (mean square / clock) sinc²(f / clock)``, one-sided, for `prbs` (many bins averaged)
    and `uniform_noise`.

    Parameters
    ----------
    omega_rad_s : array_like
        Frequencies, rad/s.
    clock_hz : float
        Levels per second, Hz.
    mean_square : float
        Mean square of the levels, unit²: amplitude² for two levels, a third of it for uniform.

    Returns
    -------
    ndarray
        Density, unit²/Hz.

    Raises
    ------
    OptionError
        Clock or mean square not positive.

    Reference
    ---------
    Bendat & Piersol, Random Data, 4th ed., section 5.2 (transform of a rectangular pulse).

    Example
    -------
    >>> held_density([0.0], clock_hz=10.0, mean_square=1.0)
    array([0.2])
    """
    require_positive(clock_hz=clock_hz, mean_square=mean_square)
    cycles = np.asarray(omega_rad_s, dtype=np.float64) / (2 * np.pi * clock_hz)
    return np.asarray(2 * mean_square / clock_hz * np.sinc(cycles) ** 2)
