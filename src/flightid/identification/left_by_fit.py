"""What the free run of a fit left of its own records, which its model's file remembers."""

from __future__ import annotations

import numpy as np

from flightid.identification.fit import Fit
from flightid.uncertainty.foretold import independent_samples

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
