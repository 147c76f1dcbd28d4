"""Covariates first: what battery, payload, wind, pilot or firmware explain is no drift.

Slopes are those within vehicles, of the other vehicles of the type, with the spread that slopes
show between vehicles; a vehicle's own flights come in where its series is tested, by the covariance
that slopes give it. Together that is generalised least squares of all flights at once.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import nnls

from flightid.errors import ShapeError
from flightid.fleet.statistics.flight_estimates import FlightEstimates
from flightid.fleet.statistics.neighbours import histories_in_time
from flightid.frozen import dataclass
from flightid.uncertainty.estimate import Estimate, Reading

Array = NDArray[np.float64]
Covariate = Sequence[float | str | None]
UNTOLD = 1e-6
"""Prior information of a slope, beside that of one flight: one that no other vehicle tells is left
to the vehicle's own flights."""
TOLD = 1e-8
RANK = 1e-9
"""Of the largest singular value of a design, below which there is none."""


@dataclass(frozen=True, eq=False)
class CovariateDesign:
    """Covariates as columns of numbers.

    Attributes
    ----------
    names : tuple of str, length c
        Of numbers as they are called; of words ``"name = word"``, the commonest left out.
    columns : ndarray, shape (n, c)
        In standard deviations about the mean; words 0 and 1.
    scales : ndarray, shape (c,)
        Standard deviation of each number in its own unit; 1 of words.
    missing : mapping of str to int
        Flights that do not tell a covariate and count with its mean.

    Example
    -------
    >>> made = design_covariates({"firmware": ["4.5", "4.6", "4.6"], "battery": [12.0, 11.0, None]})
    >>> made.names, made.missing
    (('firmware = 4.5', 'battery'), {'battery': 1})
    """

    names: tuple[str, ...]
    columns: Array
    scales: Array
    missing: Mapping[str, int]


def design_covariates(covariates: Mapping[str, Covariate]) -> CovariateDesign:
    """Columns of numbers from covariates by name, one value a flight.

    Parameters
    ----------
    covariates : mapping of str to sequence of float, str or None
        None where a flight does not tell it.

    Raises
    ------
    ShapeError
        Covariates of different numbers of flights.
    """
    lengths = {len(each) for each in covariates.values()}
    if len(lengths) > 1:
        raise ShapeError("covariates of a fleet", found=sorted(lengths), needed="a value a flight")
    names: list[str] = []
    columns: list[Array] = []
    scales: list[float] = []
    missing: dict[str, int] = {}
    for name, values in covariates.items():
        absent = np.array([value is None for value in values])
        if absent.any():
            missing[name] = int(absent.sum())
        words = any(isinstance(value, str) for value in values)
        for label, column in _words(name, values) if words else _number(name, values):
            filled = np.where(absent, column[~absent].mean() if (~absent).any() else 0.0, column)
            deviation = 1.0 if words else float(filled.std())
            if filled.std() > 0.0:
                names.append(label)
                columns.append((filled - filled.mean()) / deviation)
                scales.append(deviation)
    n = lengths.pop() if lengths else 0
    stacked = np.column_stack(columns) if columns else np.zeros((n, 0))
    return CovariateDesign(tuple(names), stacked, np.array(scales), missing)


def _number(name: str, values: Covariate) -> list[tuple[str, Array]]:
    return [(name, np.array([0.0 if value is None else float(value) for value in values]))]


def _words(name: str, values: Covariate) -> list[tuple[str, Array]]:
    told = [str(value) for value in values if value is not None]
    ranked = sorted(set(told), key=lambda word: (-told.count(word), word))
    return [
        (f"{name} = {word}", np.array([float(str(value) == word) for value in values]))
        for word in sorted(ranked[1:])
    ]


@dataclass(frozen=True, eq=False)
class CovariateSlopes:
    """What covariates do to one parameter, by all vehicles and without each.

    Attributes
    ----------
    effects : tuple of Estimate
        Change of the parameter for one unit of a number, or for a word instead of the commonest.
    slopes : ndarray, shape (c,)
        On the columns, of all vehicles.
    without : mapping of str to (ndarray, ndarray)
        By vehicle: slopes on the columns, shape (c,), and their covariance, shape (c, c), of all
        others.
    """

    effects: tuple[Reading, ...]
    slopes: Array
    without: Mapping[str, tuple[Array, Array]]


def fit_covariates(
    data: FlightEstimates,
    place: int,
    design: CovariateDesign,
    variances: Array,
    beside: Mapping[str, Array] | None = None,
) -> CovariateSlopes:
    """Slopes of one parameter on the covariates, within vehicles.

    Parameters
    ----------
    data : FlightEstimates
    place : int
        Of the parameter.
    design : CovariateDesign
    variances : ndarray, shape (n,)
        Of the parameter's errors.
    beside : mapping of str to ndarray, optional
        By vehicle, shape (its flights in order of time, m): shapes that its flights hold at any
        size, such as steps. Left in, a change of many behind a new firmware bends its slope.

    Raises
    ------
    ShapeError
        A design of another number of flights.
    """
    c, k = len(design.names), len(data.members)
    if not c:
        return CovariateSlopes((), np.zeros(0), {})
    if design.columns.shape[0] != len(data.vehicles):
        raise ShapeError(
            "covariates of a fleet", found=design.columns.shape[0], needed=len(data.vehicles)
        )
    there = data.known[:, place]
    if not there.any():
        none = dict.fromkeys(data.members, (np.zeros(c), np.eye(c)))
        return CovariateSlopes((), np.zeros(c), none)
    information, score = np.zeros((k, c, c)), np.zeros((k, c))
    for rows in histories_in_time(data, place):
        vehicle, weights = data.member_of[rows[0]], 1.0 / np.sqrt(variances[rows])
        own, held = np.ones((len(rows), 1)), (beside or {}).get(data.vehicles[rows[0]])
        own = own if held is None else np.column_stack([own, held])
        both = np.column_stack([design.columns[rows], data.values[rows, place]])
        left = _left(own * weights[:, None], both * weights[:, None])
        information[vehicle] = left[:, :c].T @ left[:, :c]
        score[vehicle] = left[:, :c].T @ left[:, c]
    prior = UNTOLD * float(np.median(1.0 / variances[there])) * np.eye(c)
    total, sums = information.sum(axis=0) + prior, score.sum(axis=0)
    slopes = np.asarray(np.linalg.solve(total, sums))
    apart = _spread(information, score - information @ slopes)
    noise = information + information @ apart @ information
    every = prior + noise.sum(axis=0)
    inverse = np.linalg.inv(total)
    covariance = inverse @ every @ inverse
    without = {}
    for i, name in enumerate(data.members):
        others = np.linalg.inv(total - information[i])
        error = others @ (every - noise[i]) @ others + apart
        without[name] = np.asarray(others @ (sums - score[i])), np.asarray(error)
    diagonals = np.einsum("kcc->kc", information)
    tellers = np.count_nonzero(diagonals > TOLD * np.diag(total), axis=0)
    effects = tuple(
        _effect(name, slopes[i], covariance[i, i], design.scales[i], int(tellers[i]))
        for i, name in enumerate(design.names)
    )
    return CovariateSlopes(effects, slopes, without)


def _left(design: Array, columns: Array) -> Array:
    """What a design, of any rank, leaves of columns."""
    axes, sizes, _ = np.linalg.svd(design, full_matrices=False)
    axes = axes[:, sizes > RANK * sizes[0]]
    return np.asarray(columns - axes @ (axes.T @ columns))


def _spread(information: Array, left: Array) -> Array:
    """Variances of slopes between vehicles, on a diagonal: by moments of what a common one leaves.

    E[u uᵀ] = I + I D I of a vehicle's score u about the common slopes and its information I.
    """
    needed = np.einsum("kcd->cd", information**2)
    there = np.sum(left**2, axis=0) - np.einsum("kcc->c", information)
    scale = np.sqrt(np.maximum(np.diag(needed), np.finfo(float).tiny))
    found, _ = nnls(needed / np.outer(scale, scale), np.maximum(there, 0.0) / scale)
    return np.diag(found / scale)


def _effect(name: str, slope: float, variance: float, scale: float, tellers: int) -> Reading:
    if not tellers:
        return Estimate(name, None, reason="it does not change within any vehicle")
    freedom = float(tellers - 1) if tellers > 1 else None
    stderr = float(np.sqrt(variance) / scale)
    return Estimate(name, float(slope / scale), stderr=stderr, freedom=freedom)


def own_slopes(values: Array, variances: Array, x: Array, slope: Array, error: Array) -> Array:
    """Slopes of the other vehicles and of this one's flights together.

    Parameters
    ----------
    values, variances : ndarray, shape (n,)
        Of the vehicle's flights.
    x : ndarray, shape (n, q)
        Covariates.
    slope : ndarray, shape (q,)
        Of the others, with the covariance `error`, shape (q, q).

    Returns
    -------
    ndarray, shape (q,)
    """
    weights = 1.0 / variances
    flat = x - np.average(x, axis=0, weights=weights)
    information = np.linalg.inv(error)
    total = information + (flat.T * weights) @ flat
    return np.asarray(np.linalg.solve(total, information @ slope + (flat.T * weights) @ values))


def without_covariates(
    data: FlightEstimates, design: CovariateDesign, fitted: Sequence[CovariateSlopes]
) -> FlightEstimates:
    """Estimates without what covariates explain."""
    if not design.names:
        return data
    moved = np.column_stack([design.columns @ each.slopes for each in fitted])
    return replace(data, values=np.where(data.known, data.values - moved, 0.0))
