"""What a body rate does that no stick asks for: gusts, vibration and the gyro's noise."""

from __future__ import annotations

from typing import Any

import numpy as np
import scipy

from flightid.record import Record

LONGEST_WINDOW_S = 10.0
SHORTEST_WINDOW_S = 2.0
FEWEST_WINDOWS = 4
ALIKE = 1.0 + 2.0 / 36.0
"""Hann windows that overlap by half hold so much fewer independent ones than their number."""
LEAST_DENSITY = 1e-12
"""Keeps the logarithm of a made-up, silent flight finite, (rad/s)²/Hz."""


def still_rate(pieces: list[Record]) -> tuple[tuple[float, ...], tuple[float, ...]] | None:
    """Density of the rate with what follows the stick taken out.

    Parameters
    ----------
    pieces : list of Record
        One input, the rate as first output, the attitude set-point as second where it was logged.

    Returns
    -------
    tuple of float, tuple of float, or None
        Frequencies, rad/s, and one-sided density, (rad/s)²/Hz; None where the pieces are too short.

    Reference
    ---------
    Bendat & Piersol, *Random Data*, 4th ed., section 6.1: the residual spectrum (1 − γ²) G_yy,
    with the n/(n − 1) that the fitted gain of n windows takes; Welch (1967) for n of windows that
    overlap.
    """
    usable = [record for record in pieces if record.duration_s >= 2.0 * SHORTEST_WINDOW_S]
    if not usable:
        return None
    rate_hz = usable[0].sample_rate_hz
    window_s = min(LONGEST_WINDOW_S, *(record.duration_s / 2.0 for record in usable))
    size = max(8, round(window_s * rate_hz))
    weights = np.array([record.duration_s for record in usable])
    averages = float(np.sum(2.0 * weights / window_s - 1.0)) / ALIKE
    named = usable[0].outputs
    asked = named[1] if len(named) > 1 else None
    sums: list[np.ndarray] = []
    frequencies = np.zeros(0)
    for record, weight in zip(usable, weights, strict=True):
        options: dict[str, Any] = {"fs": rate_hz, "nperseg": size, "detrend": "linear"}
        frequencies, own = scipy.signal.welch(record[named[0]], **options)
        parts = [own]
        if asked is not None:
            parts.append(scipy.signal.welch(record[asked], **options)[1])
            parts.append(scipy.signal.csd(record[asked], record[named[0]], **options)[1])
        sums = [weight * part + (sums[k] if sums else 0.0) for k, part in enumerate(parts)]
    total = [each / weights.sum() for each in sums]
    left = total[0]
    if asked is not None and weights.sum() >= FEWEST_WINDOWS * window_s:
        explained = np.abs(total[2]) ** 2 / np.maximum(total[1], np.finfo(np.float64).tiny)
        left = np.maximum(total[0] - explained, 0.0) * averages / (averages - 1.0)
    keep = slice(1, None)
    omega = 2.0 * np.pi * frequencies[keep]
    return tuple(omega.tolist()), tuple(np.maximum(np.real(left[keep]), LEAST_DENSITY).tolist())
