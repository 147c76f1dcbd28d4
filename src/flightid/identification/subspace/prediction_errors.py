"""Prediction-error refinement of innovations models in data-driven local coordinates."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial

import numpy as np
from numpy.typing import NDArray

from flightid import _native
from flightid.frozen import dataclass
from flightid.identification.multistart import DenseEnd
from flightid.identification.records.nuisance import Nuisance, NuisanceDirections
from flightid.identification.subspace.data import SubspaceData
from flightid.identification.subspace.determinant import Goal, log_determinant
from flightid.identification.subspace.matrices import STABLE
from flightid.identification.subspace.predictor_columns import AT_ONCE, OwnColumns
from flightid.identification.subspace.slopes import SlopeDrives, triangle_of_products
from flightid.models.sampled.recursion import run_recursion, spectral_radius
from flightid.progress import progress
from flightid.uncertainty.agreement import Agreement
from flightid.uncertainty.blocks import RecordBlock
from flightid.uncertainty.coloured_residuals import white_covariance
from flightid.uncertainty.triangle import triangle_of_rows

Array = NDArray[np.float64]
Matrices = tuple[Array, Array, Array, Array, Array]
DISTINCT = 1e-12
"""Least share of an error that the other outputs do not hold, below which it is rounding."""
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

    def errors(self, matrices: Matrices, whiten: Array) -> list[Array]:
        """Whitened errors of each record from rest, shape (p, n_samples)."""
        a, b, c, d, k = matrices
        forced = np.hstack([b - k @ d, k])[None]
        direct = whiten @ np.hstack([-d, np.eye(len(c))])
        run = a - k @ c, whiten @ c, forced, direct[None]
        made = [_native.slope_recursion(*run, each, anyhow=True) for each in self.data.signals]
        return [np.ascontiguousarray(each[:, :, 0].T) for each in made]

    def states(self, matrices: Matrices, own: Sequence[Array]) -> list[Array]:
        """States of each record with its own numbers."""
        a, b, c, d, k = matrices
        p, found = len(c), []
        for y, u, values in zip(self.data.outputs, self.data.inputs, own, strict=True):
            forcing = (b - k @ d) @ u + k @ (y - self._level(values, p)[:, None])
            found.append(run_recursion(a - k @ c, forcing, self._start(values, len(a))))
        return found

    def _start(self, own: Array, n: int) -> Array:
        return own[:n] if self.free_initial and len(own) else np.zeros(n)

    def _level(self, own: Array, p: int) -> Array:
        return own[-p:] if self.data.channels.levels and len(own) else np.zeros(p)

    def residuals(self, matrices: Matrices, whiten: Array) -> tuple[list[Array], list[Nuisance]]:
        """Whitened errors of each record after its own numbers, and what was taken out.

        Own numbers show in the first samples alone where no level is free.
        """
        a, _, c, _, k = matrices
        levels = self.data.channels.levels
        own = OwnColumns(a - k @ c, whiten @ c, k, whiten, self.free_initial, levels)
        out, found = self.errors(matrices, whiten), []
        for place, made in enumerate(out):
            with np.errstate(over="ignore", invalid="ignore"):
                columns = own.columns(made.shape[1])
            # Where a run has no end, nothing is taken out of errors without end.
            if not (np.all(np.isfinite(made)) and np.all(np.isfinite(columns))):
                out[place] = np.full(made.shape, np.inf)
                columns = columns[:, :0, :0]
            shown = out[place][:, : columns.shape[1]]
            taken = NuisanceDirections.of(columns.reshape(shown.size, columns.shape[2])).best(
                shown.ravel()
            )
            shown[:] = taken.removed_from(shown.ravel()).reshape(shown.shape)
            found.append(taken)
        return out, found

    def levels(self, matrices: Matrices, whiten: Array) -> list[Array]:
        """Level of each output in each record, beside its initial state."""
        p = self.data.n_outputs
        if not self.data.channels.levels:
            return [np.zeros(p) for _ in self.data.outputs]
        return [self._level(own.values, p) for own in self.residuals(matrices, whiten)[1]]

    def fitted_errors(self, matrices: Matrices, whiten: Array) -> tuple[Array, ...]:
        """Errors of each record with its initial state, in the outputs' units."""
        rows, _ = self.residuals(matrices, whiten)
        return tuple(np.asarray(np.linalg.solve(whiten, row), dtype=np.float64) for row in rows)

    def jacobian(
        self,
        matrices: Matrices,
        whiten: Array,
        basis: Array,
        found: list[Nuisance] | None = None,
    ) -> Array:
        """Derivatives of `residuals` along the columns of a basis, shape (rows, n_basis).

        `found` is what `residuals` took out at these matrices, where that is known.

        Reference: Kaufman (1975), *BIT* 15, for the elimination of the initial states.
        """
        _, _, c, d, _ = matrices
        found = self.residuals(matrices, whiten)[1] if found is None else found
        states = self.states(matrices, [own.values for own in found])
        drives = SlopeDrives.of(matrices, whiten, basis, self.shapes)
        parts = []
        for own, state, y, u in zip(
            found, states, self.data.outputs, self.data.inputs, strict=True
        ):
            error = y - self._level(own.values, len(c))[:, None] - c @ state - d @ u
            made = drives.columns(state, error, u)
            rows, n_own = made.reshape(len(c), y.shape[1], -1), own.space.shape[1]
            space = own.space.reshape(len(c), len(own.space) // len(c), n_own)
            pairs = [(row[: len(each)], each) for row, each in zip(rows, space, strict=True)]
            along = np.sum([each.T @ row for row, each in pairs], axis=0)
            for row, each in pairs:
                for first in range(0, len(row), AT_ONCE):
                    row[first : first + AT_ONCE] -= each[first : first + AT_ONCE] @ along
            parts.append(made)
        return parts[0] if len(parts) == 1 else np.vstack(parts)

    def triangle(
        self,
        matrices: Matrices,
        whiten: Array,
        basis: Array,
        left: Sequence[Array],
        found: Sequence[Nuisance],
    ) -> Array | None:
        """Triangle of `jacobian` and `residuals`, a column of it a row; neither is held.

        None where products of slopes lost too many digits. `left` and `found` are what
        `residuals` gave at these matrices.
        """
        drives, parts = SlopeDrives.of(matrices, whiten, basis, self.shapes), []
        for joint, errors, own in zip(self.data.signals, left, found, strict=True):
            level, m = self._level(own.values, len(errors)), self.data.n_inputs
            about = np.vstack([joint[:m], joint[m:] - level[:, None]]) if np.any(level) else joint
            start = self._start(own.values, len(matrices[0]))
            parts.append(drives.products(about, start, errors, own))
        return triangle_of_products(parts, basis.shape[1])


def refine(
    data: SubspaceData,
    start: Matrices,
    *,
    direct: bool,
    initial_state: str,
    maximum_iterations: int,
    enough: float | None = None,
) -> RefinementResult:
    """Smallest log determinant of the innovations' covariance, from a subspace estimate.

    Where only whether it is below `enough` is asked, the search ends where that is known or its
    steps gain less than `FAR` of what is missing; there is no covariance then.

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
            level = log_determinant(errors)
            if not np.isfinite(level) or last - level <= SETTLED * max(1.0, abs(level)):
                termination = "cost" if np.isfinite(level) else "zero"
                break
            last = level
            whiten = whitener(errors)
            goal = None if enough is None else Goal(level, enough, sum(e.size for e in errors))
            search = _search(predictor, matrices, whiten, maximum_iterations, goal)
            matrices, steps, ended = search
            errors = predictor.fitted_errors(matrices, whiten)
            iterations += steps
            advance()
            if goal is not None and goal.is_known:
                termination = ended
                break
            if ended == "iterations":
                termination = ended
                break
    samples = sum(e.shape[1] for e in errors)
    own = n * len(errors) if initial_state == "estimate" else 0
    own += data.n_outputs * len(errors) * data.channels.levels
    degrees = max(samples * data.n_outputs - _count(free, n) - own, 1)
    covariance, agreement = None, None
    if enough is None:
        if np.isfinite(last):
            # Initial states and levels are weighed by what was found, as predictions are.
            errors = predictor.fitted_errors(matrices, whitener(errors))
        covariance, agreement = _covariance(predictor, matrices, errors, degrees)
    if agreement is not None and agreement.freedom is not None:
        degrees = max(1, int(np.min(agreement.freedom)))
    return RefinementResult(
        matrices, errors, covariance, degrees, iterations, termination, agreement
    )


def _count(shapes: tuple[tuple[int, ...], ...], n: int) -> int:
    return sum(r * c for r, c in shapes) - n * n


def _balanced(predictor: Predictor, matrices: Matrices) -> Matrices:
    """States of unit covariance over the records, so that steps have one size."""
    a, b, c, d, k = matrices
    none = [np.zeros(0)] * len(predictor.data.outputs)
    states = np.hstack(predictor.states(matrices, none))
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
    predictor: Predictor,
    matrices: Matrices,
    whiten: Array,
    maximum_iterations: int,
    goal: Goal | None,
) -> tuple[Matrices, int, str]:
    basis = _tangent(predictor, matrices)
    origin = predictor.pack(matrices)
    rows = sum(y.size for y in predictor.data.outputs)
    last: dict[bytes, tuple[Matrices, list[Array], list[Nuisance]]] = {}

    def residuals(step: Array) -> Array:
        trial = predictor.unpack(origin + basis @ step)
        if spectral_radius(trial[0] - trial[4] @ trial[2]) >= STABLE:
            return np.full(rows, np.inf)
        if predictor.stable and spectral_radius(trial[0]) >= STABLE:
            return np.full(rows, np.inf)
        left, own = predictor.residuals(trial, whiten)
        last.clear()
        last[step.tobytes()] = trial, left, own
        return np.concatenate([each.ravel() for each in left])

    def jacobian(step: Array) -> Array:
        known = last.get(step.tobytes())
        if known is None:
            return predictor.jacobian(predictor.unpack(origin + basis @ step), whiten, basis)
        return predictor.jacobian(known[0], whiten, basis, known[2])

    def triangle(step: Array) -> Array | None:
        known = last.get(step.tobytes())
        if known is None or rows <= 2 * basis.shape[1]:
            return None
        return predictor.triangle(known[0], whiten, basis, known[1], known[2])

    free = np.full(basis.shape[1], np.inf)
    known = None if goal is None else partial(goal.is_decided, predictor.data.n_outputs)
    end = DenseEnd.searched(
        residuals,
        jacobian,
        np.zeros(len(free)),
        -free,
        free,
        rows,
        maximum_iterations,
        known,
        triangle,
    )
    return predictor.unpack(origin + basis @ end.x), end.iterations, end.termination


def _covariance(
    predictor: Predictor, matrices: Matrices, errors: tuple[Array, ...], degrees: int
) -> tuple[Array | None, Agreement | None]:
    if not np.isfinite(log_determinant(errors)):
        return None, None
    basis = _tangent(predictor, matrices)
    whiten = whitener(errors, degrees)
    jacobian = predictor.jacobian(matrices, whiten, basis)
    triangle = triangle_of_rows(jacobian)
    lengths = np.linalg.norm(triangle, axis=0)
    if np.any(np.abs(np.diag(triangle)) <= 1e-11 * np.maximum(lengths, 1e-300)):
        return None, None
    root = np.linalg.inv(triangle)
    np.negative(jacobian, out=jacobian)
    ends = np.cumsum([each.size for each in errors])[:-1]
    blocks = [
        RecordBlock.of(part, np.zeros((len(part), 0)), (whiten @ each))
        for part, each in zip(np.split(jacobian, ends), errors, strict=True)
    ]
    agreed = white_covariance(blocks, root @ root.T, degrees)
    return np.asarray(basis @ agreed.covariance @ basis.T), agreed.agreement
