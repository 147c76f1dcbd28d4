"""Least squares of a rational response with the transients of records, over their Fourier bins."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from flightid._native import RationalBins
from flightid.frozen import dataclass

Complex = NDArray[np.complex128]
Real = NDArray[np.float64]
Kind = TypeVar("Kind", np.float64, np.complex128)
ORDERS = (1, 2, 3, 4, 5, 6, 8, 10)
"""Orders that are tried."""
SPARE = 2
"""Terms of a transient beyond the order: band limits and aliases bend it."""
BEYOND_BAND = 1.3
"""Bins are fitted up to this multiple of the highest frequency of the response."""
STARTS, FURTHER, STEPS, HALVINGS = 6, 2, 12, 6
SETTLED = 1e-5
SOUND = 1e-6
"""Diagonal of a triangle, of columns of unit length, above which it is solved as it is."""


def turns(omega: Real, scale_rad_s: float, order: int) -> Complex:
    """Powers of the all-pass ``(ω0 − s)/(ω0 + s)`` on the imaginary axis, (order + 1, n_f).

    Of unit modulus, so that polynomials in them stay well conditioned over many octaves.
    """
    angle = -2.0 * np.arctan(omega / scale_rad_s)
    return np.asarray(np.exp(1j * np.multiply.outer(np.arange(order + 1), angle)))


@dataclass(frozen=True)
class PilotInputs:
    """Fourier bins of the records' inputs inside the band, and powers for pilots of all orders.

    Attributes
    ----------
    omega : tuple of ndarray, each shape (n_f,)
        rad/s.
    inputs : tuple of ndarray, each shape (n_in, n_f)
    lengths : tuple of int
        Samples of each record.
    sample_time_s : float
    """

    omega: tuple[Real, ...]
    inputs: tuple[Complex, ...]
    lengths: tuple[int, ...]
    sample_time_s: float

    @classmethod
    def of(cls, inputs: Sequence[Real], sample_time_s: float, highest: float) -> PilotInputs:
        """Of samples of each record, shape (n_in, n), up to a little above a frequency in rad/s."""
        omegas, found = [], []
        lengths = tuple(each.shape[1] for each in inputs)
        for u, n in zip(inputs, lengths, strict=True):
            spacing = 2.0 * np.pi / (n * sample_time_s)
            last = min((n - 1) // 2, int(BEYOND_BAND * highest / spacing))
            omegas.append(spacing * np.arange(1, last + 1, dtype=np.float64))
            found.append(_scale(n, sample_time_s) * np.fft.rfft(u, axis=1)[:, 1 : last + 1])
        return cls(tuple(omegas), tuple(found), lengths, sample_time_s)

    def with_output(self, output: Sequence[Real]) -> PilotBins:
        """With samples of an output of each record, shape (n,)."""
        found = []
        for y, n, omega in zip(output, self.lengths, self.omega, strict=True):
            found.append(_scale(n, self.sample_time_s) * np.fft.rfft(y)[1 : len(omega) + 1])
        return PilotBins(self, tuple(found))

    @cached_property
    def scale_rad_s(self) -> float:
        """Frequency about which the powers turn: the middle of the bins, in logarithms."""
        held = [each for each in self.omega if len(each)]
        return float(np.sqrt(max(each[-1] for each in held) * min(each[0] for each in held)))

    def columns(self, order: int) -> PilotColumns:
        """What one order makes of the bins: the first of the powers."""
        ends = [each[: order + 1 + SPARE] for each in self._powers]
        basis = [each[: order + 1] for each in ends]
        lengths, whole = [len(each) for each in self.omega], self._joined[0][: order + 1]
        bins = RationalBins(self._joined[1], self._joined[0][1], lengths, order, order + 1 + SPARE)
        return PilotColumns(basis, ends, whole, self.inputs, bins)

    @cached_property
    def _powers(self) -> list[Complex]:
        """Of the highest order, and of its transient, by record."""
        return [turns(omega, self.scale_rad_s, ORDERS[-1] + SPARE) for omega in self.omega]

    @cached_property
    def _joined(self) -> tuple[Complex, Complex]:
        """Powers and inputs of all records."""
        powers = [each[: ORDERS[-1] + 1] for each in self._powers]
        return np.concatenate(powers, axis=1), np.concatenate(self.inputs, axis=1)


def _scale(n_samples: int, sample_time_s: float) -> float:
    return float(np.sqrt(2.0 * sample_time_s / n_samples))


@dataclass(frozen=True)
class PilotBins:
    """Fourier bins of the records inside the band: of the inputs, and of one output."""

    given: PilotInputs
    output: tuple[Complex, ...]

    @property
    def omega(self) -> tuple[Real, ...]:
        """Frequencies of each record's bins, rad/s."""
        return self.given.omega

    @property
    def inputs(self) -> tuple[Complex, ...]:
        """Bins of each record's inputs."""
        return self.given.inputs

    @cached_property
    def target(self) -> Complex:
        """Output of all records."""
        return np.concatenate(self.output)

    @property
    def size(self) -> int:
        """Number of bins."""
        return sum(len(each) for each in self.omega)

    def by_record(self, values: NDArray[Kind]) -> list[NDArray[Kind]]:
        """Values of all bins as those of each record."""
        return np.split(values, np.cumsum([len(each) for each in self.omega])[:-1], axis=-1)

    def samples(self, values: Sequence[Complex]) -> tuple[Real, ...]:
        """Samples of each record, shape (…, n), from its bins in the band, shape (…, n_f)."""
        made: list[Real] = []
        for each, n in zip(values, self.given.lengths, strict=True):
            bins = np.zeros((*each.shape[:-1], n // 2 + 1), dtype=np.complex128)
            bins[..., 1 : each.shape[-1] + 1] = each / _scale(n, self.given.sample_time_s)
            made.append(np.asarray(np.fft.irfft(bins, n), dtype=np.float64))
        return tuple(made)


@dataclass(frozen=True)
class PilotState:
    """Coefficients, what they make of the bins, and the weighted residuals."""

    numerators: Real
    denominator: Real
    transients: tuple[Real, ...]
    under: Complex
    modelled: Complex
    residual: Complex
    cost: float

    @property
    def order(self) -> int:
        """Number of poles."""
        return len(self.denominator) - 1

    @property
    def coefficients(self) -> tuple[Real, Real, tuple[Real, ...]]:
        """Numerators, denominator and transients."""
        return self.numerators, self.denominator, self.transients


@dataclass(frozen=True)
class PilotColumns:
    """What one order makes of the bins, by record.

    Attributes
    ----------
    basis, ends : list of ndarray, shape (order + 1, n_f) and (order + 1 + SPARE, n_f)
        Powers for numerators and denominator, and for the record's transient.
    whole : ndarray, shape (order + 1, n_bins)
        The basis of all records.
    inputs : tuple of ndarray, shape (n_in, n_f)
    bins : RationalBins
        The same for the native half.
    """

    basis: list[Complex]
    ends: list[Complex]
    whole: Complex
    inputs: tuple[Complex, ...]
    bins: RationalBins

    @cached_property
    def fixed(self) -> list[Complex]:
        """Sensitivities times the denominator of transient and numerators, each (n_fixed, n_f)."""
        return [
            np.concatenate([end, *(row * phi for row in u)])
            for u, phi, end in zip(self.inputs, self.basis, self.ends, strict=True)
        ]

    @cached_property
    def edges(self) -> list[int]:
        """Bins at which a record begins, but for the first."""
        return [int(each) for each in np.cumsum([phi.shape[1] for phi in self.basis])[:-1]]


def started(
    data: PilotBins, order: int, weights: Real, known: PilotState | None = None
) -> PilotState:
    """The best of Sanathanan and Koerner's iteration, from a state of the order or from nothing."""
    columns, target, state = data.given.columns(order), data.target, None
    under = np.ones(len(target), dtype=np.complex128)
    if known is not None:
        state = made(data, columns, weights, *known.coefficients)
        under = state.under
    for _ in range(STARTS if known is None else FURTHER):
        scaled = weights / np.abs(under)
        tried = made(data, columns, weights, *solve(columns, target, scaled, target * scaled))
        state = tried if state is None or tried.cost < state.cost else state
        under = tried.under
    assert state is not None
    return state


def settled(data: PilotBins, weights: Real, state: PilotState) -> PilotState:
    """Gauss–Newton steps from a state."""
    columns = data.given.columns(state.order)
    for _ in range(STEPS):
        stepped = _gauss_newton(data, columns, weights, state)
        done = stepped.cost > state.cost * (1.0 - SETTLED)
        state = stepped
        if done:
            break
    return state


def solve(
    columns: PilotColumns, output: Complex, weights: Real | Complex, target: Complex
) -> tuple[Real, Real, tuple[Real, ...]]:
    """Coefficients whose weighed sensitivities come nearest to a target; a denominator from one on.

    By corrected normal equations, whose sums are few as columns are powers of one number; where
    columns are too alike for these, by orthogonal triangles.
    """
    size, n_records = len(columns.basis[0]), len(columns.basis)
    found = columns.bins.solve(output, np.abs(weights) ** 2, np.conj(weights) * target)
    if found is None:
        return _by_triangles(columns, output, weights, target)
    split = len(found) - n_records * (size + SPARE)
    first = split - (size - 1)
    denominator = np.concatenate([[1.0], found[first:split]])
    transients = tuple(found[split:].reshape(n_records, -1))
    return found[:first].reshape(-1, size), denominator, transients


def _by_triangles(
    columns: PilotColumns, output: Complex, weights: Real | Complex, target: Complex
) -> tuple[Real, Real, tuple[Real, ...]]:
    """As `solve`, each record's transient eliminated by a triangle of its own rows."""
    triangles: list[Real] = []
    for fixed, phi, y, weight, right in zip(
        columns.fixed,
        columns.basis,
        *(np.split(each, columns.edges) for each in (output, weights, target)),
        strict=True,
    ):
        n_fixed = len(fixed)
        rows = np.empty((n_fixed + len(phi), len(y)), dtype=np.complex128)
        np.multiply(fixed, weight, out=rows[:n_fixed])
        np.multiply(phi[1:], -y * weight, out=rows[n_fixed:-1])
        rows[-1] = right
        triangles.append(np.asarray(np.linalg.qr(rows.view(np.float64).T, mode="r")))
    size = len(columns.basis[0])
    n_own = size + SPARE
    shared = np.concatenate([each[n_own:, n_own:] for each in triangles])
    above = np.concatenate([each[:n_own, n_own:-1] for each in triangles])
    sizes = np.sqrt(np.sum(shared[:, :-1] ** 2, axis=0) + np.sum(above**2, axis=0))
    solved = _least_squares(np.asarray(np.linalg.qr(shared, mode="r")), sizes)
    tops = [each[:n_own] for each in triangles]
    own = np.array([each[:, :n_own] for each in tops])
    left = np.array([each[:, -1] - each[:, n_own:-1] @ solved for each in tops])
    transients = _triangles_solved(own, left, np.sqrt(np.sum(own**2, axis=1)))
    split = len(solved) - (size - 1)
    denominator = np.concatenate([[1.0], solved[split:]])
    return solved[:split].reshape(-1, size), denominator, tuple(transients)


def _triangles_solved(triangles: Real, right: Real, sizes: Real) -> Real:
    """Each of some triangles by its right side, at once where all are sound."""
    sizes = np.maximum(sizes, np.finfo(float).tiny)
    scaled = triangles / sizes[:, None]
    if np.abs(np.diagonal(scaled, axis1=1, axis2=2)).min() > SOUND:
        return np.asarray(np.linalg.solve(scaled, right[..., None])[..., 0] / sizes)
    found = [np.linalg.lstsq(*pair, rcond=1e-10)[0] for pair in zip(scaled, right, strict=True)]
    return np.array(found) / sizes


def _least_squares(triangle: Real, sizes: Real) -> Real:
    """Least squares for the last column of a triangle by the others, each scaled by its size."""
    sizes = np.maximum(sizes, np.finfo(float).tiny)
    left, right = triangle[:, :-1] / sizes, triangle[:, -1]
    diagonal, n = np.abs(np.diagonal(left)), left.shape[1]
    if len(left) >= n and diagonal.min(initial=1.0) > SOUND:
        solved = np.linalg.solve(left[:n], right[:n])
    else:
        solved = np.linalg.lstsq(left, right, rcond=1e-10)[0]
    return np.asarray(solved / sizes)


def made(
    data: PilotBins,
    columns: PilotColumns,
    weights: Real,
    numerators: Real,
    denominator: Real,
    transients: tuple[Real, ...],
) -> PilotState:
    """Coefficients with what they make of the bins."""
    still = np.zeros(len(denominator) - 1)
    above = columns.bins.numerator(np.concatenate([numerators.ravel(), still, *transients]))
    under = denominator @ columns.whole
    modelled = above / under
    residual = weights * (data.target - modelled)
    cost = float(np.vdot(residual, residual).real) / len(residual)
    return PilotState(numerators, denominator, transients, under, modelled, residual, cost)


def _gauss_newton(
    data: PilotBins, columns: PilotColumns, weights: Real, state: PilotState
) -> PilotState:
    moves = solve(columns, state.modelled, weights / state.under, state.residual)
    length = 1.0
    for _ in range(HALVINGS):
        moved = made(
            data,
            columns,
            weights,
            state.numerators + length * moves[0],
            np.concatenate([[1.0], state.denominator[1:] + length * moves[1][1:]]),
            tuple(a + length * b for a, b in zip(state.transients, moves[2], strict=True)),
        )
        if moved.cost < state.cost:
            return moved
        length *= 0.5
    return state
