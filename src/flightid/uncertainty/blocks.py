"""Least-squares problems as covariances need them: sensitivities by record, and their halves."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from flightid.frozen import dataclass
from flightid.uncertainty.estimated_levels import EstimatedLevels
from flightid.uncertainty.fitted_directions import FittedDirections
from flightid.uncertainty.own_directions import OwnDirections, reaching_few_first, spread
from flightid.uncertainty.parts import LEAST_INFORMATION, RecordParts
from flightid.uncertainty.residual_noise import Autoregression
from flightid.uncertainty.triangle import orthonormal

Array = NDArray[np.float64]
AT_ONCE = 4096
"""Rows that are turned together: they stay in the cache."""


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
        Orthonormal basis of the own numbers' sensitivities and, times it, what gives these: a
        triangle whose columns may stand in another order.
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

    @cached_property
    def own(self) -> OwnDirections:
        """`basis` by output."""
        return OwnDirections(self.basis.reshape(*self.residual.shape, -1))

    @cached_property
    def power(self) -> Array:
        """Squares of the residual, by output."""
        return np.asarray(np.einsum("ij,ij->i", self.residual, self.residual))

    @cached_property
    def products(self) -> tuple[Array, ...]:
        """By output, products of [own, projected, residual] in each half, (2, w, w).

        Of own directions what reaches the output.
        """
        return tuple(self._products(*self.of_output(k), row) for k, row in enumerate(self.residual))

    def _products(self, own: Array, shared: Array, residual: Array) -> Array:
        m, width = own.shape[1], own.shape[1] + shared.shape[1] + 1
        found = np.empty((2, width, width))
        for each, rows in zip(found, self.halved, strict=True):
            first, second, left = own[rows], shared[rows], residual[rows]
            if m:
                each[:m, :m], each[:m, m:-1] = first.T @ first, first.T @ second
                each[:m, -1], each[m:-1, :m] = left @ first, each[:m, m:-1].T
            each[m:-1, m:-1], each[m:-1, -1] = second.T @ second, left @ second
            each[-1, :-1], each[-1, -1] = each[:-1, -1], left @ left
        return found

    @property
    def halved(self) -> tuple[slice, slice]:
        """Samples of both halves."""
        return slice(None, self.middle), slice(self.middle, None)

    def of_output(self, output: int) -> tuple[Array, Array]:
        """Rows of one output, (n_samples, k) each: of `basis` what reaches it, and `projected`."""
        return self.own.columns[output], _of_output(self.projected, self, output)

    @classmethod
    def of(
        cls, shared: Array, own: Array, residual: Array, *, overwrite: bool = False
    ) -> RecordBlock:
        """From sensitivities by shared parameters and by own numbers, (n_outputs, n_samples, k).

        With `overwrite` what is left of the shared ones takes their memory.
        """
        rows = residual.size
        order = reaching_few_first(own.reshape(*residual.shape, -1))
        # Columns of longer rows stay where they are.
        shared, own = shared.reshape(rows, -1), own.reshape(rows, -1)
        basis, triangle = orthonormal(own, order)
        on_own = basis.T @ shared
        projected = shared
        if own.size:
            projected = shared if overwrite else np.empty_like(shared)
            for begin in range(0, rows, AT_ONCE):
                here = slice(begin, begin + AT_ONCE)
                np.subtract(shared[here], basis[here] @ on_own, out=projected[here])
        return cls(projected, on_own, basis, triangle, residual)

    def along(
        self, directions: Array, *, overwrite: bool = False, alone: bool = False
    ) -> RecordBlock:
        """The same by combinations of the parameters, one a column.

        With `overwrite` in the memory of this block's sensitivities, which are then no longer its.
        `alone` says that they are orthonormal by these: squares tell what each sample does.
        """
        half = None if alone and self.half is None else self.middle
        answering = None if self.answering is None else self.answering @ directions
        turned = self.projected if overwrite else np.empty_like(self.projected)
        shares = np.zeros(len(turned) if half is None else 0)
        for begin in range(0, len(turned), AT_ONCE):
            rows = slice(begin, begin + AT_ONCE)
            turned[rows] = self.projected[rows] @ directions
            if half is None:
                np.einsum("ij,ij->i", turned[rows], turned[rows], out=shares[rows])
        if half is None:
            half = middle_of(shares.reshape(self.residual.shape).sum(axis=0))
        return replace(
            self,
            projected=turned,
            shared_on_own=self.shared_on_own @ directions,
            answering=answering,
            half=half,
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
    levels : EstimatedLevels, optional
        Of the noise that their unit variance was estimated from.
    """

    slopes: Array
    total: Array
    measured: bool = True
    bias: Array | None = None
    levels: EstimatedLevels | None = None

    def along(self, directions: Array) -> JointResiduals:
        """The same by combinations of the parameters, one a column."""
        levels = None if self.levels is None else self.levels.along(directions)
        slopes, total = self.slopes @ directions, self.total @ directions
        return replace(self, slopes=slopes, total=total, levels=levels)

    def of(self, parameters: NDArray[np.bool_]) -> JointResiduals:
        """Columns of some parameters."""
        return self.along(np.eye(len(parameters))[:, parameters])


def flights_of(apart: Sequence[Array], blocks: Sequence[RecordBlock]) -> list[RecordParts]:
    """Records with their halves, from what `noise_heard` gives of each."""
    return [_flight(each.sum(axis=0), block) for each, block in zip(apart, blocks, strict=True)]


def levels(blocks: Sequence[RecordBlock]) -> Array:
    """Residual variance of each record and output over that of all, (n_records, n_outputs).

    Records of one colour need not be of one level: a harder manoeuvre may be a noisier one.
    """
    squares = np.array([block.power for block in blocks])
    counts = np.array([block.residual.shape[1] for block in blocks])
    common = squares.sum(axis=0) / counts.sum()
    known = common > 0.0
    return np.where(known, squares / counts[:, None] / np.where(known, common, 1.0), 1.0)


def _of_output(part: Array, block: RecordBlock, output: int) -> Array:
    """Rows of one output, (n_samples, k)."""
    n_samples = block.residual.shape[1]
    return part[output * n_samples : (output + 1) * n_samples]


def halves(block: RecordBlock, output: int) -> Array:
    """[basis, projected in the first half, projected in the second] of one output.

    Of the basis what reaches the output: shape (n_samples, k + 2 n).
    """
    own, shared = block.of_output(output)
    m, count, half = own.shape[1], shared.shape[1], block.middle
    wide = np.zeros((len(shared), m + 2 * count))
    wide[:, :m] = own
    wide[:half, m : m + count] = shared[:half]
    wide[half:, m + count :] = shared[half:]
    return wide


def _squares_of_halves(block: RecordBlock, output: int) -> Array:
    """Products of `halves`, of which one is zero where the other is not."""
    products, count = block.products[output], block.projected.shape[1]
    m = products.shape[1] - count - 1
    found = np.zeros((m + 2 * count, m + 2 * count))
    found[:m, :m] = products[:, :m, :m].sum(axis=0)
    for first, part in zip((m, m + count), products, strict=True):
        span = slice(first, first + count)
        found[span, span], found[:m, span] = part[m:-1, m:-1], part[:m, m:-1]
        found[span, :m] = found[:m, span].T
    return found


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
    square = slopes.T @ slopes
    size = np.sqrt(np.diag(square))
    seen = size > 0.0
    unit = size[seen]
    sizes, axes = np.linalg.eigh(square[np.ix_(seen, seen)] / unit[:, None] / unit)
    kept = sizes > LEAST_INFORMATION
    turn = np.zeros((len(size), int(kept.sum())))
    turn[seen] = axes[:, kept] / np.sqrt(sizes[kept]) / size[seen, None]
    found = np.empty(len(slopes))
    for begin in range(0, len(slopes), AT_ONCE):
        turned = slopes[begin : begin + AT_ONCE] @ turn
        found[begin : begin + AT_ONCE] = np.einsum("ij,ij->i", turned, turned)
    return found


def noise_heard(models: Sequence[Autoregression], blocks: Sequence[RecordBlock]) -> list[Array]:
    """XᵀΩX of `halves` by output of each record, for noise of these models and its own level."""
    return [
        level[:, None, None] * np.array([_heard(noise, each, o) for o, noise in enumerate(models)])
        for each, level in zip(blocks, levels(blocks), strict=True)
    ]


def _heard(noise: Autoregression, block: RecordBlock, output: int) -> Array:
    heard = (
        np.asarray(noise.lags[0] * _squares_of_halves(block, output))
        if noise.is_white
        else noise.squared(halves(block, output))
    )
    return of_all_halves(heard, block, output)


def of_all_halves(found: Array, block: RecordBlock, output: int) -> Array:
    """Products of `halves` of one output, those of all of the basis, (m + 2 n, m + 2 n)."""
    count = 2 * block.projected.shape[1]
    return spread(found, block.own.within(output, count), block.own.count + count)


def directions_taken(blocks: Sequence[RecordBlock]) -> list[FittedDirections]:
    """Directions along which the fit takes noise out: of instruments, what they answer to."""
    shared = [block.projected for block in blocks]
    answering = [(b.basis, b.answering) for b in blocks if b.answering is not None]
    if answering:
        apart = [each - basis @ (basis.T @ each) for basis, each in answering]
        ends = np.cumsum([len(each) for each in apart])[:-1]
        shared = np.split(np.linalg.qr(np.vstack(apart))[0], ends)
    return [
        FittedDirections(
            block.own.whole,
            each.reshape(*block.residual.shape, -1),
            block.own,
            None if answering else [np.asarray(part.sum(axis=0)) for part in block.products],
        )
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
    count = block.projected.shape[1]
    scores, square = np.zeros((2, count)), np.zeros((2, count, count))
    on_own = np.zeros((block.basis.shape[1], 2, count))
    for output, products in enumerate(block.products):
        m = products.shape[1] - count - 1
        scores += products[:, m:-1, -1]
        on_own[block.own.places[output]] += products[:, :m, m:-1].swapaxes(0, 1)
        if block.answering is None:
            square += products[:, m:-1, m:-1]
            continue
        parts = (_of_output(each, block, output) for each in (block.projected, block.answering))
        shared, answer = parts
        # A half meets what answers there alone.
        square += [shared[rows].T @ answer[rows] for rows in block.halved]
    turn = np.vstack([-on_own.reshape(len(on_own), 2 * count), np.eye(2 * count)])
    return RecordParts(scores, square, (turn.T @ answers @ turn).reshape(2, count, 2, count))


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
    beside: EstimatedLevels | None = None,
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
    beside : EstimatedLevels, optional
        Of what was fitted beside the blocks, as the same scores hear it.

    Reference
    ---------
    Satterthwaite (1946), Biometrics Bulletin 2(6), eq. 17.
    """
    diagonals = np.diagonal(variances, axis1=1, axis2=2)
    doubt = np.zeros(len(half)) if beside is None else beside.doubt(half)
    for output, (variance, model) in enumerate(zip(diagonals, models, strict=True)):
        levels = None
        if model.drift is not None:
            # Of unit noise: what an estimate's variance says of the level where it looks.
            parts = [b.projected.reshape(*b.residual.shape, -1)[output] @ half.T for b in blocks]
            square = np.sum([np.sum(part**2, axis=0) for part in parts], axis=0)
            # An output that tells nothing of an estimate brings no doubt of it either.
            levels = variance / np.where(square > 0.0, square, 1.0)
        doubt = doubt + variance**2 / model.freedom(levels)
    # Errors that are known leave no doubt, nor does a residual that vanishes.
    doubtful = doubt > 0.0
    found = np.where(doubtful, np.diag(shared) ** 2 / np.where(doubtful, doubt, 1.0), np.inf)
    # A level that has one comes out one to rounding, and Student's law has no less.
    return np.asarray(np.maximum(found, 1.0))
