"""What the random error of a response alone adds to the cost of a model that is right."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from flightid.identification.fit_findings import NoiseCost
from flightid.identification.frequency_domain.error_model import ErrorModel, coherence_sensitivity
from flightid.identification.frequency_domain.selection import SelectedResponse

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]
LARGEST_ERROR = 0.5
"""Relative random error beyond which a logarithm no longer follows it."""


def noise_costs(
    selected: Sequence[SelectedResponse], curves: Sequence[Complex], errors: ErrorModel
) -> dict[str, NoiseCost]:
    """Mean and deviation of each response's cost by its random error.

    Parameters
    ----------
    selected : sequence of SelectedResponse
    curves : sequence of ndarray of complex
        The model at the points of each.
    errors : ErrorModel
        Of the response as measured: what a model leaves must not count as noise.

    Returns
    -------
    dict of str to NoiseCost
        Empty where errors are not known.

    Assumes
    -------
    Small errors of logarithms: larger ones than `LARGEST_ERROR` count as that, so that points
    without coherence explain nothing. Too large by what the fit takes of the noise, which is little
    beside many points.

    Reference
    ---------
    Pintelon & Schoukens, *System Identification*, 2nd ed., §11.4 (the cost of a model that is
    right); moments of quadratic forms: Mathai & Provost (1992), eq. 3.2b.8.
    """
    if not errors.runs:
        return {}
    sensitivity = coherence_sensitivity(selected, curves, errors)
    ends = np.cumsum([0, *(len(each.places) for each in selected)])
    spans = [slice(*span) for span in pairwise(ends)]
    found, first = {}, 0
    shares = _believed(errors.covariances, curves)
    for run, covariance, believed in zip(errors.runs, errors.covariances, shares, strict=True):
        for place in range(run.first, run.first + run.count):
            own = sensitivity.columns[spans[place]] - first
            turned = sensitivity.slopes[spans[place]] * believed[own][:, None]
            part = _carried(turned, covariance, own)
            deviation = float(np.sqrt(2.0 * np.sum(part * part)))
            trace = float(np.einsum("ipip->", part))
            found[selected[place].name] = NoiseCost(trace, deviation)
        first += len(covariance)
    return found


def _carried(slopes: Array, covariance: Array, own: NDArray[np.intp]) -> Array:
    """Covariance of pairs of residuals, each of which answers to two of the data alone.

    Parameters
    ----------
    slopes : ndarray, shape (n, 2, 2)
        Of each pair by its data.
    covariance : ndarray, shape (m, m)
        Of all data.
    own : ndarray of int, shape (n, 2)
        Data of each pair.

    Returns
    -------
    ndarray, shape (n, 2, n, 2)
    """
    n = len(own)
    half = slopes @ covariance[own[:, :, None], own.ravel()]
    whole = slopes @ half.reshape(2 * n, n, 2).transpose(1, 2, 0)
    return whole.reshape(n, 2, n, 2)


def _believed(covariances: Sequence[Array], curves: Sequence[Complex]) -> list[Array]:
    """Shares of the errors of each run's real and imaginary parts that its logarithms can hold."""
    halves = [len(each) // 2 for each in covariances]
    powers = [np.diagonal(each) for each in covariances]
    both = [power[:half] + power[half:] for power, half in zip(powers, halves, strict=True)]
    error = np.sqrt(0.5 * np.concatenate(both)) / np.abs(np.concatenate(list(curves)))
    shares = LARGEST_ERROR / np.maximum(error, LARGEST_ERROR)
    ends = np.cumsum(halves)
    return [
        np.concatenate(2 * [shares[end - half : end]])
        for end, half in zip(ends, halves, strict=True)
    ]
