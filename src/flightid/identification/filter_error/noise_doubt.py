"""What a filter's noises, which the same record tells, leave in doubt about its parameters' errors.

A Kalman filter weighs innovations by noises that short records tell badly, and low: parameters and
constants follow part of what turbulence does. Standard errors by noises that came out small are
short where the truth is as far as ever.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from flightid.identification.filter_error.innovations import InnovationsProblem
from flightid.identification.filter_error.unseen_noise import unseen_noises
from flightid.identification.multistart import DenseEnd

Array = NDArray[np.float64]
LEAST_STEP, LARGEST_STEP = 0.02, 1.0
"""Logarithms by which a noise is moved: its standard error, but no less and no more."""
FARTHEST = 1.0
"""Logarithm by which noises may be too small; beyond it nothing is known of them."""

FAINT = -6.0
"""Logarithm of a process noise that adds nothing yet; slopes by its square are exact there."""


class NoiseDoubt(NamedTuple):
    """What estimated noises do to the variances of parameters.

    Attributes
    ----------
    factor : ndarray, shape (n_inner,)
        By which standard errors are too short, for noises that are told too low.
    variance : ndarray, shape (n_inner,)
        Of the logarithm of each parameter's variance.
    """

    factor: Array
    variance: Array


def noise_doubt(
    problem: InnovationsProblem, end: DenseEnd, columns: NDArray[np.bool_], covariance: Array
) -> NoiseDoubt:
    """Move each noise by its standard error and see what becomes of the parameters' variances.

    Noises of greatest likelihood are too small by half of what their own covariance makes of the
    slope of ``ln det`` of the covariance of parameters and constants (adjusted profile likelihood).

    Parameters
    ----------
    problem : InnovationsProblem
    end : DenseEnd
        Of the search.
    columns : ndarray of bool, shape (n_all,)
        Unknowns that are at no bound.
    covariance : ndarray, shape (n, n)
        Of these unknowns.

    Assumes
    -------
    Noises within about a standard error of the truth. Process noise that came out as none may be
    there by what the record leaves possible (`unseen_noises`); other noises at a bound stay there.

    Reference
    ---------
    Cox & Reid (1987), J. Royal Statistical Society B 49(1), section 2; Patterson & Thompson (1971),
    Biometrika 58(3); Satterthwaite (1946), Biometrics Bulletin 2(6), eq. 17, by slopes of a
    variance: Giesbrecht & Burns (1985), Biometrics 41(2), section 3.
    """
    places = np.flatnonzero(columns)
    count = int(np.sum(places < problem.n_free))
    spread = covariance[count:, count:]
    here = _sizes(problem, end.x, end.jacobian, end.cost, places[:count])
    slopes, reach = np.zeros((len(spread), count + 1)), problem.reach
    for row, (place, error) in enumerate(
        zip(places[count:], np.sqrt(np.diag(spread)), strict=True)
    ):
        step = float(np.clip(error, LEAST_STEP, LARGEST_STEP))
        for moved in (step, -step):
            x = end.x.copy()
            x[place] += moved
            if abs(x[place]) > reach[place - problem.n_free]:
                continue
            residuals, jacobian = problem.residuals(x, with_slopes=True)
            if np.all(np.isfinite(jacobian)):
                cost = float(residuals @ residuals)
                there = _sizes(problem, x, jacobian, cost, places[:count])
                slopes[row] = (there - here) / moved
                break
    by_noise, whole = slopes[:, :count], slopes[:, count]
    lacking = np.clip(0.5 * spread @ whole, -FARTHEST, FARTHEST)
    longer, variance = _by_unseen(problem, end, columns, here[:count])
    # What a noise that is nearly none does to a parameter ends where the noise is gone, however
    # little the record tells of its logarithm: slopes reach as far as noises were moved.
    near = by_noise * np.minimum(1.0, LARGEST_STEP / np.sqrt(np.diag(spread)))[:, None]
    variance += np.einsum("ik,ij,jk->k", near, spread, near)
    return NoiseDoubt(np.exp(0.5 * (by_noise.T @ lacking + longer)), variance)


def _by_unseen(
    problem: InnovationsProblem, end: DenseEnd, columns: NDArray[np.bool_], here: Array
) -> tuple[Array, Array]:
    """What process noises at zero add to the logarithms of variances, and their doubt of it.

    Weights of a filter without them stay: variances grow with each density as at zero, for a filter
    that knew of it would do better than this one.
    """
    places = np.flatnonzero(columns)[: len(here)]
    grown, square = np.ones_like(here), np.zeros_like(here)
    for noise in unseen_noises(problem, end):
        x = end.x.copy()
        x[noise.place] = FAINT
        residuals, jacobian = problem.residuals(x, with_slopes=True)
        if not np.all(np.isfinite(jacobian)):
            continue
        there = _sizes(problem, x, jacobian, float(residuals @ residuals), places)[:-1]
        slope = np.maximum(there - here, 0.0) / np.exp(2.0 * FAINT)
        grown += slope * noise.mean
        square += (slope * noise.deviation) ** 2
    return np.log(grown), square / grown**2


def _sizes(
    problem: InnovationsProblem, x: Array, jacobian: Array, cost: float, places: NDArray[np.intp]
) -> Array:
    """Logarithms of the variances of some parameters and, last, ``ln det`` with the constants.

    But for a constant: the noises' common factor is that of the squares of innovations.
    """
    triangle = np.linalg.qr(jacobian[:, places], mode="r")
    inverse = np.linalg.inv(triangle)
    variances = np.log(cost * np.sum(inverse**2, axis=1))
    whole = len(places) * np.log(cost) + 2.0 * np.linalg.slogdet(inverse)[1]
    squares, rank = 0.0, 0
    for each, _ in problem.records(x, with_slopes=False):
        lower = np.linalg.cholesky(each.filter.innovation)
        squares += float(np.sum(np.linalg.solve(lower, each.innovations.T) ** 2))
        rank += each.weights.shape[1]
        whole += np.linalg.slogdet(each.weights.T @ each.weights)[1]
    whole += rank * np.log(squares)
    return np.append(variances, whole)
