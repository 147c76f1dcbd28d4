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
SEEN_ALIKE = 0.2
"""Information of a direction, over that of whichever part tells most of it, from which on a part
is compared there: its error is up to 2.2 times as long. What a part hardly sees is moved by gusts
that a loop answers, and says nothing of the vehicle."""
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
    axes = np.diag(1.0 / scale)
    return _chance(
        [_whitened(each.along(axes), axes @ each.information) for each in flights], freedom
    )


def chance_where_seen(parts: Sequence[RecordParts], freedom: float) -> float | None:
    """The same of parts by what each sees about as well as any other, see `SEEN_ALIKE`.

    Parameters
    ----------
    parts : sequence of RecordParts
        Each as one part.
    freedom : float

    Returns
    -------
    float or None
        None where no two parts see the same as well.

    Example
    -------
    >>> parts = [RecordParts(np.array([[s]]), np.full((1, 1, 1), h), np.full((1, 1, 1, 1), h))
    ...          for s, h in ((1.0, 1.0), (-1.0, 0.01))]
    >>> chance_where_seen(parts, np.inf) is None, round(chance_alike(parts, np.inf), 3)
    (True, 0.0)
    """
    seen = seen_by_all(parts)
    return None if not seen else _chance([each and each[:2] for each in seen], freedom)


def seen_by_all(parts: Sequence[RecordParts]) -> list[tuple[Array, Array, Array] | None]:
    """Scores of unit variance by what each part sees about as well as any other, see `SEEN_ALIKE`.

    Parameters
    ----------
    parts : sequence of RecordParts
        Each as one part.

    Returns
    -------
    list
        By part: scores, their slopes by directions of unit information, and by the part's own
        parameters; None of noise that has no finite size. Empty without parameters, or without
        finite information of any.
    """
    total = np.sum([each.information[0] for each in parts], axis=0)
    if not len(total):
        return []
    size = np.sqrt(np.maximum(np.diag(total), np.finfo(float).tiny))
    sizes, turned = np.linalg.eigh(_scaled(total))
    kept = sizes > LEAST_INFORMATION * sizes[-1]
    if not kept.any():
        return []
    root = turned[:, kept] / np.sqrt(sizes[kept]) / size[:, None]
    shares = [root.T @ each.information[0] @ root for each in parts]
    seen: list[tuple[Array, Array, Array] | None] = []
    for each, share in zip(parts, shares, strict=True):
        own, axes = np.linalg.eigh(0.5 * (share + share.T))
        most = np.max([np.sum(axes * (other @ axes), axis=0) for other in shares], axis=0)
        axes = root @ axes[:, own >= SEEN_ALIKE * most]
        noise = np.einsum("ij,ip,pj->j", axes, each.noise[0, :, 0], axes)
        axes = axes / np.sqrt(np.where(noise > 0.0, noise, 1.0))
        white = _whitened(each.along(axes), axes.T @ each.information)
        seen.append(None if white is None else (white[0], white[1] @ root, white[1]))
    return seen


def _whitened(part: RecordParts, slopes: Array) -> tuple[Array, Array] | None:
    """Scores of unit variance, and their slopes by all parameters; None of no finite size."""
    m, p = part.scores.shape
    noise = part.noise.reshape(m * p, m * p)
    if not np.isfinite(noise).all():
        return None
    sizes, turned = np.linalg.eigh(0.5 * (noise + noise.T))
    kept = sizes > LEAST_INFORMATION
    whiten = turned[:, kept].T / np.sqrt(sizes[kept])[:, None]
    return whiten @ part.scores.ravel(), whiten @ slopes.reshape(m * p, slopes.shape[-1])


def _chance(whitened: Sequence[tuple[Array, Array] | None], freedom: float) -> float | None:
    """That scores are of one set of numbers."""
    known = [each for each in whitened if each is not None]
    if len(known) < len(whitened):
        return None
    bent = np.sum([slope.T @ slope for _, slope in known], axis=0)
    pulled = np.sum([slope.T @ score for score, slope in known], axis=0)
    sizes, turned = np.linalg.eigh(_scaled(bent))
    kept = sizes > LEAST_INFORMATION * sizes[-1]
    lengths = np.sqrt(np.maximum(np.diag(bent), np.finfo(float).tiny))
    along = turned[:, kept].T @ (pulled / lengths) / np.sqrt(sizes[kept])
    square = sum(float(score @ score) for score, _ in known) - float(along @ along)
    degrees = sum(len(score) for score, _ in known) - int(np.count_nonzero(kept))
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
    lower, back = _root(solve)
    changes, shares = [], []
    for part in parts:
        weight = solve @ part.information[0]
        left, singular, right = np.linalg.svd(np.eye(len(size)) - back @ weight @ lower)
        kept = singular >= SEEN_ALIKE / (1.0 + SEEN_ALIKE)
        apart = back @ (solve @ part.scores[0] - weight @ left_over)
        moved = left.T[kept] @ apart
        changes.append(lower @ (right.T[:, kept] @ (moved / singular[kept])))
        shares.append(np.diag(weight @ spread) / size**2)
    covariance = (count - 1) / count * sum(np.outer(each, each) for each in changes)
    weights = np.clip(np.array(shares), 0.0, MOST_BY_ONE)
    weights = weights / np.maximum(weights.sum(axis=0), np.finfo(float).tiny)
    return Scatter(np.asarray(covariance), np.array([_freedom(w) for w in weights.T]))


def _root(solve: Array) -> tuple[Array, Array]:
    """Directions of unit information, and what turns changes into them."""
    size = np.sqrt(np.maximum(np.diag(solve), np.finfo(float).tiny))
    own, axes = np.linalg.eigh(_scaled(solve))
    own = np.maximum(own, np.finfo(float).eps * own[-1])
    return size[:, None] * axes * np.sqrt(own), (axes / np.sqrt(own)).T / size


def told_alone(parts: Sequence[RecordParts], solve: Array, spread: Array) -> NDArray[np.bool_]:
    """Which estimates are told by one part alone: no other sees them about as well.

    Example
    -------
    >>> parts = [RecordParts(np.zeros((1, 2)), np.diag(h)[None], np.diag(h)[None, :, None])
    ...          for h in ([1.0, 1.0], [0.01, 1.0])]
    >>> told_alone(parts, np.diag([1 / 1.01, 0.5]), np.diag([1 / 1.01, 0.5])).tolist()
    [True, False]
    """
    size = np.maximum(np.diag(spread), np.finfo(float).tiny)
    shares = [np.diag(solve @ part.information[0] @ spread) / size for part in parts]
    return np.asarray(np.max(shares, axis=0) > 1.0 / (1.0 + SEEN_ALIKE))


def _freedom(weights: Array) -> float:
    """Of the jackknife's variance of a mean with these weights, all parts scattering alike."""
    weights = np.minimum(weights, MOST_BY_ONE)
    centred = np.eye(len(weights)) - weights
    form = centred.T @ ((weights / (1.0 - weights)) ** 2 * centred.T).T
    square = float(np.sum(form * form.T))
    # At least one: eigenvalues are not negative, so squares sum to no more than their sum, squared.
    return float(np.trace(form)) ** 2 / square if square > 0.0 else 1.0


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
