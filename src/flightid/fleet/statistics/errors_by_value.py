"""Errors that go with the estimate itself, taken at what the type has in common instead."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from flightid.fleet.statistics.flight_estimates import FlightEstimates

Array = NDArray[np.float64]
SURE = 2.0
"""Standard errors off zero, in the median, from which sizes say anything of errors."""
MOST = 0.9
"""Share of flights on one side of zero: of a parameter about zero nothing is relative."""
FEWEST = 3
"""Flights from which errors are held beside sizes."""
LEAST = 1e-3
"""Of the median, below which no estimate is taken: its error would leave all reason."""


def errors_at_the_type(data: FlightEstimates) -> FlightEstimates:
    """Estimates with the errors that they would have at the type's usual value.

    A fit whose relative error is known states a small error with a small estimate. What is low by
    chance then counts for more, and the mean of a type is low: by 2 c² of itself at a relative
    error c without spread, of 20 vehicles 2.7 of its standard errors at c = 0.3. How much of an
    error is relative its flights tell, as they scatter about either rule:

        share = 1 / (1 + (R₁ / R₀)^((n − g)/2)),   s → s (m / |y|)^share

    R₀ and R₁ are the sums of squares of log s and of log s − log|y| of n flights about the means of
    their g groups (here one: the type), m the median |y|. Where they do not tell, half counts.

    Parameters
    ----------
    data : FlightEstimates

    Returns
    -------
    FlightEstimates
        The same values; of parameters nine of ten of whose flights lie on one side of zero, in the
        median by two standard errors or more, errors at the median. Correlations stand.

    Assumes
    -------
    Errors absolute or relative, as likely one as the other before the flights are seen. Where
    vehicles differ and their errors with them, each counts as at the median: weights that do not
    go with the estimates leave the mean without bias, at the cost of the weights' best choice.

    Reference
    ---------
    Carroll & Ruppert, *Transformation and Weighting in Regression* (1988), chapter 2 (weights by
    fitted values); Kass & Raftery, *J. Am. Stat. Assoc.* 90 (1995), 773–795 (odds of two rules).

    Example
    -------
    >>> data = FlightEstimates.of(["a"], [*"uvwx"], [[8.0], [10.0], [10.0], [12.5]],
    ...                           np.square([0.8, 1.0, 1.0, 1.25])[:, None, None])
    >>> np.sqrt(errors_at_the_type(data).covariances[:, 0, 0]).round(6).tolist()
    [1.0, 1.0, 1.0, 1.0]
    """
    return _at_a_median(data, np.zeros(len(data.member_of), dtype=np.intp))


def errors_at_each_vehicle(data: FlightEstimates) -> FlightEstimates:
    """As `errors_at_the_type`, the errors of each vehicle's flights taken at its own median.

    For what a vehicle did over time: how far apart vehicles are is no matter there.
    """
    return _at_a_median(data, data.member_of)


def _at_a_median(data: FlightEstimates, group: NDArray[np.intp]) -> FlightEstimates:
    scale = np.ones_like(data.values)
    for i in range(len(data.names)):
        _set_scale(scale[:, i], data, i, group)
    if np.all(scale == 1.0):
        return data
    outer = scale[:, :, None] * scale[:, None, :]
    return replace(data, covariances=data.covariances * outer)


def _set_scale(scale: Array, data: FlightEstimates, i: int, group: NDArray[np.intp]) -> None:
    """Factors of the standard errors of one parameter, where its errors may be relative."""
    there = np.flatnonzero(data.known[:, i])
    values, errors = data.values[there, i], np.sqrt(data.covariances[there, i, i])
    if len(there) < FEWEST or not _is_one_sided(values, errors):
        return
    # What lies near zero or beyond it by chance states the least error of all where it is relative.
    usual = float(np.median(np.abs(values)))
    size = np.log(np.maximum(np.abs(values), LEAST * usual))
    group = group[there]
    share = relative_share(size, np.log(errors), group)
    for one in np.unique(group):
        mine = group == one
        scale[there[mine]] = np.exp(share * (np.median(size[mine]) - size[mine]))


def _is_one_sided(values: Array, errors: Array) -> bool:
    """Whether nearly all estimates lie on one side of zero, and the usual one surely."""
    side = np.sign(np.median(values))
    away = float(np.median(side * values / errors))
    return bool(away > SURE and np.mean(side * values > 0.0) >= MOST)


def relative_share(log_values: Array, log_errors: Array, group: NDArray[np.intp]) -> float:
    """How likely errors are relative rather than absolute, by how they go with values of a group.

    Parameters
    ----------
    log_values, log_errors : ndarray, shape (n,)
        Logarithms of sizes and of standard errors.
    group : ndarray of int, shape (n,)
        Within which they are compared.

    Returns
    -------
    float
        From 0, absolute, to 1, relative; 0.5 where nothing tells.
    """
    _, place, count = np.unique(group, return_inverse=True, return_counts=True)

    def squares(each: Array) -> float:
        means = np.bincount(place, each) / count
        return float(np.sum((each - means[place]) ** 2))

    absolute, relative = squares(log_errors), squares(log_errors - log_values)
    least = 1e-12 * (absolute + relative)
    if least == 0.0:
        return 0.5
    freedom = len(log_values) - len(count)
    odds = 0.5 * freedom * np.log((absolute + least) / (relative + least))
    return float(1.0 / (1.0 + np.exp(-np.clip(odds, -700.0, 700.0))))
