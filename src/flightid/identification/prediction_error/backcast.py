"""The past of a record's noise, run backwards out of the record."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from flightid import _native
from flightid.errors import FitError
from flightid.models.polynomial.model import PolynomialModel
from flightid.models.sampled.channels import SampledChannels
from flightid.recursive_filter import filtered

Array = NDArray[np.float64]
FORGOTTEN = 1e-8
LONGEST = 10_000


def backcast(model: PolynomialModel, data: SampledChannels) -> list[list[float]]:
    """Values that stand for the past of each record: inputs at rest, noise as its model foretells.

    The disturbance v = y - (B/AF) u is a stationary process, whose reversal has the same model;
    foretelling it past the end of the reversed record gives its expected past.

    Raises
    ------
    FitError
        The noise model grows, so that its past has no expectation.

    Reference
    ---------
    Box, Jenkins & Reinsel, *Time Series Analysis*, 4th ed., section 7.1.4.
    """
    above, below = model.noise_transfer
    size = np.max(np.abs(np.roots(below)), initial=0.0)
    if size >= 1.0:
        raise FitError(
            "a noise model that grows cannot be run backwards",
            found=f"a pole of size {size:.6g}",
            needed="below 1",
            action="take backcast=False",
        )
    reach = above.size + below.size
    if size > 0.0:
        reach += min(LONGEST, int(np.ceil(np.log(FORGOTTEN) / np.log(size))))
    of_inputs, of_noise = _native.polynomial_memory(model.structure.native)
    found = []
    for span in data.spans:
        disturbance = np.array(data.output[span])
        for name, row in zip(model.inputs, data.inputs, strict=True):
            disturbance -= filtered(*model.transfer(name), row[span])
        noise = _past(disturbance, above, below, reach, of_noise)
        found.append([0.0] * sum(of_inputs) + noise.tolist())
    return found


def _past(disturbance: Array, above: Array, below: Array, reach: int, count: int) -> Array:
    """What the disturbance and errors before the record add to C e at its first samples."""
    backwards = filtered(below, above, disturbance[::-1])
    longer = filtered(above, below, np.concatenate([backwards, np.zeros(reach)]))
    before = longer[disturbance.size :][::-1]
    errors = filtered(below, above, before)
    added = np.zeros(count)
    for t in range(count):
        for j in range(t + 1, below.size):
            added[t] += below[j] * before[t - j]
        for j in range(t + 1, above.size):
            added[t] -= above[j] * errors[t - j]
    return added
