"""What parts of the data say of one estimate: flights, and halves of each.

At the common optimum the gradients of the parts add up to nothing. How far each is from nothing,
beside its own information and noise, tells whether one set of numbers serves all parts: the step of
Gauss and Newton that a part would take from there is H_k⁻¹ g_k, and no part need determine it.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import scipy
from numpy.typing import NDArray

from flightid.frozen import dataclass

Array = NDArray[np.float64]
LEAST_INFORMATION = 1e-6
"""Share of all parts' noise in a direction below which a part says nothing of it."""
SEEN_ELSEWHERE = 1e-3
"""Least share of the other parts in a direction, for what a part says of it to be compared."""
MOST_BY_ONE = 0.999
"""Largest share of one part in an estimate."""


@dataclass(frozen=True, eq=False)
class RecordParts:
    """The parts of one record: halves, whose noise may be shared.

    Attributes
    ----------
    scores : ndarray, shape (m, p)
        What each part adds to the equations that the estimates solve.
    information : ndarray, shape (m, p, p)
        How fast these go down with the parameters.
    noise : ndarray, shape (m, p, m, p)
        Covariance of the scores at the true parameters.
    """

    scores: Array
    information: Array
    noise: Array

    @property
    def whole(self) -> RecordParts:
        """The record as one part."""
        return RecordParts(
            self.scores.sum(axis=0)[None],
            self.information.sum(axis=0)[None],
            self.noise.sum(axis=(0, 2))[None, :, None],
        )

    def along(self, directions: Array) -> RecordParts:
        """The same by combinations of the parameters, one a column."""
        return RecordParts(
            self.scores @ directions,
            directions.T @ self.information @ directions,
            np.einsum("kiml,ij,lp->kjmp", self.noise, directions, directions, optimize=True),
        )

    def of(self, count: int) -> RecordParts:
        """The same of the first parameters alone."""
        return RecordParts(
            self.scores[:, :count],
            self.information[:, :count, :count],
            self.noise[:, :count, :, :count],
        )


def chance_alike(flights: Sequence[RecordParts], freedom: float) -> float | None:
    """Probability that parts of one vehicle differ by as much as these do.

    Parameters
    ----------
    flights : sequence of RecordParts
        Noise of different ones is independent.
    freedom : float
        Degrees of freedom of the noise's level.

    Returns
    -------
    float or None
        None where no parameter is seen by two parts, or a part's noise has no finite size.

    Reference
    ---------
    Rao (1948), Large sample tests of statistical hypotheses, Proc. Cambridge Phil. Soc. 44; Hausman
    (1978), Specification tests in econometrics, Econometrica 46.

    Example
    -------
    >>> one, other = (RecordParts(np.array([[s]]), np.ones((1, 1, 1)), np.ones((1, 1, 1, 1)))
    ...               for s in (1.0, -1.0))
    >>> round(chance_alike([one, other], np.inf), 3)
    0.157
    """
    if not flights or not flights[0].scores.shape[1]:
        return None
    # A parameter that no part sees has no noise, by rounding below zero.
    total = sum(np.einsum("kiki->i", each.noise) for each in flights)
    scale = np.sqrt(np.where(total > 0.0, total, 1.0))
    square, rank = 0.0, 0
    bent, pulled = 0.0, 0.0
    for each in flights:
        m, p = each.scores.shape
        noise = (each.noise / scale[:, None, None] / scale).reshape(m * p, m * p)
        if not np.isfinite(noise).all():
            return None
        sizes, turned = np.linalg.eigh(0.5 * (noise + noise.T))
        kept = sizes > LEAST_INFORMATION
        whiten = turned[:, kept].T / np.sqrt(sizes[kept])[:, None]
        score = whiten @ (each.scores / scale).ravel()
        slope = whiten @ (each.information / scale[:, None]).reshape(m * p, p)
        square += float(score @ score)
        rank += int(np.count_nonzero(kept))
        bent, pulled = bent + slope.T @ slope, pulled + slope.T @ score
    sizes, turned = np.linalg.eigh(_scaled(np.asarray(bent)))
    kept = sizes > LEAST_INFORMATION * sizes[-1]
    lengths = np.sqrt(np.maximum(np.diag(bent), np.finfo(float).tiny))
    along = turned[:, kept].T @ (pulled / lengths) / np.sqrt(sizes[kept])
    square -= float(along @ along)
    degrees = rank - int(np.count_nonzero(kept))
    if degrees < 1:
        return None
    # The level of the noise is an estimate too, and of as much freedom.
    share = max(square, 0.0) / degrees
    return float(
        scipy.special.fdtrc(degrees, freedom, share)
        if np.isfinite(freedom)
        else scipy.special.chdtrc(degrees, share * degrees)
    )


def _scaled(matrix: Array) -> Array:
    size = np.sqrt(np.maximum(np.diag(matrix), np.finfo(float).tiny))
    return np.asarray(0.5 * (matrix + matrix.T) / np.outer(size, size))


@dataclass(frozen=True, eq=False)
class Scatter:
    """Covariance of estimates by how far parts differ, and its degrees of freedom, shape (p,)."""

    covariance: Array
    freedom: Array


def scatter(parts: Sequence[RecordParts], solve: Array, spread: Array) -> Scatter:
    """Covariance by leaving out one part after the other (jackknife by clusters, CR3).

    Unbiased where parts weigh alike and, to a few percent of the variance, where one weighs four
    fifths, if what parts differ by is the vehicle rather than noise.

    Parameters
    ----------
    parts : sequence of RecordParts
        Each as one part; two or more.
    solve : ndarray, shape (p, p)
        Inverse of the information of all parts together: what turns scores into changes.
    spread : ndarray, shape (p, p)
        Covariance of the estimates by the noise alone, for shares and scales.

    Reference
    ---------
    Bell & McCaffrey (2002), Bias reduction in standard errors for linear regression with
    multi-stage samples, Survey Methodology 28(2); Satterthwaite (1946), Biometrics Bulletin 2(6).

    Example
    -------
    >>> parts = [RecordParts(np.array([[s]]), np.ones((1, 1, 1)), np.ones((1, 1, 1, 1)))
    ...          for s in (3.0, 0.0, -3.0)]
    >>> found = scatter(parts, np.full((1, 1), 1 / 3), np.full((1, 1), 1 / 3))
    >>> found.covariance.round(6), found.freedom.round(6)
    (array([[3.]]), array([2.]))
    """
    count, size = len(parts), np.sqrt(np.diag(spread))
    left_over = solve @ sum(part.scores[0] for part in parts)
    changes, shares = [], []
    for part in parts:
        weight = solve @ part.information[0]
        others = np.eye(len(size)) - weight * size / size[:, None]
        left, singular, right = np.linalg.svd(others)
        kept = singular > SEEN_ELSEWHERE
        apart = solve @ part.scores[0] - weight @ left_over
        moved = left.T[kept] @ (apart / size)
        changes.append(size * (right.T[:, kept] @ (moved / singular[kept])))
        shares.append(np.diag(weight @ spread) / size**2)
    covariance = (count - 1) / count * sum(np.outer(each, each) for each in changes)
    weights = np.clip(np.array(shares), 0.0, MOST_BY_ONE)
    weights = weights / np.maximum(weights.sum(axis=0), np.finfo(float).tiny)
    return Scatter(np.asarray(covariance), np.array([_freedom(w) for w in weights.T]))


def _freedom(weights: Array) -> float:
    """Of the jackknife's variance of a mean with these weights, all parts scattering alike."""
    weights = np.minimum(weights, MOST_BY_ONE)
    centred = np.eye(len(weights)) - weights
    form = centred.T @ ((weights / (1.0 - weights)) ** 2 * centred.T).T
    square = float(np.sum(form * form.T))
    return max(1.0, float(np.trace(form)) ** 2 / square) if square > 0.0 else 1.0


def larger(covariance: Array, other: Array) -> Array:
    """A covariance that is nowhere below either of two; the first is positive but for rounding.

    Example
    -------
    >>> larger(np.eye(2), np.diag([4.0, 0.0]))
    array([[4., 0.],
           [0., 1.]])
    """
    size = np.sqrt(np.diag(covariance))
    # Parameters that hang together to rounding: Cholesky's root would fail there.
    own, axes = np.linalg.eigh(covariance / np.outer(size, size))
    lower = axes * np.sqrt(np.maximum(own, np.finfo(float).eps * own[-1]))
    inner = np.linalg.solve(lower, np.linalg.solve(lower, other / np.outer(size, size)).T)
    sizes, turned = np.linalg.eigh(0.5 * (inner + inner.T))
    root = size[:, None] * (lower @ turned)
    return np.asarray((root * np.maximum(sizes, 1.0)) @ root.T)
