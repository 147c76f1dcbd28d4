"""Whether the inputs of a record ask other parameters of a model, in gusts or in none.

The parameters are held, and the noises that the record has are found as filter error finds them.
What the filter leaves of the record is then as good as new at each sample, where the error of a
free run would hold every gust for long. Each parameter would have added to it what the same filter
makes of the slope of the model's own answer to the inputs: no gust is in that, so that its product
with what is left is zero on average where the model is right, by amounts that are known (a score
test). Colour that noise on the states is too simple for is taken off both, by what the past
innovations foretell of each other.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from flightid.errors import FlightidError
from flightid.frozen import dataclass
from flightid.identification.filter_error.innovations import FilteredData, InnovationsProblem
from flightid.identification.filter_error.problem import innovations_problem
from flightid.identification.filter_error.search import minimise
from flightid.identification.regression.fit import limits_of
from flightid.identification.regression.options import FilterErrorOptions
from flightid.models import Parameter, StateSpaceModel
from flightid.record import Record

Array = NDArray[np.float64]
ITERATIONS = 20
"""Of the search for the noises: eight are usual."""
ENOUGH = 0.1
"""Gain of a step in -2 ln p below which they are known well enough for a test."""
LAGS = 12
"""Past innovations that foretell the next one, at most."""
SAMPLES_A_NUMBER = 10
"""Of each output, for each number of that autoregression."""
LONGEST = 20_000
"""Samples that are asked, the first of all records."""
RESOLVED = 1e-9
"""Size of a slope, against the largest, below which it is rounding."""
NOISE = 1e-6
"""Innovations over outputs below which there is rounding alone."""


@dataclass(frozen=True, eq=False)
class ParameterScores:
    """The quadratic about a model's values that its likelihood on some records is.

    Attributes
    ----------
    names : tuple of str
        Free parameters that the records see.
    values : ndarray, shape (n,)
        At which the model stands.
    slopes : ndarray, shape (n,)
        Of the log-likelihood, by the parameter's unit.
    information : ndarray, shape (n, n)
        Covariance of `slopes` where the model is right.
    noises : ndarray
        Logarithms of all noises over their first guesses.
    misfit : float
        -2 ln p of the innovations beside a constant, with the colour that is taken off.
    innovations : tuple of ndarray, shape (n_outputs, n_samples)
        Of each record, its last samples: what the past of all outputs does not foretell.
    """

    names: tuple[str, ...]
    values: Array
    slopes: Array
    information: Array
    noises: Array
    misfit: float = 0.0
    innovations: tuple[Array, ...] = ()

    def alone(self, known: Array | None = None) -> tuple[Array, Array]:
        """What each parameter would have to move by if it alone were wrong, and standard errors.

        Parameters
        ----------
        known : ndarray, shape (n, n), optional
            Covariance of `values`; errors of all of them are in the standard errors then.

        Returns
        -------
        tuple of ndarray, each shape (n,)

        Example
        -------
        >>> one = np.ones(1)
        >>> found = ParameterScores(("a",), one, 8.0 * one, 4.0 * np.eye(1), one)
        >>> found.alone(), found.alone(np.array([[0.75]]))
        ((array([2.]), array([0.5])), (array([2.]), array([1.])))
        """
        own = np.diag(self.information)
        spread = self.information
        if known is not None:
            spread = spread + spread @ known @ spread
        return self.slopes / own, np.sqrt(np.diag(spread)) / own

    def value_errors(self, known: Array | None = None) -> Array:
        """Standard errors of what each parameter is where it alone was wrong.

        Its own error in the model goes with what it has to move by; those of all others do not,
        and errors that a record does not see, as of all derivatives by one factor, stay in it.

        Parameters
        ----------
        known : ndarray, shape (n, n), optional
            Covariance of `values`; none: the others are right.

        Returns
        -------
        ndarray, shape (n,)

        Example
        -------
        >>> one = np.ones(1)
        >>> found = ParameterScores(("a",), one, 8.0 * one, 4.0 * np.eye(1), one)
        >>> found.value_errors(np.array([[0.75]]))
        array([0.5])
        """
        own = np.diag(self.information)
        variance = 1.0 / own
        if known is not None:
            others = self.information / own[:, None] - np.eye(len(own))
            variance = variance + np.einsum("ij,jk,ik->i", others, known, others)
        return np.sqrt(variance)

    def misfit_beside(self, known: Array | None = None) -> float:
        """-2 ln p where errors of the values, as large as they may well be, explain what they can.

        Accounts of a record are to be compared so: a wrong one may fit better beside the errors
        that a fit happens to have than the true one does.

        Parameters
        ----------
        known : ndarray, shape (n, n), optional
            Covariance of `values`; none: they are right, and it is `misfit`.

        Example
        -------
        >>> one = np.ones(1)
        >>> found = ParameterScores(("a",), one, 8.0 * one, 4.0 * np.eye(1), one, 100.0)
        >>> found.misfit_beside(), found.misfit_beside(np.array([[0.75]]))
        (100.0, 88.0)
        """
        if known is None:
            return self.misfit
        moved = np.linalg.solve(np.eye(len(known)) + known @ self.information, known @ self.slopes)
        return self.misfit - float(self.slopes @ moved)


def parameter_scores(
    model: StateSpaceModel,
    measured: Sequence[Record],
    predicted: Sequence[Record],
    options: FilterErrorOptions,
    noises: Array | None = None,
) -> ParameterScores | None:
    """Slopes of the likelihood by the free parameters, at the most likely noises.

    Parameters
    ----------
    model : StateSpaceModel
        Linear or not; it keeps its values.
    measured, predicted : sequence of Record
        Inputs, and outputs as measured and as the model answers the inputs.
    options : FilterErrorOptions
        Of process noise, biases and hold.
    noises : ndarray, optional
        Those of other scores of the same records; default: they are searched for.

    Returns
    -------
    ParameterScores or None
        None where there is no free parameter, no state, no noise, no steady filter, or too little.

    Reference
    ---------
    Rao (1948), Proc. Cambridge Philosophical Society 44 (score tests); Maine & Iliff, NASA RP 1168,
    section 7 (innovations); Ljung, *System Identification*, 2nd ed., section 7.6 (instruments).
    """
    free = model.parameters.free
    point = model.parameters.independent_values()[model.parameters.free_indices]
    if not point.size or not model.states:
        return None
    try:
        problem = innovations_problem(model, _first(measured), options)
        if noises is None:
            noises = _noises(problem, model, _data(model, _first(predicted)))
        whole = np.concatenate([point, noises])
        residuals, _ = problem.residuals(whole, with_slopes=False)
        answered = replace(problem, data=_data(model, _first(predicted)))
        _, slopes = answered.residuals(whole, with_slopes=True)
    except (FlightidError, np.linalg.LinAlgError):
        return None
    sound = np.all(np.isfinite(residuals)) and np.all(np.isfinite(slopes))
    if not sound or _is_rounding(problem, whole):
        return None
    found = _whitened(problem, residuals, slopes[:, : len(free)])
    return None if found is None else _scores(free, point, noises, found)


def _scores(
    free: Sequence[Parameter], point: Array, noises: Array, found: _WhiteRows
) -> ParameterScores | None:
    """Of the parameters that move anything, by innovations and slopes of unit variance."""
    moves = found.moves
    size = np.linalg.norm(moves, axis=0)
    shown = size > RESOLVED * np.max(size, initial=0.0)
    if not np.any(shown):
        return None
    moves = moves[:, shown]
    names = tuple(each.name for each, is_seen in zip(free, shown, strict=True) if is_seen)
    slopes = -(moves.T @ found.left)
    return ParameterScores(
        names, point[shown], slopes, moves.T @ moves, noises, found.misfit, found.innovations
    )


def _first(records: Sequence[Record]) -> list[Record]:
    """The first `LONGEST` samples of all records."""
    found, room = [], LONGEST
    for each in records:
        if room <= 0:
            break
        time_s = each.time_s
        whole = each.n_samples <= room
        half = 0.5 * each.sample_time_s
        found.append(each if whole else each.segment(time_s[0] - half, time_s[room - 1] + half))
        room -= each.n_samples
    return found


def _data(model: StateSpaceModel, records: Sequence[Record]) -> tuple[FilteredData, ...]:
    return tuple(
        FilteredData(each.matrix(model.inputs), each.matrix(model.outputs), each.sample_time_s)
        for each in records
    )


def _noises(
    problem: InnovationsProblem, model: StateSpaceModel, predicted: Sequence[FilteredData]
) -> Array:
    """The most likely noises beside parameters that stay.

    Levels are those of the predictions: to solve for them in each step takes longer than all else.
    """
    values = {each.name: each.value for each in model.parameters.free}
    held = model.with_fixed(**{name: value for name, value in values.items() if value is not None})
    level = [
        replace(y, outputs=y.outputs - (y.outputs - x.outputs).mean(axis=1, keepdims=True))
        for y, x in zip(problem.data, predicted, strict=True)
    ]
    alone = replace(problem, model=held, data=tuple(level), output_bias=False, input_bias=False)
    limits = limits_of(held, ITERATIONS)[1]
    start = np.zeros(alone.n_all)
    return minimise(alone, start, limits, iterations=ITERATIONS, enough=ENOUGH).x


def _is_rounding(problem: InnovationsProblem, unknowns: Array) -> bool:
    found = problem.records(unknowns, with_slopes=False)
    left = np.concatenate([each.innovations for each, _ in found])
    whole = np.concatenate([each.outputs for each in problem.data], axis=1)
    return bool(np.any(np.std(left, axis=0) <= NOISE * np.std(whole, axis=1)))


@dataclass(frozen=True, eq=False)
class _WhiteRows:
    """Innovations (rows,) and their slopes (rows, n_free) of unit variance; -2 ln p; by record."""

    left: Array
    moves: Array
    misfit: float
    innovations: tuple[Array, ...]


def _whitened(problem: InnovationsProblem, residuals: Array, slopes: Array) -> _WhiteRows | None:
    """Innovations less what past ones foretell, and slopes so filtered; None: too short."""
    p, parts, first = len(problem.model.outputs), [], 0
    for each in problem.data:
        n = each.outputs.shape[1]
        rows = slice(first, first + n * p)
        first = rows.stop
        moved = slopes[rows].reshape(n, p, -1).swapaxes(1, 2)
        parts.append((residuals[rows].reshape(n, p), np.ascontiguousarray(moved)))
    samples = sum(len(e) for e, _ in parts)
    lags = min(LAGS, samples // (SAMPLES_A_NUMBER * p))
    if lags < 1 or any(len(e) <= 2 * lags for e, _ in parts):
        return None
    past = np.concatenate([_lagged(e, lags) for e, _ in parts])
    now = np.concatenate([e[lags:] for e, _ in parts])
    weights = np.linalg.lstsq(past, now, rcond=None)[0]
    by_lag = weights[1:].reshape(lags, p, p)
    left = now - past @ weights
    moves = np.concatenate(
        [s[lags:] - sum(s[lags - k : len(s) - k] @ by_lag[k - 1] for k in range(1, lags + 1))
         for _, s in parts]
    )  # fmt: skip
    basis = np.linalg.qr(past)[0]
    flat = moves.reshape(len(moves), -1)
    flat -= basis @ (basis.T @ flat)
    spread = left.T @ left / max(len(left) - past.shape[1], 1)
    whitener = np.linalg.inv(np.linalg.cholesky(spread)).T
    apart = (flat.reshape(moves.shape) @ whitener).swapaxes(1, 2)
    misfit = len(left) * float(np.linalg.slogdet(spread)[1])
    ends = np.cumsum([len(e) - lags for e, _ in parts])[:-1]
    return _WhiteRows(
        (left @ whitener).ravel(),
        apart.reshape(left.size, -1),
        misfit,
        tuple(np.split(left.T, ends, axis=1)),
    )


def _lagged(errors: Array, lags: int) -> Array:
    """A constant and the past of each sample, (n - lags, 1 + lags · p)."""
    n = len(errors)
    past = [errors[lags - k : n - k] for k in range(1, lags + 1)]
    return np.hstack([np.ones((n - lags, 1)), *past])
