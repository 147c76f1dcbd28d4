"""Eigenvalues with their vectors, how states take part in them, and how all of it moves with A."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
import scipy
from numpy.typing import NDArray

from flightid.frozen import dataclass

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]

REAL = 1e-9
"""Imaginary part, relative to the size, below which an eigenvalue is real."""
ZERO = 1e-12
"""Size relative to the largest eigenvalue below which one is zero: an integrator."""
CLOSE = 1e-6
"""Relative distance of two eigenvalues below which neither has a derivative."""
DEFECTIVE = 1e-7
"""Cosine between left and right vector below which the eigenvalue is not simple."""
DEPARTURE = 0.5
"""Departure from first order, in standard errors, above which its interval means nothing."""
STILL = 1e-11
"""Standard error relative to the largest eigenvalue that is rounding."""
UNINVOLVED = 1e-9
"""Participation below which a state does not take part."""


@dataclass(frozen=True, eq=False)
class Eigenpair:
    """One eigenvalue, or the upper one of a complex pair, with what belongs to it.

    Attributes
    ----------
    value : complex
        In the plane of the matrix: s in rad/s, or z.
    vector : ndarray of complex, shape (n,)
        Right eigenvector in the units of the states; any factor.
    factors : ndarray of complex, shape (n,), or None
        Participation factors wᵢ vᵢ, sum one; None for an eigenvalue that is not simple.
    value_moves : ndarray of complex, shape (k,), or None
        How the eigenvalue moves along each direction of the matrix' uncertainty.
    vector_moves, factor_moves : ndarray of complex, shape (k, n), or None
        The same of vector and factors.
    reason : str
        Why there are no moves; empty where there are.

    Example
    -------
    >>> pair = next(eigenpairs(np.array([[-1.0, 0.0], [1.0, -3.0]])))
    >>> pair.value, pair.shares.round(6)
    ((-1+0j), array([1., 0.]))
    """

    value: complex
    vector: Complex
    factors: Complex | None
    value_moves: Complex | None = None
    vector_moves: Complex | None = None
    factor_moves: Complex | None = None
    reason: str = ""

    @property
    def is_pair(self) -> bool:
        """Whether the conjugate eigenvalue belongs to it."""
        return self.value.imag != 0.0

    @property
    def shares(self) -> Array:
        """Sizes of the participation factors over their sum; empty without factors."""
        if self.factors is None:
            return np.zeros(0)
        sizes = np.abs(self.factors)
        return np.asarray(sizes / np.sum(sizes))

    @property
    def share_errors(self) -> Array | None:
        """Standard errors of `shares`; zero for a state that does not take part."""
        if self.factors is None or self.factor_moves is None:
            return None
        sizes = np.abs(self.factors)
        there = sizes > UNINVOLVED
        safe = np.where(there, self.factors, 1.0)
        moves = np.where(there, np.real(np.conj(safe) * self.factor_moves) / np.abs(safe), 0.0)
        total = np.sum(sizes)
        shares = moves / total - np.sum(moves, axis=1, keepdims=True) * sizes / total**2
        return np.asarray(np.sqrt(np.sum(shares**2, axis=0)))

    def shape(self, reference: int) -> Complex:
        """Vector with the reference state as one.

        Parameters
        ----------
        reference : int
            A state that moves.
        """
        return np.asarray(self.vector / self.vector[reference])

    def shape_errors(self, reference: int) -> Array | None:
        """Standard errors of the sizes of `shape`; zero for states that stand still.

        Parameters
        ----------
        reference : int
        """
        if self.vector_moves is None:
            return None
        still = np.abs(self.vector) == 0.0
        relative = self.vector_moves / np.where(still, 1.0, self.vector)
        grown = np.real(relative - relative[:, reference : reference + 1])
        sizes = np.abs(self.shape(reference))
        return np.asarray(np.where(still, 0.0, sizes * np.sqrt(np.sum(grown**2, axis=0))))


def eigenpairs(a: Array, directions: Array | None = None) -> Iterator[Eigenpair]:
    """Eigenvalues of a real matrix, those with negative imaginary part left out.

    Parameters
    ----------
    a : ndarray, shape (n, n)
    directions : ndarray, shape (k, n, n), optional
        The matrix' uncertainty: independent moves of one standard error each. First-order moves of
        a quantity have its variance as the sum of their squares.

    Yields
    ------
    Eigenpair
        Largest real part first.

    Reference
    ---------
    Pérez-Arriaga, Verghese & Schweppe, "Selective modal analysis", *IEEE Trans. Power Apparatus
    and Systems* 101 (1982), eq. 5 (participation factors); Nelson, "Simplified calculation of
    eigenvector derivatives", *AIAA Journal* 14 (1976); Magnus, "On differentiating eigenvalues and
    eigenvectors", *Econometric Theory* 1 (1985).
    """
    if not len(a):
        return
    # In balanced coordinates the units of the states do not decide what is small.
    outcome: Any = scipy.linalg.matrix_balance(a, permute=False, separate=True)
    balanced, scale = outcome[0], outcome[1][0]
    spread = None if directions is None else directions * (scale / scale[:, None])
    solved: Any = scipy.linalg.eig(balanced, left=True, right=True)
    values, left, right = solved
    shifts = None if spread is None else _departures(balanced, values, left, right, spread)
    for place in np.lexsort((values.imag, -values.real)):
        value = _exact(values[place], float(np.max(np.abs(values))))
        if value.imag < 0.0:
            continue
        w, v = left[:, place].conj(), right[:, place]
        across = complex(w @ v)
        simple = abs(across) > DEFECTIVE and _distance(values, place) > CLOSE
        factors = w * v / across if abs(across) > DEFECTIVE else None
        pair = Eigenpair(value, scale * v, factors)
        if spread is None:
            yield pair
        elif not simple:
            yield Eigenpair(value, scale * v, factors, reason=_coincides(values, place))
        else:
            yield _moved(pair, balanced, spread, (w, v), scale, values, place, shifts)


def _exact(value: complex, largest: float) -> complex:
    if abs(value) <= ZERO * largest:
        return 0j
    imaginary = 0.0 if abs(value.imag) <= REAL * abs(value) else float(value.imag)
    return complex(float(value.real), imaginary)


def _distance(values: Complex, place: int) -> float:
    """Distance to the nearest other eigenvalue, relative to the size or to one."""
    apart = np.delete(np.abs(values - values[place]), place)
    return float(np.min(apart, initial=np.inf) / max(abs(values[place]), 1e-3))


def _nearest(values: Complex, place: int) -> complex:
    others = np.delete(values, place)
    return complex(others[np.argmin(np.abs(others - values[place]))])


def _coincides(values: Complex, place: int) -> str:
    other = _nearest(values, place)
    return (
        f"coincides with the eigenvalue {other:.4g}: neither has a derivative, and the two trade "
        "places as parameters move"
    )


def _moved(
    pair: Eigenpair,
    a: Array,
    directions: Array,
    vectors: tuple[Complex, Complex],
    scale: Array,
    values: Complex,
    place: int,
    shifts: Array | None,
) -> Eigenpair:
    w, v = vectors
    moves, vector_moves = _derivatives(a, complex(values[place]), v, directions)
    _, left_moves = _derivatives(a.T, complex(values[place]), w, directions.transpose(0, 2, 1))
    across = w @ v
    factors = w * v / across
    change = left_moves * v + w * vector_moves
    factor_moves = (change - factors * np.sum(change, axis=1, keepdims=True)) / across
    spread = float(np.sqrt(np.sum(np.abs(moves) ** 2)))
    if spread <= STILL * float(np.max(np.abs(values))):
        return Eigenpair(pair.value, pair.vector, pair.factors, 0.0 * moves, None, None)
    shift = 0.0 if shifts is None else float(shifts[place])
    if shift > DEPARTURE * spread:
        other = _nearest(values, place)
        return Eigenpair(
            pair.value,
            pair.vector,
            pair.factors,
            reason=f"errors of the fit move it out of proportion, by {shift / spread:.2g} standard "
            f"errors, so that no ± holds (nearest other eigenvalue {other:.4g})",
        )
    return Eigenpair(
        pair.value, pair.vector, pair.factors, moves, scale * vector_moves, factor_moves
    )


def _derivatives(
    a: NDArray[Any], value: complex, vector: Complex, directions: Array
) -> tuple[Complex, Complex]:
    """Moves of a simple eigenvalue (k,) and of its vector (k, n), which keeps its length."""
    n = len(a)
    bordered = np.zeros((n + 1, n + 1), dtype=np.complex128)
    bordered[:n, :n] = a - value * np.eye(n)
    bordered[:n, n] = -vector
    bordered[n, :n] = vector.conj()
    driven = np.zeros((n + 1, len(directions)), dtype=np.complex128)
    driven[:n] = -(directions @ vector).T
    solved = np.linalg.solve(bordered, driven)
    return np.asarray(solved[n]), np.asarray(solved[:n].T)


def _departures(
    a: Array, values: Complex, left: Complex, right: Complex, directions: Array
) -> Array:
    """How far each eigenvalue departs from first order, one standard error up and down.

    Taken from the eigenvalues themselves, so that it tells where they meet and turn: the mean shift
    to second order, or the root of the sum of squares where departures up and down cancel.
    """
    across = np.einsum("si,si->i", left.conj(), right)
    safe = np.where(np.abs(across) > DEFECTIVE, across, 1.0)
    slopes = np.einsum("si,kst,ti->ki", left.conj(), directions, right) / safe
    found = []
    for sign in (1.0, -1.0):
        moved = np.linalg.eigvals(a + sign * directions)
        expected = values + sign * slopes
        apart = moved[:, None, :] - expected[:, :, None]
        nearest = np.argmin(np.abs(apart), axis=2)
        found.append(np.take_along_axis(apart, nearest[:, :, None], axis=2)[:, :, 0])
    mean = np.abs(np.sum(found[0] + found[1], axis=0)) / 2.0
    scatter = np.sqrt(np.sum(np.abs(found[0]) ** 2 + np.abs(found[1]) ** 2, axis=0) / 2.0)
    return np.asarray(np.maximum(mean, scatter))
