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
    # Of responses by their number of points, which are worked out together.
    alike: dict[int, list[tuple[int, Array, Array]]] = {}
    first = 0
    shares = _believed(errors.covariances, curves)
    for run, covariance, believed in zip(errors.runs, errors.covariances, shares, strict=True):
        parts = covariance.reshape(2, half := len(covariance) // 2, 2, half)
        for place in range(run.first, run.first + run.count):
            own = sensitivity.columns[spans[place]] - first
            span = slice(own[0, 0], own[0, 0] + len(own))
            turned = sensitivity.slopes[spans[place]] * believed[own][:, None]
            block = parts[:, span, :, span].transpose(1, 0, 3, 2)
            alike.setdefault(len(own), []).append((place, turned, block))
        first += len(covariance)
    found: dict[int, NoiseCost] = {}
    for each in alike.values():
        places, slopes, blocks = zip(*each, strict=True)
        part = _carried(np.stack(slopes), np.stack(blocks))
        deviations = np.sqrt(2.0 * np.sum(part * part, axis=(1, 2)))
        costs = map(NoiseCost, np.trace(part, axis1=1, axis2=2).tolist(), deviations.tolist())
        found |= zip(places, costs, strict=True)
    return {selected[place].name: found[place] for place in sorted(found)}


def _carried(slopes: Array, covariances: Array) -> Array:
    """Covariance of pairs of residuals, each of which answers to two of the data alone.

    Parameters
    ----------
    slopes : ndarray, shape (r, n, 2, 2)
        Of each pair by its data, of r responses.
    covariances : ndarray, shape (r, n, 2, n, 2)
        Of the data of each response.

    Returns
    -------
    ndarray, shape (r, 2 n, 2 n)
    """
    r, n = slopes.shape[:2]
    half = _by_pairs(slopes, covariances.reshape(r, n, 2, 2 * n)).reshape(r, 2 * n, n, 2)
    return _by_pairs(slopes, half.transpose(0, 2, 3, 1)).reshape(r, 2 * n, 2 * n)


def _by_pairs(slopes: Array, data: Array) -> Array:
    """``slopes @ data`` of many small matrices, all at once."""
    return np.asarray(slopes[..., :1] * data[..., :1, :] + slopes[..., 1:] * data[..., 1:, :])


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
