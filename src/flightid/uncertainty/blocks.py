"""Least-squares problems as covariances need them: sensitivities by record, and their halves."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from flightid.uncertainty.parts import LEAST_INFORMATION, RecordParts
from flightid.uncertainty.residual_noise import Autoregression, FittedDirections

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class RecordBlock:
    """One record, whitened across outputs; rows are outputs after outputs.

    Attributes
    ----------
    projected : ndarray, shape (n_rows, n)
        Sensitivities with the record's own numbers taken out.
    shared_on_own : ndarray, shape (n_own, n)
        What was taken out.
    basis, triangle : ndarray, shapes (n_rows, n_own) and (n_own, n_own)
        Orthonormal basis and triangle of the own numbers' sensitivities.
    residual : ndarray, shape (n_outputs, n_samples)
    answering : ndarray, shape (n_rows, n), optional
        How residuals go down with the parameters, where `projected` are instruments instead.
    half : int, optional
        First sample of the second half; default: by what the sensitivities tell.
    """

    projected: Array
    shared_on_own: Array
    basis: Array
    triangle: Array
    residual: Array
    answering: Array | None = None
    half: int | None = None

    @cached_property
    def middle(self) -> int:
        """First sample of the second half: halves hold the same information, not the same time.

        A quiet tail tells nothing by itself.
        """
        if self.half is not None:
            return self.half
        shares = _information(self.projected).reshape(self.residual.shape)
        return middle_of(shares.sum(axis=0))

    @classmethod
    def of(cls, shared: Array, own: Array, residual: Array) -> RecordBlock:
        """From sensitivities by shared parameters and by own numbers, (n_outputs, n_samples, k)."""
        rows = residual.size
        shared, own = shared.reshape(rows, -1), own.reshape(rows, -1)
        basis, triangle = np.linalg.qr(own)
        on_own = basis.T @ shared
        projected = shared - basis @ on_own if own.size else shared
        return cls(projected, on_own, basis, triangle, residual)

    def along(self, directions: Array) -> RecordBlock:
        """The same by combinations of the parameters, one a column."""
        answering = None if self.answering is None else self.answering @ directions
        return replace(
            self,
            projected=self.projected @ directions,
            shared_on_own=self.shared_on_own @ directions,
            answering=answering,
            half=self.middle,
        )


@dataclass(frozen=True, eq=False)
class JointResiduals:
    """Residuals of unit variance, fitted together with the records, and what they answer to.

    Attributes
    ----------
    slopes : ndarray, shape (n_residuals, n)
        Derivatives by the parameters, the data being as they are.
    total : ndarray, shape (n_residuals, n)
        The same with data that follow the parameters, as corrected points do.
    measured : bool
        Whether the residuals are of data; else they bring curvature alone.
    bias : ndarray, shape (n_residuals,), optional
        Of the residuals.
    """

    slopes: Array
    total: Array
    measured: bool = True
    bias: Array | None = None

    def along(self, directions: Array) -> JointResiduals:
        """The same by combinations of the parameters, one a column."""
        return replace(self, slopes=self.slopes @ directions, total=self.total @ directions)

    def of(self, parameters: NDArray[np.bool_]) -> JointResiduals:
        """Columns of some parameters."""
        return replace(self, slopes=self.slopes[:, parameters], total=self.total[:, parameters])


def flights_of(apart: Sequence[Array], blocks: Sequence[RecordBlock]) -> list[RecordParts]:
    """Records with their halves, from what `noise_heard` gives of each."""
    return [_flight(each.sum(axis=0), block) for each, block in zip(apart, blocks, strict=True)]


def levels(blocks: Sequence[RecordBlock]) -> Array:
    """Residual variance of each record and output over that of all, (n_records, n_outputs).

    Records of one colour need not be of one level: a harder manoeuvre may be a noisier one.
    """
    squares = np.array([np.sum(block.residual**2, axis=1) for block in blocks])
    counts = np.array([block.residual.shape[1] for block in blocks])
    common = squares.sum(axis=0) / counts.sum()
    known = common > 0.0
    return np.where(known, squares / counts[:, None] / np.where(known, common, 1.0), 1.0)


def _halves(block: RecordBlock) -> Array:
    """[basis, projected in the first half, projected in the second], (n_outputs, n, m + 2 n)."""
    n_outputs, n_samples = block.residual.shape
    own, shared = (
        part.reshape(n_outputs, n_samples, -1) for part in (block.basis, block.projected)
    )
    m, count = own.shape[2], shared.shape[2]
    wide = np.zeros((n_outputs, n_samples, m + 2 * count))
    half = block.middle
    wide[:, :, :m] = own
    wide[:, :half, m : m + count] = shared[:, :half]
    wide[:, half:, m + count :] = shared[:, half:]
    return wide


def middle_of(shares: Array) -> int:
    """First sample of a second half: up to it, half of what non-negative shares add up to.

    Both halves hold a sample; where nothing is shared they are of one length.

    Example
    -------
    >>> middle_of(np.array([3.0, 1.0, 1.0, 1.0, 0.0, 0.0])), middle_of(np.zeros(6))
    (1, 3)
    """
    held = np.cumsum(shares)
    if not held[-1] > 0.0:
        return len(shares) // 2
    place = int(np.searchsorted(held, 0.5 * held[-1], side="left")) + 1
    return min(max(place, 1), len(shares) - 1)


def _information(slopes: Array) -> Array:
    """Share of each row in the information on all parameters (its leverage), shape (n_rows,)."""
    size = np.linalg.norm(slopes, axis=0)
    scaled = slopes[:, size > 0.0] / size[size > 0.0]
    sizes, axes = np.linalg.eigh(scaled.T @ scaled)
    kept = sizes > LEAST_INFORMATION
    return np.asarray(np.sum((scaled @ axes[:, kept]) ** 2 / sizes[kept], axis=1))


def noise_heard(models: Sequence[Autoregression], blocks: Sequence[RecordBlock]) -> list[Array]:
    """XᵀΩX of `_halves` by output of each record, for noise of these models and its own level."""
    return [
        level[:, None, None]
        * np.array([noise.squared(part) for noise, part in zip(models, _halves(each), strict=True)])
        for each, level in zip(blocks, levels(blocks), strict=True)
    ]


def directions_taken(blocks: Sequence[RecordBlock]) -> list[FittedDirections]:
    """Directions along which the fit takes noise out: of instruments, what they answer to."""
    shared = [block.projected for block in blocks]
    answering = [(b.basis, b.answering) for b in blocks if b.answering is not None]
    if answering:
        apart = [each - basis @ (basis.T @ each) for basis, each in answering]
        ends = np.cumsum([len(each) for each in apart])[:-1]
        shared = np.split(np.linalg.qr(np.vstack(apart))[0], ends)
    return [
        FittedDirections(*(part.reshape(*block.residual.shape, -1) for part in (block.basis, each)))
        for block, each in zip(blocks, shared, strict=True)
    ]


def joined(apart: Array, block: RecordBlock) -> Array:
    """[basis, projected]ᵀ Ω [basis, projected] from halves."""
    m, count = block.basis.shape[1], block.projected.shape[1]
    turn = np.zeros((m + 2 * count, m + count))
    turn[:m, :m] = np.eye(m)
    turn[m : m + count, m:] = turn[m + count :, m:] = np.eye(count)
    return np.asarray(turn.T @ apart @ turn)


def _flight(answers: Array, block: RecordBlock) -> RecordParts:
    """Scores of both halves, their information, and their noise with the own numbers taken out."""
    wide = _halves(block).reshape(block.residual.size, -1)
    m, count = block.basis.shape[1], block.projected.shape[1]
    halves = wide[:, m:]
    turn = np.vstack([-block.basis.T @ halves, np.eye(2 * count)])
    parts = np.split(halves, 2, axis=1)
    # A half is zero in the other, so it meets all of what answers there alone.
    answering = block.projected if block.answering is None else block.answering
    square = np.stack([part.T @ answering for part in parts])
    return RecordParts(
        (halves.T @ block.residual.ravel()).reshape(2, count),
        square,
        (turn.T @ answers @ turn).reshape(2, count, 2, count),
    )


def rest_of(flights: Sequence[RecordParts], beside: JointResiduals | None) -> RecordParts | None:
    """Data that were fitted beside the records, as one more part: its score balances theirs."""
    if beside is None or not beside.measured:
        return None
    score = -sum(flight.scores.sum(axis=0) for flight in flights)
    noise = beside.slopes.T @ beside.slopes
    return RecordParts(
        np.asarray(score)[None], (beside.slopes.T @ beside.total)[None], noise[None, :, None]
    )


def freedom_of(
    shared: Array,
    variances: Array,
    models: Sequence[Autoregression],
    blocks: Sequence[RecordBlock],
    half: Array,
) -> Array:
    """Degrees of freedom of each estimate's variance: noise models are themselves estimates.

    Parameters
    ----------
    shared : ndarray, shape (n, n)
        Covariance.
    variances : ndarray, shape (n_outputs, n, n)
        What each output's noise makes of it.
    models : sequence of Autoregression
        By output.
    blocks : sequence of RecordBlock
    half : ndarray, shape (n, n)
        From scores of the blocks to changes of the estimates.

    Reference
    ---------
    Satterthwaite (1946), Biometrics Bulletin 2(6), eq. 17.
    """
    diagonals = np.diagonal(variances, axis1=1, axis2=2)
    doubt = np.zeros(len(half))
    for output, (variance, model) in enumerate(zip(diagonals, models, strict=True)):
        levels = None
        if model.drift is not None:
            # Of unit noise: what an estimate's variance says of the level where it looks.
            parts = [b.projected.reshape(*b.residual.shape, -1)[output] @ half.T for b in blocks]
            levels = variance / np.sum([np.sum(part**2, axis=0) for part in parts], axis=0)
        doubt = doubt + variance**2 / model.freedom(levels)
    # Errors that are known leave no doubt, nor does a residual that vanishes.
    doubtful = doubt > 0.0
    return np.asarray(
        np.where(doubtful, np.diag(shared) ** 2 / np.where(doubtful, doubt, 1.0), np.inf)
    )
