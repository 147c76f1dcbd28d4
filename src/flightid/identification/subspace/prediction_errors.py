"""Prediction-error refinement of innovations models in data-driven local coordinates."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from flightid.identification.multistart import DenseEnd
from flightid.identification.subspace.data import SubspaceData
from flightid.identification.subspace.matrices import STABLE, adjoint_run, level_motion
from flightid.models.innovations.prediction import RANK
from flightid.models.sampled.recursion import run_recursion, spectral_radius
from flightid.progress import progress
from flightid.uncertainty.agreement import Agreement
from flightid.uncertainty.blocks import RecordBlock
from flightid.uncertainty.coloured_residuals import white_covariance

Array = NDArray[np.float64]
Matrices = tuple[Array, Array, Array, Array, Array]
Run = tuple[Array, Array, Array]
"""Errors of a record, its states, and its free motions."""
DISTINCT = 1e-12
"""Least share of an error that the other outputs do not hold, below which it is rounding."""
BATCH = 2**20
"""Numbers of runs that are made at once: long records are run signal by signal."""
ROUNDS = 12
SETTLED = 1e-10
"""Relative change of the log determinant of the innovations between rounds."""


@dataclass(frozen=True, eq=False)
class RefinementResult:
    """Outcome of the search.

    Attributes
    ----------
    matrices : tuple of ndarray
        A, B, C, D, K.
    errors : tuple of ndarray, shape (p, n_samples)
        For each record.
    covariance : ndarray, shape (d, d), or None
        Of the entries of A, B, C, (D,) K, row by row, singular along changes of coordinates.
    degrees : int
        Degrees of freedom of the errors.
    iterations : int
    termination : str
    agreement : Agreement or None
        Of records and of their halves, along independent directions of the entries.
    """

    matrices: Matrices
    errors: tuple[Array, ...]
    covariance: Array | None
    degrees: int
    iterations: int
    termination: str
    agreement: Agreement | None = None


@dataclass(frozen=True, eq=False)
class Predictor:
    """Whitened prediction errors of all records as a function of the entries of the matrices.

    `stable` models alone are allowed where the search starts from one.
    """

    data: SubspaceData
    shapes: tuple[tuple[int, int], ...]
    direct: bool
    free_initial: bool
    stable: bool = False

    @classmethod
    def of(
        cls, data: SubspaceData, start: Matrices, *, direct: bool, initial_state: str
    ) -> Predictor:
        """For models of one shape, stable ones where the first is."""
        shapes = [each.shape for each in start]
        free = tuple(shapes) if direct else (*shapes[:3], shapes[4])
        stable = spectral_radius(start[0]) < STABLE
        return cls(data, free, direct, initial_state == "estimate", stable)

    def unpack(self, theta: Array) -> Matrices:
        """A, B, C, D, K from their entries."""
        n, p, m = self.shapes[0][0], self.data.n_outputs, self.data.n_inputs
        found, first = [], 0
        for rows, columns in self.shapes:
            found.append(theta[first : first + rows * columns].reshape(rows, columns))
            first += rows * columns
        if not self.direct:
            found.insert(3, np.zeros((p, m)))
        a, b, c, d, k = found
        return a.reshape(n, n), b, c, d, k

    def pack(self, matrices: Matrices) -> Array:
        """Entries of the free matrices, row by row."""
        a, b, c, d, k = matrices
        free = (a, b, c, d, k) if self.direct else (a, b, c, k)
        return np.concatenate([matrix.ravel() for matrix in free])

    def errors(self, matrices: Matrices) -> list[Run]:
        """Errors, states and free motions of each record, those of levels after those of states."""
        a, b, c, d, k = matrices
        closed, found = a - k @ c, []
        for y, u in zip(self.data.outputs, self.data.inputs, strict=True):
            n = a.shape[0]
            forcing = np.zeros((n + 1, n, y.shape[1]))
            forcing[n] = (b - k @ d) @ u + k @ y
            runs = run_recursion(closed, forcing, np.eye(n + 1, n))
            moved, state = runs[:n], runs[n]
            if not self.free_initial:
                moved = moved[:0]
            if self.data.channels.levels:
                moved = np.concatenate([moved, level_motion(closed, c, k, y.shape[1])[0]])
            error = y - c @ state - d @ u
            found.append((error, state, moved))
        return found

    def residuals(
        self, matrices: Matrices, whiten: Array, runs: list[Run] | None = None
    ) -> tuple[list[Array], list[Array]]:
        """Whitened errors of each record after the initial state, and the bases taken out.

        `runs` are the `errors` of these matrices, where they are known.
        """
        c, out, bases = matrices[2], [], []
        for error, _, moved in self.errors(matrices) if runs is None else runs:
            basis = self._basis(whiten @ self._seen(c, moved))
            flat = (whiten @ error).ravel()
            out.append(flat - basis @ (basis.T @ flat))
            bases.append(basis)
        return out, bases

    def _basis(self, motion: Array) -> Array:
        columns = motion.reshape(len(motion), math.prod(motion.shape[1:])).T
        if not len(motion):
            return columns
        left, sizes, _ = np.linalg.svd(columns, full_matrices=False)
        return np.asarray(left[:, sizes > RANK * max(float(sizes[0]), 1e-300)])

    def _seen(self, c: Array, moved: Array) -> Array:
        """What own numbers of a record make of its outputs: initial states, then levels."""
        seen = np.asarray(c @ moved)
        p = len(c) if self.data.channels.levels else 0
        seen[len(moved) - p :] += np.eye(len(c))[: p or 0, :, None]
        return seen

    def levels(self, matrices: Matrices, whiten: Array) -> list[Array]:
        """Level of each output in each record, beside its initial state."""
        c, p = matrices[2], self.data.n_outputs
        found = []
        for error, _, moved in self.errors(matrices):
            columns = (whiten @ self._seen(c, moved)).reshape(len(moved), error.size).T
            own = np.linalg.lstsq(columns, (whiten @ error).ravel(), rcond=RANK)[0]
            found.append(np.asarray(own[-p:]) if self.data.channels.levels else np.zeros(p))
        return found

    def fitted_errors(self, matrices: Matrices, whiten: Array) -> tuple[Array, ...]:
        """Errors of each record with its initial state, in the outputs' units."""
        rows, _ = self.residuals(matrices, whiten)
        return tuple(
            np.asarray(np.linalg.solve(whiten, row.reshape(y.shape)), dtype=np.float64)
            for row, y in zip(rows, self.data.outputs, strict=True)
        )

    def jacobian(
        self,
        matrices: Matrices,
        whiten: Array,
        basis: Array,
        runs: list[Run] | None = None,
        bases: list[Array] | None = None,
    ) -> Array:
        """Derivatives of `residuals` along the columns of a basis, shape (rows, n_basis).

        `runs` and `bases` are what `errors` and `residuals` made of these matrices, where known.

        Reference: Kaufman (1975), *BIT* 15, for the elimination of the initial states.
        """
        c = matrices[2]
        parts = []
        runs = self.errors(matrices) if runs is None else runs
        bases = self.residuals(matrices, whiten, runs)[1] if bases is None else bases
        for (error, state, moved), taken, u in zip(runs, bases, self.data.inputs, strict=True):
            seen = self._seen(c, moved)
            columns = seen.reshape(len(moved), error.size).T
            own = np.linalg.lstsq(columns, error.ravel(), rcond=RANK)[0]
            made = np.zeros((basis.shape[1], *error.shape))
            left = error - np.tensordot(own, seen, axes=1)
            signals = (left, state + np.tensordot(own, moved, axes=1), u)
            self._add_slopes(made, matrices, basis, signals)
            flat = (whiten @ made).reshape(basis.shape[1], -1).T
            parts.append(flat - taken @ (taken.T @ flat))
        return np.ascontiguousarray(np.vstack(parts))

    def _add_slopes(
        self, made: Array, matrices: Matrices, basis: Array, signals: tuple[Array, Array, Array]
    ) -> None:
        """De = -C (q - A + K C)⁻¹ (dA x + dB u + dK e - K dC x - K dD u) - dC x - dD u."""
        a, _, c, _, k = matrices
        error, state, u = signals
        closed = a - k @ c
        by = iter(np.split(basis, np.cumsum([r * w for r, w in self.shapes])[:-1]))
        slopes = [each.reshape(*s, -1) for each, s in zip(by, self.shapes, strict=True)]
        da, db, dc = slopes[:3]
        dk = slopes[-1]
        entering = [da - np.tensordot(k, dc, axes=1), dk, db]
        if self.direct:
            entering[2] = db - np.tensordot(k, slopes[3], axes=1)
        wide, rows = np.concatenate(entering, axis=1).T, np.concatenate([state, error, u])
        together = max(BATCH // (c.size * rows.shape[1]), 1)
        for first in range(0, len(rows), together):
            some = slice(first, first + together)
            # Every signal enters every state: one product over both.
            passed = adjoint_run(closed, c, rows[some]).reshape(-1, made[0].size)
            made -= (wide[:, some].reshape(len(made), -1) @ passed).reshape(made.shape)
        made -= np.tensordot(dc, state, axes=(1, 0)).swapaxes(0, 1)
        if self.direct:
            made -= np.tensordot(slopes[3], u, axes=(1, 0)).swapaxes(0, 1)


def refine(
    data: SubspaceData,
    start: Matrices,
    *,
    direct: bool,
    initial_state: str,
    maximum_iterations: int,
) -> RefinementResult:
    """Smallest log determinant of the innovations' covariance, from a subspace estimate.

    Each round weights the errors of different outputs by their covariance and searches along the
    directions that change the model's behaviour, not only its coordinates.

    Reference: McKelvey, Helmersson & Ribarits (2004), *Automatica* 40, data-driven local
    coordinates; Ljung, *System Identification*, 2nd ed., eq. 15.39.
    """
    n = start[0].shape[0]
    predictor = Predictor.of(data, start, direct=direct, initial_state=initial_state)
    free = predictor.shapes
    matrices = _balanced(predictor, start)
    iterations, termination, last = 0, "rounds", np.inf
    errors = predictor.fitted_errors(matrices, np.eye(data.n_outputs))
    with progress(ROUNDS, "refining the model") as advance:
        for _ in range(ROUNDS):
            level = _level(errors)
            if not np.isfinite(level) or last - level <= SETTLED * max(1.0, abs(level)):
                termination = "cost" if np.isfinite(level) else "zero"
                break
            last = level
            whiten = whitener(errors)
            matrices, steps, ended = _search(predictor, matrices, whiten, maximum_iterations)
            errors = predictor.fitted_errors(matrices, whiten)
            iterations += steps
            advance()
            if ended == "iterations":
                termination = ended
                break
    samples = sum(e.shape[1] for e in errors)
    own = n * len(errors) if initial_state == "estimate" else 0
    own += data.n_outputs * len(errors) * data.channels.levels
    degrees = max(samples * data.n_outputs - _count(free, n) - own, 1)
    covariance, agreement = _covariance(predictor, matrices, errors, degrees)
    if agreement is not None and agreement.freedom is not None:
        degrees = max(1, int(np.min(agreement.freedom)))
    return RefinementResult(
        matrices, errors, covariance, degrees, iterations, termination, agreement
    )


def _count(shapes: tuple[tuple[int, ...], ...], n: int) -> int:
    return sum(r * c for r, c in shapes) - n * n


def _level(errors: tuple[Array, ...]) -> float:
    joint = np.hstack(errors)
    covariance = joint @ joint.T / joint.shape[1]
    sign, value = np.linalg.slogdet(covariance)
    return float(value) if sign > 0 and value > -60.0 * len(joint) else -np.inf


def spare_states(lower: RefinementResult, found: RefinementResult, numbers: int) -> str:
    """Why fewer states do as well, by the Bayesian information criterion; else empty.

    Parameters
    ----------
    lower, found : RefinementResult
        With fewer states, and as asked.
    numbers : int
        Parameters that a state brings.

    Reference
    ---------
    Schwarz (1978), Estimating the dimension of a model, *Annals of Statistics* 6.
    """
    samples = sum(each.shape[1] for each in found.errors)
    order, fewer = (each.matrices[0].shape[0] for each in (found, lower))
    gained = samples * (_level(lower.errors) - _level(found.errors))
    if not np.isfinite(gained) or gained >= (order - fewer) * numbers * np.log(samples):
        return ""
    return f"{fewer} states foretell the outputs as well as {order}"


def _balanced(predictor: Predictor, matrices: Matrices) -> Matrices:
    """States of unit covariance over the records, so that steps have one size."""
    a, b, c, d, k = matrices
    states = np.hstack([state for _, state, _ in predictor.errors(matrices)])
    left, sizes, _ = np.linalg.svd(states @ states.T / states.shape[1])
    size = np.sqrt(np.maximum(sizes, 1e-24 * sizes[0]))
    to, back = left.T / size[:, None], left * size
    return to @ a @ back, to @ b, c @ back, d, to @ k


def _tangent(predictor: Predictor, matrices: Matrices) -> Array:
    """Orthonormal directions that leave the orbit of changes of coordinates, (d, d - n²)."""
    a, b, c, d, k = matrices
    n = a.shape[0]
    moves = []
    for i in range(n):
        for j in range(n):
            x = np.zeros((n, n))
            x[i, j] = 1.0
            moves.append(predictor.pack((x @ a - a @ x, x @ b, -c @ x, 0.0 * d, x @ k)))
    full = np.linalg.qr(np.array(moves).T, mode="complete")[0]
    return np.asarray(full[:, n * n :])


def whitener(errors: tuple[Array, ...], degrees: int | None = None) -> Array:
    """Whitening of errors of different outputs by their covariance, shape (p, p)."""
    joint = np.hstack(errors)
    count = joint.shape[1] if degrees is None else degrees / len(joint)
    size = np.sqrt(np.sum(joint**2, axis=1) / count)
    size = np.where(size > 0.0, size, 1.0)
    alike = (joint / size[:, None]) @ (joint / size[:, None]).T / count
    # Outputs that are one and the same but for rounding.
    lift = max(DISTINCT - float(np.linalg.eigvalsh(alike)[0]), 0.0)
    root = np.linalg.cholesky(alike + lift * np.eye(len(size)))
    return np.asarray(np.linalg.inv(root) / size)


def _search(
    predictor: Predictor, matrices: Matrices, whiten: Array, maximum_iterations: int
) -> tuple[Matrices, int, str]:
    basis = _tangent(predictor, matrices)
    origin = predictor.pack(matrices)
    rows = sum(y.size for y in predictor.data.outputs)
    last: dict[bytes, tuple[Matrices, list[Run], list[Array]]] = {}

    def residuals(step: Array) -> Array:
        trial = predictor.unpack(origin + basis @ step)
        if spectral_radius(trial[0] - trial[4] @ trial[2]) >= STABLE:
            return np.full(rows, np.inf)
        if predictor.stable and spectral_radius(trial[0]) >= STABLE:
            return np.full(rows, np.inf)
        runs = predictor.errors(trial)
        found, taken = predictor.residuals(trial, whiten, runs)
        last.clear()
        last[step.tobytes()] = trial, runs, taken
        return np.concatenate(found)

    def jacobian(step: Array) -> Array:
        known = last.get(step.tobytes())
        if known is None:
            return predictor.jacobian(predictor.unpack(origin + basis @ step), whiten, basis)
        at, runs, bases = known
        return predictor.jacobian(at, whiten, basis, runs, bases)

    free = np.full(basis.shape[1], np.inf)
    end = DenseEnd.searched(
        residuals, jacobian, np.zeros(basis.shape[1]), -free, free, rows, maximum_iterations
    )
    return predictor.unpack(origin + basis @ end.x), end.iterations, end.termination


def _covariance(
    predictor: Predictor, matrices: Matrices, errors: tuple[Array, ...], degrees: int
) -> tuple[Array | None, Agreement | None]:
    if not np.isfinite(_level(errors)):
        return None, None
    basis = _tangent(predictor, matrices)
    whiten = whitener(errors, degrees)
    jacobian = predictor.jacobian(matrices, whiten, basis)
    triangle = np.linalg.qr(jacobian, mode="r")
    lengths = np.linalg.norm(triangle, axis=0)
    if np.any(np.abs(np.diag(triangle)) <= 1e-11 * np.maximum(lengths, 1e-300)):
        return None, None
    root = np.linalg.inv(triangle)
    ends = np.cumsum([each.size for each in errors])[:-1]
    blocks = [
        RecordBlock.of(part, np.zeros((len(part), 0)), (whiten @ each))
        for part, each in zip(np.split(-jacobian, ends), errors, strict=True)
    ]
    agreed = white_covariance(blocks, root @ root.T, degrees)
    return np.asarray(basis @ agreed.covariance @ basis.T), agreed.agreement
