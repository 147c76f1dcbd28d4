"""Verdicts on a NARX fit."""

from __future__ import annotations

from flightid.conventions import Light
from flightid.findings import Finding


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


def free_run_findings(free: float, linear: float, held: str | None) -> tuple[Finding, ...]:
    """Whether the free run was held, and whether it loses to the linear model."""
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
    if free > linear * (1 + 1e-9):
        found.append(
            Finding(
                "loses-to-linear",
                Light.RED,
                f"in free run on its own training records the model (rms {free:.4g}) is worse than "
                f"the linear model of the same lags (rms {linear:.4g})",
                "use the linear model, or search lags and widths by free-run error",
            )
        )
    return tuple(found)
