"""Responses by way of a model of the noise: a long ARX model, its weights on outputs, its errors.

``A(q) y(t) = B(q) u(t) + e(t)`` with A and B of many past samples: what is left is new, so inputs
that a loop moved after past noise do not bend A⁻¹B. Far lags are taken in blocks that widen, whose
means stand for their samples: long memory by few numbers.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from flightid.errors import DataError
from flightid.frozen import dataclass
from flightid.responses.errors.functional import Functional, one_by_one
from flightid.responses.errors.noise_levels import LevelProducts, LevelVariances
from flightid.responses.errors.random_error import CovarianceSource, JointErrors, Points

Complex = NDArray[np.complex128]
Real = NDArray[np.float64]
Places = NDArray[np.intp]

SINGLE, OCTAVE = 8, 4
"""Lags that stand alone, and blocks to an octave beyond them."""
SAMPLES_PER_NUMBER = 8
"""Equations for each number of the model."""
MOST_NUMBERS = 60_000_000
"""Of the regressors of all records together."""
RANK = 1e-11


def lag_blocks(reach: int, most: int, in_octave: int = OCTAVE) -> tuple[tuple[int, int], ...]:
    """First lags of blocks and of what follows them: single ones, then ever wider ones.

    Parameters
    ----------
    reach : int
        Last lag.
    most : int
        Blocks at most.
    in_octave : int
        Blocks to an octave, a power of two up to `SINGLE`.

    Example
    -------
    >>> lag_blocks(20, 99)[6:]
    ((7, 8), (8, 9), (9, 11), (11, 13), (13, 15), (15, 17), (17, 21))
    """
    found: list[tuple[int, int]] = []
    first = 1
    while first <= reach and len(found) < most:
        octave = max((first - 1) // SINGLE, 1)
        width = (1 << (octave.bit_length() - 1)) * SINGLE // in_octave if first > SINGLE else 1
        found.append((first, first + width))
        first += width
    return tuple(found)


@dataclass(frozen=True)
class NoiseModel:
    """A long ARX model of all outputs.

    Attributes
    ----------
    blocks : tuple of (int, int)
        Lags of the past samples; see `lag_blocks`.
    direct : bool
        Whether the inputs of the same sample count among the causes.
    regressors : tuple of ndarray, each shape (n − first, n_numbers)
        Past outputs, block by block, then inputs, of each record.
    coefficients : ndarray, shape (n_numbers, n_out)
    inverse : ndarray, shape (n_numbers, n_numbers)
        Of the normal equations.
    innovations : ndarray, shape (n_out, n_out)
        Covariance of what is left.
    sample_time_s : float
    """

    blocks: tuple[tuple[int, int], ...]
    direct: bool
    regressors: tuple[Real, ...]
    coefficients: Real
    inverse: Real
    innovations: Real
    sample_time_s: float

    @classmethod
    def of(
        cls,
        inputs: Sequence[Real],
        outputs: Sequence[Real],
        sample_time_s: float,
        lowest_rad_s: float,
        *,
        direct: bool,
        memory: float = 1.0,
        octave: int = OCTAVE,
    ) -> NoiseModel:
        """Least squares on the samples of all records, means removed.

        `memory` is the share that is kept of the longest lag that the records allow, `octave` the
        number of blocks to an octave of lags.

        Raises
        ------
        DataError
            Too few samples, or too many to hold.

        Reference
        ---------
        Ljung, *System Identification*, 2nd ed., sections 8.4, 10.4 and 13.4: an ARX model of
        rising order is consistent in a closed loop that answers a sample later.
        """
        n_in, n_out = len(inputs[0]), len(outputs[0])
        size = sum(each.shape[1] for each in inputs)
        shortest = min(each.shape[1] for each in inputs)
        cycle = int(2.0 * np.pi / (lowest_rad_s * sample_time_s))
        most = size // (SAMPLES_PER_NUMBER * (n_in + n_out)) - direct
        blocks = lag_blocks(max(min(cycle, shortest // SAMPLES_PER_NUMBER), 1), most, octave)
        if memory < 1.0 and len(blocks) > 2:
            blocks = lag_blocks(max(int(memory * blocks[-1][1]), 2), most, octave)
        numbers = len(blocks) * (n_in + n_out) + direct * n_in
        if len(blocks) < 2 or size * numbers > MOST_NUMBERS:
            few = len(blocks) < 2
            raise DataError(
                f"the records are too {'short' if few else 'long'} for a model of the noise",
                found=f"{size} samples of {n_in + n_out} channels",
                needed="longer records" if few else f"{MOST_NUMBERS // numbers} samples or fewer",
                action="use another estimator"
                if few
                else "resample the records to a lower rate, or use fewer of them",
            )
        first = blocks[-1][1] - 1
        known = tuple(
            np.hstack([_past(y, blocks, first), _causes(u, blocks, first, direct=direct)])
            for u, y in zip(inputs, outputs, strict=True)
        )
        sizes = np.sqrt(np.maximum(sum(np.sum(x**2, axis=0) for x in known), 1e-300))
        normal = sum((x / sizes).T @ (x / sizes) for x in known)
        inverse = np.linalg.pinv(normal, rcond=RANK, hermitian=True) / np.outer(sizes, sizes)
        targets = [y[:, first:].T for y in outputs]
        found = inverse @ sum(x.T @ y for x, y in zip(known, targets, strict=True))
        left = np.vstack([y - x @ found for x, y in zip(known, targets, strict=True)])
        spread = left.T @ left / (len(left) - numbers)
        return cls(blocks, direct, known, found, inverse, spread, sample_time_s)

    @property
    def memory_s(self) -> float:
        """How far its lags reach back, s."""
        return (self.blocks[-1][1] - 1) * self.sample_time_s

    @property
    def freedom(self) -> float:
        """Degrees of freedom of the innovations: equations of an output less their numbers."""
        return float(sum(map(len, self.regressors)) - len(self.coefficients))

    @property
    def n_outputs(self) -> int:
        """Number of outputs."""
        return int(self.coefficients.shape[1])

    def _turns(self, omega_rad_s: Real) -> Complex:
        """Mean delay of each block at each frequency, shape (n_f, n_blocks)."""
        angle = omega_rad_s * self.sample_time_s
        rows = [np.exp(-1j * np.multiply.outer(angle, np.arange(a, b))) for a, b in self.blocks]
        return np.stack([row.mean(axis=1) for row in rows], axis=1)

    def _whitener(self, turns: Complex) -> Complex:
        """A of each frequency, shape (n_f, n_out, n_out)."""
        shape = len(self.blocks), self.n_outputs, self.n_outputs
        kept = self.coefficients[: len(self.blocks) * self.n_outputs].reshape(shape)
        return np.asarray(np.eye(self.n_outputs) - np.einsum("fk,kab->fba", turns, kept))

    def response(self, omega_rad_s: Real) -> Complex:
        """``A⁻¹B``, shape (n_out, n_in, n_f)."""
        turns = self._turns(omega_rad_s)
        under = self._under(turns)
        at = len(self.blocks) * self.n_outputs
        pushes = np.einsum("fki,ko->foi", under, self.coefficients[at:])
        return np.asarray(np.linalg.solve(self._whitener(turns), pushes).transpose(1, 2, 0))

    def _under(self, turns: Complex) -> Complex:
        """What each number of B counts for in each input, shape (n_f, n_numbers_of_b, n_in)."""
        n_in = (len(self.coefficients) - len(self.blocks) * self.n_outputs) // (
            len(self.blocks) + self.direct
        )
        if self.direct:
            turns = np.concatenate([np.ones((len(turns), 1)), turns], axis=1)
        wide = np.einsum("fk,ij->fkij", turns, np.eye(n_in))
        return np.asarray(wide.reshape(len(turns), -1, n_in))

    def slopes(self, omega_rad_s: Real) -> Complex:
        """Change of ``A⁻¹B`` for coefficients, shape (n_out, n_out, n_numbers, n_in, n_f).

        Of the row of the response (first) for a coefficient in the equation of an output (second).
        """
        turns = self._turns(omega_rad_s)
        response = self.response(omega_rad_s)
        past = np.einsum("fk,oif->fkoi", turns, response)
        past = past.reshape(len(turns), -1, response.shape[1])
        causes = np.concatenate([past, self._under(turns)], axis=1)
        noise = np.linalg.inv(self._whitener(turns))
        return np.asarray(np.einsum("fab,fpi->abpif", noise, causes))

    def whitened(self, changes: Real) -> Real:
        """A on samples of all outputs, shape (n − first, n_out)."""
        first = self.blocks[-1][1] - 1
        kept = self.coefficients[: len(self.blocks) * self.n_outputs]
        return np.asarray(changes[:, first:].T - _past(changes, self.blocks, first) @ kept)


def _past(rows: Real, blocks: Sequence[tuple[int, int]], first: int) -> Real:
    """Means of past samples of each row from sample `first` on, (n − first, blocks · rows)."""
    n = rows.shape[1]
    sums = np.concatenate([np.zeros((len(rows), 1)), np.cumsum(rows, axis=1)], axis=1)
    found = [
        (sums[:, first - a + 1 : n - a + 1] - sums[:, first - b + 1 : n - b + 1]) / (b - a)
        for a, b in blocks
    ]
    return np.concatenate(found).T


def _causes(rows: Real, blocks: Sequence[tuple[int, int]], first: int, *, direct: bool) -> Real:
    past = _past(rows, blocks, first)
    return np.hstack([rows[:, first:].T, past]) if direct else past


@dataclass(frozen=True)
class PrewhitenedErrors(JointErrors):
    """Errors of a response by way of a model of the noise, across outputs and frequencies.

    Attributes
    ----------
    model : NoiseModel
    omega_rad_s : ndarray, shape (n_f,)
    doubt : ndarray, shape (n_out, n_in, n_f), optional
        Standard deviation of complex points beside that of the noise, each by itself: what a
        longer memory or narrower blocks may move; see `model_doubt`.
    """

    model: NoiseModel
    omega_rad_s: Real
    doubt: Real | None = None

    def covariances(self, wanted: Sequence[Points]) -> list[Real]:
        """See `JointErrors`."""
        return [root @ root.T + np.diag(self._beside(at)) for at, root in self._roots(wanted)]

    def combined(self, wanted: Sequence[Points], gains: Sequence[Real]) -> Real:
        """See `JointErrors`."""
        return self.combined_by_level(wanted, gains, 0)[0]

    def combined_by_level(
        self, wanted: Sequence[Points], gains: Sequence[Real], count: int
    ) -> tuple[Real, list[LevelVariances]]:
        """See `LevelledErrors`: the innovations are one level, doubt bounds a bias and is known."""
        pairs = list(zip(gains, self._roots(wanted), strict=True))
        total = np.sum([gain @ root for gain, (_, root) in pairs], axis=0)
        beside = np.asarray(sum((gain * self._beside(at)) @ gain.T for gain, (at, _) in pairs))
        own = total @ total.T
        if not count:
            return own + beside, []
        each = np.stack([np.diag(part)[:count] for part in (own, beside)])
        return own + beside, [LevelVariances(each, self._freedom)]

    def by_level(
        self, wanted: Sequence[Points], gains: Sequence[Real]
    ) -> list[LevelProducts | None]:
        """See `LevelledErrors`."""
        found: list[LevelProducts | None] = []
        for gain, (at, root) in zip(gains, self._roots(wanted), strict=True):
            products = root @ (gain @ root).T, self._beside(at)[:, None] * gain.T
            found.append(LevelProducts(np.stack(products), self._freedom))
        return found

    @property
    def _freedom(self) -> Real:
        return np.array([self.model.freedom, np.inf])

    def _roots(self, wanted: Sequence[Points]) -> list[tuple[Points, Real]]:
        return [(each, self._root(each)) for each in wanted]

    def _beside(self, wanted: Points) -> Real:
        """Variances by the doubt, real parts before imaginary ones, shape (2 n_in n_f,)."""
        if self.doubt is None:
            return np.zeros(2 * len(wanted.inputs) * len(wanted.frequencies))
        of_points = self.doubt[wanted.output][np.ix_(wanted.inputs, wanted.frequencies)]
        return np.tile(0.5 * of_points.ravel() ** 2, 2)

    def _root(self, wanted: Points) -> Real:
        """Root of the covariance of some points, shape (2 n_in n_f, n_out · n_numbers)."""
        slopes = self.model.slopes(self.omega_rad_s[wanted.frequencies])[wanted.output]
        slopes = np.einsum("ab,apif->bpif", self._news, slopes[:, :, wanted.inputs])
        found = np.einsum("pq,bpif->ifbq", self._spread, slopes, optimize=True)
        flat = found.reshape(len(wanted.inputs) * len(wanted.frequencies), -1)
        return np.concatenate([flat.real, flat.imag])

    @cached_property
    def _news(self) -> Real:
        return np.asarray(np.linalg.cholesky(self.model.innovations))

    @cached_property
    def _spread(self) -> Real:
        sizes, turned = np.linalg.eigh(self.model.inverse)
        return np.asarray(turned * np.sqrt(np.maximum(sizes, 0.0)))


@dataclass(frozen=True)
class PrewhitenedWeights:
    """Weights of such an estimate on its outputs, to first order: the whitening is held fixed.

    Attributes
    ----------
    model : NoiseModel
    omega_rad_s : ndarray, shape (n_f,)
    """

    model: NoiseModel
    omega_rad_s: Real
    tells_parts: ClassVar[bool] = False

    def functional(self, outputs: Places, inputs: Places, frequencies: Places) -> Functional:
        """See `OutputWeights`; outputs that are left out stay as they were measured."""
        model = self.model
        slopes = model.slopes(self.omega_rad_s[frequencies])[outputs][:, :, :, inputs]

        def apply(changes: Sequence[Real]) -> Complex:
            total = np.zeros(model.coefficients.shape)
            for known, change in zip(model.regressors, changes, strict=True):
                if np.any(change):
                    whole = np.zeros((model.n_outputs, change.shape[1]))
                    whole[outputs] = change
                    total += known.T @ model.whitened(whole)
            return np.asarray(
                np.einsum("abpif,pb->aif", slopes, model.inverse @ total, optimize=True)
            )

        return one_by_one(apply)

    def errors_of(
        self, residuals: Sequence[Real], outputs: Places, resonant_rad_s: float = 0.0
    ) -> CovarianceSource | None:
        """None: innovations are the noise already."""
        del residuals, outputs, resonant_rad_s
        return None

    def errors_with(self, noise: object, outputs: Places) -> CovarianceSource:
        """The errors as they are: they hold a noise model of their own."""
        del noise, outputs
        return PrewhitenedErrors(self.model, self.omega_rad_s)

    def local_spread(self, inputs: Sequence[Real]) -> Real | None:
        """None: the noise model's errors are of the whole band."""
        del inputs
        return None
