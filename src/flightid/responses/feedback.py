"""Does a loop seem to be closed around the vehicle? A check on records without excitation."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from flightid.conventions import Light
from flightid.findings import Finding
from flightid.responses.windows.samples import Samples

LAGS = 12
"""Past samples of each channel that the regression looks at."""
SMALLEST_SHARE = 0.02
"""Share of an input's innovation that past outputs must explain before a loop is suspected."""
SMALLEST_POWER = 5e-4
"""Share of an input's whole power that this must be: below it the bias does not matter, and a clean
sweep, which hardly has an innovation, gives no false alarm."""
SMALLEST_PROBABILITY = 1e-6
RIDGE = 1e-11
"""Added to columns of unit length: noise 110 dB below each channel."""
SAMPLES_A_CYCLE = 8.0
"""Samples kept in a cycle of the highest frequency of interest."""
MAXIMUM_SAMPLES = 20000
"""Of all records together."""


def feedback_findings(samples: Samples, omega_max: float) -> list[Finding]:
    """Inputs whose present value past outputs predict beyond what the inputs' own past does.

    With the loop open an input depends on its own past alone, and outputs add nothing to it. With
    a loop closed, output noise comes back through the controller (or pilot) to the input.

    Parameters
    ----------
    samples : Samples
    omega_max : float
        Highest frequency of interest, rad/s; records are thinned to match.

    Returns
    -------
    list of Finding

    Reference
    ---------
    Granger, "Investigating causal relations by econometric models and cross-spectral methods",
    *Econometrica* 37 (1969); Ljung, *System Identification*, 2nd ed., section 13.4.
    """
    step = max(1, int(2.0 * np.pi / (SAMPLES_A_CYCLE * omega_max * samples.sample_time_s)))
    most = MAXIMUM_SAMPLES // len(samples.records)
    records = [record[:, ::step][:, :most] for record in samples.records]
    long = [record for record in records if record.shape[1] > 4 * LAGS]
    n_in, n_out = len(samples.inputs), len(samples.outputs)
    if not long:
        return []
    own = np.concatenate([_past(record[:n_in]) for record in long])
    others = np.concatenate([_past(record[n_in : n_in + n_out]) for record in long])
    targets = np.concatenate([record[:n_in, LAGS:].T for record in long])
    found = []
    for name, (share, power, probability) in zip(
        samples.inputs, _gains(own, others, targets), strict=True
    ):
        large = share > SMALLEST_SHARE and power > SMALLEST_POWER
        if large and probability < SMALLEST_PROBABILITY:
            found.append(
                Finding(
                    "loop-closed",
                    Light.AMBER,
                    f"past outputs explain {100 * share:.0f} % of what is new in input {name}: a "
                    "loop seems to be closed, and the direct estimate tends to minus the inverse "
                    "of the controller where output noise dominates",
                    "use method='instrument' with the injected excitation, or fly with the loop "
                    "open",
                )
            )
    return found


def _past(rows: NDArray[np.float64]) -> NDArray[np.float64]:
    """Columns of the last `LAGS` samples of each row, shape (n_samples − LAGS, rows · LAGS)."""
    n = rows.shape[1]
    return np.concatenate([rows[:, LAGS - k : n - k] for k in range(1, LAGS + 1)]).T


def _gains(
    own: NDArray[np.float64], others: NDArray[np.float64], targets: NDArray[np.float64]
) -> list[tuple[float, float, float]]:
    """What the others explain of each target beyond the own past, and its F probability.

    First as a share of what the own past leaves, then as a share of the whole. One triangular
    factor of everything holds all these sums of squares. It comes from the normal equations, whose
    rounding is far below the shares that matter, and `RIDGE` keeps them definite.
    """
    table = np.concatenate([own, others, targets], axis=1)
    before, after = own.shape[1], own.shape[1] + others.shape[1]
    free = len(table) - after
    if free <= others.shape[1]:
        return [(0.0, 0.0, 1.0)] * targets.shape[1]
    scale = np.maximum(np.sqrt(np.sum(table**2, axis=0)), np.finfo(float).tiny)
    table /= scale
    factor = np.linalg.cholesky(table.T @ table + RIDGE * np.eye(table.shape[1])).T
    squares = factor[:, after:] ** 2
    found = []
    for column in range(targets.shape[1]):
        left = float(np.sum(squares[after:, column]))
        without = float(np.sum(squares[before:, column]))
        if without <= SMALLEST_POWER:
            found.append((0.0, 0.0, 1.0))
            continue
        share = max(0.0, 1.0 - left / without)
        f = share / others.shape[1] / max((1.0 - share) / free, np.finfo(float).tiny)
        found.append((share, without - left, float(stats.f.sf(f, others.shape[1], free))))
    return found
