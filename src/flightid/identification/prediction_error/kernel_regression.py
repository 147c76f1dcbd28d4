"""Regularised ARX and FIR models: decaying, smooth coefficients, as far as the data ask for it."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import scipy
from numpy.typing import NDArray

from flightid.errors import DataError
from flightid.frozen import dataclass
from flightid.identification.prediction_error.linear_regression import LinearRegression

Array = NDArray[np.float64]
LARGEST_DECAY = 0.995
LARGEST_CORRELATION = 0.99


@dataclass(frozen=True, eq=False)
class KernelEstimate:
    """Posterior mean and covariance, and what the data chose.

    `settings` holds for each group of coefficients its size, decay and correlation;
    `evidence` is minus twice the logarithm of the marginal likelihood.
    """

    theta: Array
    covariance: Array
    variance: float
    settings: tuple[tuple[float, float, float], ...]
    evidence: float


def kernel_root(size: float, decay: float, correlation: float, count: int) -> Array:
    """Lower root of the prior covariance of `count` coefficients, DC; with correlation √decay TC.

    The covariance at lags i and j is size · decay^((i+j)/2) · correlation^|i-j|: a first-order
    autoregression that decays, whose root is known without a factorisation.

    Reference: Chen, Ohlsson & Ljung (2012), On the estimation of transfer functions,
    regularizations and Gaussian processes - revisited, Automatica 48, eqs. 35 and 36.

    Example
    -------
    >>> root = kernel_root(2.0, 0.25, 0.5, 2)
    >>> root @ root.T
    array([[0.5  , 0.125],
           [0.125, 0.125]])
    """
    lag = np.arange(1, count + 1)
    behind = lag[:, None] - lag[None, :]
    steps = np.where(behind < 0, 0.0, correlation ** np.abs(behind))
    steps[:, 1:] *= math.sqrt(1.0 - correlation**2)
    return np.asarray(np.sqrt(size * decay**lag)[:, None] * steps)


def kernel_estimate(
    regression: LinearRegression, groups: Sequence[int], kind: str, variance: float | None = None
) -> KernelEstimate:
    """Coefficients under a decaying prior whose shape maximises the marginal likelihood.

    Parameters
    ----------
    regression : LinearRegression
        Triangle of all rows.
    groups : sequence of int
        Coefficients of each polynomial, which share size and decay.
    kind : {"tc", "dc"}
    variance : float, optional
        Of the noise; default: of the least-squares residuals.

    Raises
    ------
    DataError
        No degree of freedom is left to estimate the noise from.

    Reference
    ---------
    Pillonetto et al. (2014), Kernel methods in system identification, Automatica 50, section 4.4;
    Chen & Ljung (2013), Implementation of algorithms for tuning parameters in regularized least
    squares problems, Automatica 49: by triangles alone, so that little noise costs no digits.
    """
    n, count = regression.n_rows, regression.theta.size
    if variance is None:
        if n <= count:
            raise DataError(
                "the noise cannot be estimated",
                found=f"{n} rows for {count} coefficients",
                needed="more rows than coefficients",
                action="give longer records or lower orders",
            )
        variance = regression.sum_of_squares / (n - count)
    factor, wanted = regression.factor, -regression.triangle[:-1, -1]
    used = [g for g in groups if g]
    scale = _sizes(factor, wanted, used)
    noise = math.sqrt(variance)

    def unpack(x: Array) -> list[tuple[float, float, float]]:
        found = []
        for place, base in enumerate(scale):
            size, decay, *rest = x[place * width : (place + 1) * width]
            lam = LARGEST_DECAY / (1 + math.exp(-decay))
            rho = LARGEST_CORRELATION * math.tanh(rest[0]) if rest else math.sqrt(lam)
            found.append((base * math.exp(size), lam, rho))
        return found

    def posterior(settings: Sequence[tuple[float, float, float]]) -> tuple[Array, Array]:
        """Root L of the prior and the triangle of [F L, σI | what is explained, 0], by columns."""
        roots = [kernel_root(*of, g) for of, g in zip(settings, used, strict=True)]
        rows = np.zeros((2 * count, count + 1))
        first = 0
        for root in roots:
            span = slice(first, first + len(root))
            rows[:count, span] = factor[:, span] @ root
            first = span.stop
        np.fill_diagonal(rows[count:], noise)
        rows[:count, -1] = wanted
        return scipy.linalg.block_diag(*roots), np.asarray(np.linalg.qr(rows, mode="r"))

    def evidence(x: Array) -> float:
        _, triangle = posterior(unpack(x))
        sizes = np.abs(np.diag(triangle))
        return float((sizes[-1] / noise) ** 2 + 2 * np.sum(np.log(sizes[:-1])))

    width = 3 if kind == "dc" else 2
    start = np.tile([0.0, 1.5, 1.0][:width], len(used))
    limits = [(-12.0, 12.0), (-6.0, 9.0), (-3.0, 3.0)][:width] * len(used)
    best = scipy.optimize.minimize(evidence, start, method="L-BFGS-B", bounds=limits)
    settings = unpack(best.x)
    root, triangle = posterior(settings)
    # Uncorrelated directions of one size each: coefficients are L R⁻¹ of them.
    spread = scipy.linalg.solve_triangular(triangle[:-1, :-1], root.T, trans="T").T
    rest = (n - count) * math.log(variance) + regression.sum_of_squares / variance
    return KernelEstimate(
        spread @ triangle[:-1, -1],
        variance * spread @ spread.T,
        variance,
        tuple(settings),
        float(best.fun) + rest,
    )


def _sizes(factor: Array, wanted: Array, groups: Sequence[int]) -> list[float]:
    """Mean square of the unregularised coefficients of each group, as the unit of its size."""
    theta = np.linalg.lstsq(factor, wanted, rcond=1e-10)[0]
    parts = np.split(theta, np.cumsum(groups)[:-1])
    return [float(np.max(part**2)) or 1.0 for part in parts]
