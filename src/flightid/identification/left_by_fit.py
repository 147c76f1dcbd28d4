"""What the free run of a fit left of its own records, which its model's file remembers."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy import fft

from flightid.identification.fit import Fit

Array = NDArray[np.float64]
LEFT = "left_by_fit"
"""Where provenance keeps it."""
SIMULATED = ("output_error", "joint")
"""Methods of equations whose records hold free runs; black boxes all do."""


def left_by_fit(fit: Fit) -> dict[str, dict[str, float]]:
    """Size of measured minus model by output; empty where the fit holds no free run.

    Parameters
    ----------
    fit : Fit

    Returns
    -------
    dict of str to dict
        ``rms``, in the output's unit, and ``independent_samples``.
    """
    if fit.details is None and fit.method not in SIMULATED:
        return {}
    found = {}
    for name in fit.records[0].outputs if fit.records else ():
        rows = [each.residual(name) for each in fit.records]
        size = float(np.sqrt(np.mean(np.concatenate(rows) ** 2)))
        found[name] = {"rms": size, "independent_samples": independent_samples(rows)}
    return found


def independent_samples(rows: Sequence[Array]) -> float:
    """Samples that tell the power of a coloured series as well as so many independent ones.

    ``n / sum_k rho(k)²``, over lags up to a quarter of the series; one at least.

    Example
    -------
    >>> white = np.random.default_rng(0).standard_normal(4000)
    >>> slow = np.repeat(white[:400], 10)
    >>> 2500 < independent_samples([white]) <= 4000, 300 < independent_samples([slow]) < 700
    (True, True)
    """
    return max(sum(_independent(row) for row in rows), 1.0)


def _independent(row: Array) -> float:
    n = row.size
    power = np.abs(fft.rfft(row, fft.next_fast_len(2 * n, real=True))) ** 2
    lags = fft.irfft(power, fft.next_fast_len(2 * n, real=True))[: n // 4 + 1]
    if not lags[0] > 0.0:
        return float(n)
    # What chance leaves of lags without correlation counts for none.
    rho = np.square(lags[1:] / lags[0])
    return n / (1.0 + 2.0 * float(np.sum(np.maximum(rho - 1.0 / n, 0.0))))
