"""Checks of design options, one message for each kind of mistake."""

from __future__ import annotations

import math

from flightid.errors import OptionError

GRID_TOLERANCE = 1e-6
"""Departure from a whole number of samples, in samples, that counts as rounding."""


def require_positive(**values: float) -> None:
    """Refuse values that are not positive and finite; names carry the unit."""
    for name, value in values.items():
        if not (math.isfinite(value) and value > 0):
            raise OptionError(f"{name} must be positive", found=value, needed="a positive number")


def require_not_negative(**values: float) -> None:
    """Refuse values that are negative or not finite; names carry the unit."""
    for name, value in values.items():
        if not (math.isfinite(value) and value >= 0):
            raise OptionError(f"{name} must not be negative", found=value, needed="zero or more")


def require_band(band_rad_s: tuple[float, float], sample_rate_hz: float) -> tuple[float, float]:
    """Refuse a band that is empty or reaches half the sample rate."""
    low, high = (float(edge) for edge in band_rad_s)
    if not 0 < low < high < math.pi * sample_rate_hz:
        raise OptionError(
            "band does not fit the sample rate",
            found=f"{low:.4g} to {high:.4g} rad/s at {sample_rate_hz:.4g} Hz",
            needed=f"0 < low < high < {math.pi * sample_rate_hz:.4g} rad/s, half the sample rate",
        )
    return low, high


def whole_samples(duration_s: float, sample_rate_hz: float, what: str) -> int:
    """Number of samples of a span that must fall on the sample grid.

    Raises
    ------
    OptionError
        The span is not a whole number of samples; the message names the nearest that is.
    """
    exact = duration_s * sample_rate_hz
    count = round(exact)
    if count < 1 or abs(exact - count) > GRID_TOLERANCE * max(1.0, count):
        nearest = max(1, count) / sample_rate_hz
        raise OptionError(
            f"{what} is not a whole number of samples",
            found=f"{duration_s:.9g} s at {sample_rate_hz:.9g} Hz, {exact:.6g} samples",
            needed=f"for example {nearest:.9g} s",
        )
    return count
