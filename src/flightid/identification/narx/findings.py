"""Verdicts on a NARX fit."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from flightid.conventions import Light
from flightid.findings import Finding
from flightid.uncertainty.quantiles import half_width

Array = NDArray[np.float64]
BATCHES = 20
"""Pieces of the runs whose mean squared errors are compared as if independent."""
LEVEL = 0.98
"""Of a two-sided interval: half of what is left is the share of false alarms."""


def collinear_finding(collinear: int, n_chosen: int) -> tuple[Finding, ...]:
    """Whether candidates were combinations of the chosen terms."""
    if collinear <= n_chosen:
        return ()
    return (
        Finding(
            "collinear-candidates",
            Light.AMBER,
            f"{collinear} candidates are combinations of the {n_chosen} chosen terms",
            "reduce the width or degree, or use fewer candidates (k-means)",
        ),
    )


def free_run_findings(
    free: Sequence[Array], linear: Sequence[Array], held: str | None
) -> tuple[Finding, ...]:
    """Whether the free run was held, and whether it loses to the linear model beyond chance.

    Parameters
    ----------
    free, linear : sequence of ndarray, shape (n_samples,)
        Errors of both in the same samples of each record.
    held : str or None
        Where the guard held the run.
    """
    found = []
    if held is not None:
        found.append(
            Finding(
                "free-run-unstable",
                Light.RED,
                f"the free run left the guarded range ({held}) and was held there",
                "use fewer terms or lags, a wider kernel, or linear terms only",
            )
        )
    if loses(free, linear):
        found.append(
            Finding(
                "loses-to-linear",
                Light.RED,
                f"in free run the model (rms {_rms(free):.4g}) is worse than the linear model of "
                f"the same lags (rms {_rms(linear):.4g}), by more than chance",
                "give focus='simulation', which delivers the linear model where that one wins, or "
                "search lags and widths by free-run error",
            )
        )
    return tuple(found)


def loses(free: Sequence[Array], linear: Sequence[Array]) -> bool:
    """Whether the squared errors' difference, by batches, is above zero beyond chance.

    Reference: Diebold & Mariano, *J. Business & Economic Statistics* 13 (1995); batch means stand
    for the long-run variance.
    """
    worse = np.concatenate(free) ** 2 - np.concatenate(linear) ** 2
    means = np.array([piece.mean() for piece in np.array_split(worse, min(BATCHES, worse.size))])
    if means.size < 2:
        return False
    chance = half_width(LEVEL, means.size - 1) * float(means.std(ddof=1)) / np.sqrt(means.size)
    return bool(worse.mean() > max(chance, 1e-9 * np.mean(np.concatenate(linear) ** 2)))


def _rms(errors: Sequence[Array]) -> float:
    return float(np.sqrt(np.mean(np.concatenate(errors) ** 2)))
