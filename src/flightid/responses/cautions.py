"""Findings of an estimate: what to know before the response is used."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from flightid.conventions import Light
from flightid.findings import Finding, told_apart
from flightid.responses.windows.defaults import CYCLES_AT_LOWEST, HIGHEST_FRACTION

HIGH_INPUT_COHERENCE = 0.5
"""Coherence between two inputs, averaged over the band, above which conditioning is doubtful."""
PRINTED = 5e-3
"""Most that a number to three digits, as bands are written and findings say them, is off by."""


def band_findings(
    omega: NDArray[np.float64], longest_s: float, sample_time_s: float
) -> list[Finding]:
    """Frequencies below two cycles in the longest window or above a fifth of the rate."""
    found = []
    lowest = CYCLES_AT_LOWEST * 2.0 * math.pi / longest_s
    if omega[0] < lowest * (1.0 - PRINTED):
        found.append(
            Finding(
                "below-two-cycles",
                Light.AMBER,
                f"frequencies from {omega[0]:.3g} rad/s have less than two cycles in the longest "
                f"window ({longest_s:.3g} s)",
                f"begin the band at {lowest:.3g} rad/s, or use longer windows",
            )
        )
    highest = HIGHEST_FRACTION * 2.0 * math.pi / sample_time_s
    if omega[-1] > highest * (1.0 + PRINTED):
        found.append(
            Finding(
                "above-a-fifth-of-the-rate",
                Light.AMBER,
                f"frequencies reach {omega[-1]:.3g} rad/s; a fifth of the sampling rate is "
                f"{highest:.3g} rad/s",
                "check filters and sampling delay there, or record faster",
            )
        )
    return found


def correlation_findings(names: tuple[str, ...], spectrum: NDArray[np.complex128]) -> list[Finding]:
    """Pairs of inputs whose coherence, averaged over the band, makes conditioning doubtful.

    Parameters
    ----------
    names : tuple of str
    spectrum : ndarray of complex, shape (n_in, n_in, n_f)
    """
    auto = np.real(np.einsum("iif->if", spectrum))
    found = []
    for first in range(len(names)):
        for second in range(first + 1, len(names)):
            squared = np.abs(spectrum[first, second]) ** 2
            mean = float(np.mean(squared / (auto[first] * auto[second])))
            if mean > HIGH_INPUT_COHERENCE:
                found.append(
                    Finding(
                        "inputs-correlated",
                        Light.AMBER,
                        f"inputs {names[first]} and {names[second]} are correlated: coherence "
                        f"{told_apart(mean, HIGH_INPUT_COHERENCE, decimals=2)} on average, "
                        f"{HIGH_INPUT_COHERENCE} is the limit",
                        "excite them one at a time or by independent signals",
                    )
                )
    return found
