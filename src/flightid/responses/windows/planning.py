"""What an estimate will do: frequencies and window lengths from the options and the records."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from flightid.errors import DataError, OptionError
from flightid.responses.windows.defaults import (
    CYCLES_AT_LOWEST,
    MINIMUM_LENGTH,
    automatic_windows,
    default_frequencies,
    longest_window,
    plan_of,
)
from flightid.responses.windows.samples import Samples
from flightid.responses.windows.transform import WindowPlan


def plan_frequencies(
    omega_rad_s: ArrayLike | None,
    band_rad_s: tuple[float, float] | None,
    n_omega: int,
    samples: Samples,
) -> NDArray[np.float64]:
    """Frequencies of the estimate, rad/s, increasing.

    Raises
    ------
    OptionError
        A frequency at or beyond the Nyquist frequency, or at or below zero; a band beside
        frequencies.
    """
    if n_omega < 2:
        raise OptionError("n_omega is too small", found=n_omega, needed="two frequencies or more")
    if omega_rad_s is not None and band_rad_s is not None:
        raise OptionError(
            "band_rad_s and omega_rad_s were both given", needed="a band, or the frequencies"
        )
    if omega_rad_s is not None:
        omega = np.unique(np.atleast_1d(np.asarray(omega_rad_s, dtype=np.float64)))
    elif band_rad_s is not None:
        low, high = map(float, band_rad_s)
        if not 0.0 < low < high:
            raise OptionError(
                "band_rad_s is no band", found=band_rad_s, needed="(low, high), 0 < low < high"
            )
        omega = np.geomspace(low, high, n_omega)
    else:
        longest_s = longest_window(samples.durations_s)
        return default_frequencies(longest_s, samples.sample_time_s, n_omega)
    nyquist = math.pi / samples.sample_time_s
    if not omega.size or not np.all(np.isfinite(omega)) or omega[0] <= 0.0 or omega[-1] >= nyquist:
        raise OptionError(
            "frequencies lie outside what the sample time can show",
            found=f"{omega.min(initial=math.inf):.4g} to {omega.max(initial=-math.inf):.4g} rad/s",
            needed=f"above 0 and below {nyquist:.4g} rad/s",
        )
    return omega


def plan_windows(
    window_s: str | float | Sequence[float], samples: Samples, omega_max: float, shifts: int
) -> list[WindowPlan]:
    """Window plans, longest first.

    Raises
    ------
    OptionError
        `window_s` is neither "auto" nor positive lengths.
    DataError
        A window is longer than every record, or too short to mean anything.
    """
    if isinstance(window_s, str):
        if window_s != "auto":
            raise OptionError("window_s", found=repr(window_s), needed='"auto" or lengths in s')
        lengths: Sequence[float] = automatic_windows(samples.durations_s, omega_max)
    else:
        lengths = [float(one) for one in np.atleast_1d(np.asarray(window_s, dtype=np.float64))]
    plans = {plan_of(one, samples.sample_time_s, shifts) for one in lengths if one > 0.0}
    longest = max(record.shape[1] for record in samples.records)
    for plan in plans:
        if not MINIMUM_LENGTH <= plan.length <= longest:
            raise DataError(
                "a window does not fit the records",
                found=f"{plan.length} samples",
                needed=f"{MINIMUM_LENGTH} to {longest} samples, the longest record",
                action="choose other window_s",
            )
    if not plans:
        raise OptionError("window_s", found=window_s, needed="positive lengths in s")
    return sorted(plans, key=lambda plan: -plan.length)


def valid_windows(
    plans: Sequence[WindowPlan], omega: NDArray[np.float64], sample_time_s: float
) -> NDArray[np.bool_]:
    """Where each window holds two cycles; the longest window counts everywhere.

    Returns
    -------
    ndarray of bool, shape (n_windows, n_f)
    """
    lengths = np.array([plan.length for plan in plans]) * sample_time_s
    cycles = np.multiply.outer(lengths, omega) / (2.0 * math.pi)
    valid = cycles >= CYCLES_AT_LOWEST * (1.0 - 1e-9)
    valid[int(np.argmax(lengths))] = True
    return np.asarray(valid)
