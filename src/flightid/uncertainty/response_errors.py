"""Calibrated covariance of estimates: the errors of the data carried through the fit.

An estimate that minimises Σ r² moves with its data by δθ = −(JᵀJ)⁻¹ Jᵀ δr. With δr = B δH and the
covariance Σ of the response errors δH, cov θ = A Σ Aᵀ with A = (JᵀJ)⁻¹ JᵀB: whatever the weights of
the cost are, the interval speaks of the scatter over repeated flights.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import pairwise
from typing import TypeAlias

import numpy as np
import scipy
from numpy.typing import NDArray

from flightid.frozen import dataclass
from flightid.uncertainty.influence import require_apart, require_influence

Array = NDArray[np.float64]
DECIBEL, DEGREE = 20.0 / np.log(10.0), 180.0 / np.pi
"""Of a relative change of a response: its real part in dB, its imaginary part in deg."""


@dataclass(frozen=True, eq=False)
class PointSensitivity:
    """Derivatives of residuals with respect to data, of which each residual answers to few.

    Attributes
    ----------
    blocks : tuple of ndarray
        Square ones; their rows follow one another in the order of the residuals.
    columns : tuple of ndarray of int
        Data of each block; together each of the data once.

    Example
    -------
    >>> halves = PointSensitivity.of([2.0 * np.eye(1), 4.0 * np.eye(1)])
    >>> np.ones((1, 2)) @ halves, halves.solved(np.ones((2, 1))).T
    (array([[2., 4.]]), array([[0.5 , 0.25]]))
    """

    __array_ufunc__ = None  # NumPy leaves products with this to it
    blocks: tuple[Array, ...]
    columns: tuple[NDArray[np.intp], ...]

    @classmethod
    def of(cls, blocks: Sequence[Array]) -> PointSensitivity:
        """Of blocks whose data follow one another as their residuals do."""
        ends = np.cumsum([0, *map(len, blocks)])
        columns = (np.arange(*span) for span in pairwise(ends))
        return cls(tuple(blocks), tuple(columns))

    def __rmatmul__(self, left: Array) -> Array:
        found = np.empty(left.shape)
        for rows, block, columns in self._parts():
            found[:, columns] = left[:, rows] @ block
        return found

    def solved(self, right: Array) -> Array:
        """Changes of the data that make given residuals, shape (n_data, n)."""
        found = np.empty(right.shape)
        for rows, block, columns in self._parts():
            found[columns] = np.linalg.solve(block, right[rows])
        return found

    def _parts(self) -> Iterator[tuple[slice, Array, NDArray[np.intp]]]:
        first = 0
        for block, columns in zip(self.blocks, self.columns, strict=True):
            yield slice(first, first + len(block)), block, columns
            first += len(block)


@dataclass(frozen=True, eq=False)
class PolarSensitivity:
    """Derivatives of residuals two by two, each pair of which answers to one complex point.

    Attributes
    ----------
    slopes : ndarray, shape (n, 2, 2)
        Of each pair by the real and by the imaginary part of its point.
    columns : ndarray of int, shape (n, 2)
        Places of these parts among the data.

    Example
    -------
    >>> turned = PolarSensitivity(np.array([[[0.0, 2.0], [4.0, 0.0]]]), np.array([[0, 1]]))
    >>> np.ones((1, 2)) @ turned, turned.solved(np.ones((2, 1))).T
    (array([[4., 2.]]), array([[0.25, 0.5 ]]))
    """

    __array_ufunc__ = None  # NumPy leaves products with this to it
    slopes: Array
    columns: NDArray[np.intp]

    def __rmatmul__(self, left: Array) -> Array:
        first, second = left[:, 0::2], left[:, 1::2]
        found = np.empty(left.shape)
        for part in range(2):
            slopes = self.slopes[:, :, part]
            found[:, self.columns[:, part]] = first * slopes[:, 0] + second * slopes[:, 1]
        return found

    def solved(self, right: Array) -> Array:
        """Changes of the data that make given residuals, shape (n_data, n)."""
        found = np.empty(right.shape)
        pairs = right.reshape(-1, 2, right.shape[1])
        found[self.columns] = np.linalg.solve(self.slopes, pairs)
        return found


Sensitivity: TypeAlias = PointSensitivity | PolarSensitivity


def estimator_gain(
    jacobian: Array, sensitivity: Array | Sensitivity, *, total: Array | None = None
) -> Array:
    """How far the estimates move with the data, but for the sign.

    Parameters
    ----------
    jacobian : ndarray, shape (n_residuals, n_parameters)
        Derivatives J of the weighted residuals with respect to the parameters.
    sensitivity : ndarray, shape (n_residuals, n_data), or of either class above
        Derivatives B of the weighted residuals with respect to the data.
    total : ndarray, shape (n_residuals, n_parameters), optional
        Derivatives T of the residuals where the data follow the parameters too, as a corrected
        response does that is fitted again and again; default: J.

    Returns
    -------
    ndarray, shape (n_parameters, n_data)
        A = (JᵀT)⁻¹ JᵀB.

    Raises
    ------
    SingularError
        Some combination of the parameters has no influence on the residuals.

    Reference
    ---------
    Pintelon & Schoukens, *System Identification: A Frequency Domain Approach*, 2nd ed., §9.7.

    Example
    -------
    >>> estimator_gain(np.array([[1.0], [1.0]]), np.eye(2))
    array([[0.5, 0.5]])
    """
    scale = np.linalg.norm(jacobian, axis=0)
    require_influence(scale)
    q, triangle = np.linalg.qr(jacobian / scale)
    require_apart(np.diag(triangle))
    projected = q.T @ sensitivity
    if total is None:
        moved = scipy.linalg.solve_triangular(triangle, projected, check_finite=False)
    else:
        moved = np.linalg.solve(q.T @ (total / scale), projected)
    return np.asarray(moved / scale[:, None])


def decibel_phase_sensitivity(
    response: NDArray[np.complex128], weight_db: Array, weight_deg: Array
) -> Array:
    """Derivatives of weighted dB and degree residuals with respect to the measured response.

    From δ log H = δH / H: its real part moves the magnitude, its imaginary part the phase.

    Parameters
    ----------
    response : ndarray of complex, shape (n,)
        Response about which errors are small; the fitted model's, which has less noise.
    weight_db, weight_deg : ndarray, shape (n,)
        Square roots of the weights.

    Returns
    -------
    ndarray, shape (n, 2, 2)
        Rows: dB and degrees of each frequency; columns: its real and its imaginary part.

    Reference
    ---------
    Bendat & Piersol, *Engineering Applications of Correlation and Spectral Analysis*, §11.3.

    Example
    -------
    >>> decibel_phase_sensitivity(np.array([1j]), np.ones(1), np.ones(1)).round(3)
    array([[[-0.   , -8.686],
            [57.296, -0.   ]]])
    """
    inverse = 1.0 / response
    db, deg = -DECIBEL * weight_db, -DEGREE * weight_deg
    result = np.empty((len(response), 2, 2))
    result[:, 0, 0] = db * inverse.real
    result[:, 0, 1] = -db * inverse.imag
    result[:, 1, 0] = deg * inverse.imag
    result[:, 1, 1] = deg * inverse.real
    return result


def window_covariance(
    response: NDArray[np.complex128],
    random_error: Array,
    omega_rad_s: Array,
    window_s: float | None,
) -> Array:
    """Approximate covariance of a response of which only the random error is known.

    Neighbouring frequencies closer than a window resolves share their errors, in the proportion of
    the transform of the squared Hann window.

    Parameters
    ----------
    response : ndarray of complex, shape (n,)
        Measured response.
    random_error : ndarray, shape (n,)
        Normalised random error, 1 σ of magnitude and of phase in rad.
    omega_rad_s : ndarray, shape (n,)
        Frequencies, rad/s.
    window_s : float or None
        Length of the window, s; None where the frequencies are independent.

    Returns
    -------
    ndarray, shape (2 n, 2 n)
        Covariance of all real parts, then all imaginary parts.

    Assumes
    -------
    Stationary noise and input. Biased when the input is a sweep: then each frequency is excited in
    a part of the record only, and the true correlation is another.

    Reference
    ---------
    Harris (1978), "On the use of windows for harmonic analysis", eq. 21.

    Example
    -------
    >>> window_covariance(np.array([2.0 + 0j]), np.array([0.1]), np.array([1.0]), None) + 0.0
    array([[0.04, 0.  ],
           [0.  , 0.04]])
    """
    if window_s is None:
        power = (response * response.conj()).real * (random_error * random_error)
        return np.diag(np.concatenate([power, power]))
    bins = np.subtract.outer(omega_rad_s, omega_rad_s) * window_s / (2.0 * np.pi)
    correlation = _squared_hann(bins)
    shared = correlation * np.outer(random_error, random_error)
    # Errors of log H are circular: real and imaginary parts alike, uncorrelated.
    turn = np.outer(response, response.conj()) * shared
    return np.asarray(np.block([[turn.real, -turn.imag], [turn.imag, turn.real]]))


def _squared_hann(bins: Array) -> Array:
    """Transform of the squared Hann window, (3 + 4 cos + cos 2)/8, made 1 at zero."""
    return np.asarray(
        np.sinc(bins)
        + (np.sinc(bins - 1.0) + np.sinc(bins + 1.0)) * 2.0 / 3.0
        + (np.sinc(bins - 2.0) + np.sinc(bins + 2.0)) / 6.0
    )
