"""Innovations of a linear model with process noise on records, with exact slopes by everything.

The recursion itself is native (`linear_recursion.rs`). The likelihood −2 ln p = N ln det B +
Σ εᵀB⁻¹ε, its common scale put in at its best value, is the logarithm of a sum of squares: that of
the whitened innovations times the geometric mean of their deviations.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from flightid import _native
from flightid.errors import FlightidError
from flightid.frozen import dataclass
from flightid.identification.filter_error.gusts import GUST_REACH, GUST_UNKNOWNS, Gust
from flightid.identification.filter_error.steady_filter import (
    ContinuousPoint,
    SteadyFilter,
    steady_filter,
)
from flightid.identification.records.held_model import HeldModel, LinearPoint
from flightid.identification.records.nuisance import NuisanceDirections
from flightid.models import StateSpaceModel

Array = NDArray[np.float64]
PROCESS_REACH = 12.0
MEASUREMENT_REACH = 8.0


@dataclass(frozen=True)
class FilteredData:
    """What one record gives to the filter.

    Attributes
    ----------
    inputs : ndarray, shape (n_inputs, n_samples)
    outputs : ndarray, shape (n_outputs, n_samples)
    sample_time_s : float
    """

    inputs: Array
    outputs: Array
    sample_time_s: float


@dataclass(frozen=True)
class RecordInnovations:
    """One record at one point.

    Attributes
    ----------
    innovations : ndarray, shape (n_samples, n_outputs)
    states : ndarray, shape (n_samples, n_states)
        Predicted one sample ahead.
    slopes : ndarray, shape (n_samples, n_outputs, n_all)
        Derivatives of the whitened innovations; constants of the record taken out.
    constants : ndarray
        Initial state, then output biases, then input shifts.
    space : ndarray, shape (n_samples · n_outputs, rank)
        Orthonormal directions that the constants follow in the whitened innovations.
    weights : ndarray, shape (n_constants, rank)
        The constants by what shows along these.
    filter : SteadyFilter
    """

    innovations: Array
    states: Array
    slopes: Array
    constants: Array
    space: Array
    weights: Array
    filter: SteadyFilter


@dataclass(frozen=True)
class FreeResponse:
    """What constants of a record make of the filter: states, and their share of innovations."""

    states: Array
    directions: NuisanceDirections


Filtered = tuple[RecordInnovations, SteadyFilter | None]
"""A record and the derivatives of its filter, by parameter along a first axis."""


@dataclass(frozen=True)
class InnovationsProblem:
    """A model and its records; unknowns are θ, then log deviations of the noises.

    Process noise acts on the derivatives of `noisy` states with density exp(2 λ) times that
    state's `process_scale`²; outputs have deviation exp(ρ) times `output_scale`. The ρ of the
    output `reference` is zero: one common factor of all noises is known from the sum of squares.

    Attributes
    ----------
    model : StateSpaceModel
    data : tuple of FilteredData
    noisy : tuple of int
        States with process noise.
    process_scale : ndarray, shape (n_noisy,)
    output_scale : ndarray, shape (n_outputs,)
    output_bias, input_bias : bool
        Whether each record has unknown output biases and input shifts.
    hold : str
    gust : Gust or None
        Its logarithms are the last two unknowns, its state the last of all states.
    reference : int
        Output whose noise the factor is told by: not one whose noise may be none.
    """

    model: StateSpaceModel
    data: tuple[FilteredData, ...]
    noisy: tuple[int, ...]
    process_scale: Array
    output_scale: Array
    output_bias: bool
    input_bias: bool
    hold: str
    gust: Gust | None = None
    reference: int = 0

    @property
    def n_free(self) -> int:
        """Free parameters of the model."""
        return len(self.model.parameters.free)

    @property
    def n_all(self) -> int:
        """All unknowns."""
        white = len(self.noisy) + len(self.model.outputs) - 1
        return self.n_free + white + (0 if self.gust is None else GUST_UNKNOWNS)

    @property
    def reach(self) -> Array:
        """Logarithms by which the noises may differ from their first guesses."""
        outputs = len(self.model.outputs) - 1
        gust = 0 if self.gust is None else GUST_UNKNOWNS
        counts = len(self.noisy), outputs, gust
        return np.repeat([PROCESS_REACH, MEASUREMENT_REACH, GUST_REACH], counts)

    @property
    def n_measured(self) -> int:
        """Samples of all outputs of all records."""
        return sum(each.outputs.size for each in self.data)

    @property
    def n_residuals(self) -> int:
        """Innovations of all records, and one row for each output of each record."""
        return self.n_measured + sum(len(each.outputs) for each in self.data)

    @property
    def measured(self) -> tuple[int, ...]:
        """Outputs whose noises are unknowns, in their order."""
        return tuple(k for k in range(len(self.model.outputs)) if k != self.reference)

    def noise(self, unknowns: Array) -> tuple[Array, Array]:
        """Process densities by state and output variances, relative to the common factor."""
        process = np.zeros(len(self.model.states))
        count = len(self.noisy)
        driven, rest = np.split(unknowns[self.n_free :], [count])
        process[list(self.noisy)] = self.process_scale**2 * np.exp(2.0 * driven)
        logs = np.insert(rest[: len(self.model.outputs) - 1], self.reference, 0.0)
        if self.gust is not None:
            process = self.gust.process(process, unknowns[-GUST_UNKNOWNS:])
        return process, self.output_scale**2 * np.exp(2.0 * logs)

    def linear(self, unknowns: Array) -> LinearPoint:
        """The model at its parameters, with the state of the gust where there is one."""
        point = LinearPoint.of(self.model, self._values(unknowns))
        return point if self.gust is None else self.gust.added(point, unknowns[-GUST_UNKNOWNS:])

    def points(self, unknowns: Array) -> tuple[ContinuousPoint, list[ContinuousPoint]]:
        """State space with noise, and its derivatives by all unknowns."""
        return self._noisy(self.linear(unknowns), unknowns)

    def _noisy(
        self, linear: LinearPoint, unknowns: Array
    ) -> tuple[ContinuousPoint, list[ContinuousPoint]]:
        process, variance = self.noise(unknowns)
        p, n = linear.c.shape[1:]
        none_w, none_r = np.zeros((n, n)), np.zeros((p, p))
        point = ContinuousPoint(linear.a[0], linear.c[0], np.diag(process), np.diag(variance))
        slopes = [
            ContinuousPoint(a, c, none_w, none_r)
            for a, c in zip(linear.a[1:], linear.c[1:], strict=True)
        ]
        still = np.zeros((n, n)), np.zeros((p, n))
        for state in self.noisy:
            density = np.zeros((n, n))
            density[state, state] = 2.0 * process[state]
            slopes.append(ContinuousPoint(*still, density, none_r))
        for output in self.measured:
            wider = np.zeros((p, p))
            wider[output, output] = 2.0 * variance[output]
            slopes.append(ContinuousPoint(*still, none_w, wider))
        return point, slopes if self.gust is None else [*slopes, *self.gust.slopes(point)]

    def _values(self, unknowns: Array) -> Array:
        values = self.model.parameters.independent_values()
        values[self.model.parameters.free_indices] = unknowns[: self.n_free]
        return values

    def records(self, unknowns: Array, *, with_slopes: bool) -> list[Filtered]:
        """Innovations of every record, and the filter's derivatives.

        Raises
        ------
        FitError
            There is no steady filter.
        """
        linear = self.linear(unknowns)
        point, slopes = self._noisy(linear, unknowns)
        filters = {
            step: (
                HeldModel.of(linear, step, self.hold),
                *steady_filter(point, slopes if with_slopes else [], step),
            )
            for step in {each.sample_time_s for each in self.data}
        }
        # What constants make of innovations is the same in all records of one length.
        whole = [(each.sample_time_s, each.outputs.shape[1]) for each in self.data]
        free = {key: self._free(*filters[key[0]][:2], key[1]) for key in set(whole)}
        return [
            (self._record(each, *filters[key[0]], free[key]), filters[key[0]][2])
            for each, key in zip(self.data, whole, strict=True)
        ]

    def _free(self, held: HeldModel, found: SteadyFilter, n_samples: int) -> FreeResponse:
        n, p = len(found.closed), len(found.c)
        runs = self._constants(n, p, held.steady())
        states = _run(found, runs, n_samples)
        left = np.array([y - x @ found.c.T for x, (_, y, _) in zip(states, runs, strict=True)])
        whitener = np.linalg.inv(np.linalg.cholesky(found.innovation))
        flat = (left @ whitener.T).reshape(len(runs), -1)
        return FreeResponse(states, NuisanceDirections.of(-flat.T))

    def _record(
        self,
        data: FilteredData,
        held: HeldModel,
        found: SteadyFilter,
        slopes: SteadyFilter,
        free: FreeResponse,
    ) -> RecordInnovations:
        taps = held.taps(data.inputs)
        whitener = np.linalg.inv(np.linalg.cholesky(found.innovation))
        p, n = found.c.shape
        weights, steady = held.weights[0], held.steady()
        push, seen = taps.T @ weights[:, :n], data.outputs.T - taps.T @ weights[:, n:]
        state = _run(found, [(np.zeros(n), seen, push)], len(seen))[0]
        nuisance = free.directions.best(((seen - state @ found.c.T) @ whitener.T).ravel())
        state = state + np.tensordot(nuisance.values, free.states, axes=1)
        if self.output_bias:
            seen = seen - nuisance.values[n : n + p]
        if self.input_bias:
            shift = nuisance.values[len(nuisance.values) - len(data.inputs) :]
            seen = seen - steady[1][0] @ shift
            taps = taps + shift[[row for row, _ in held.places], None]
        slope = _slopes(found, slopes, whitener, held, (state, seen, taps))
        white = nuisance.removed_from(slope.reshape(seen.size, -1))
        return RecordInnovations(
            seen - state @ found.c.T,
            state,
            white.reshape(slope.shape),
            nuisance.values,
            nuisance.space,
            free.directions.weights,
            found,
        )

    def _constants(
        self, n: int, p: int, steady: tuple[Array, Array]
    ) -> list[tuple[Array, Array, Array]]:
        """Start, z and q of one run for each constant of a record."""
        no_output, no_push = np.zeros((1, p)), np.zeros((1, n))
        runs = [(start, no_output, no_push) for start in np.eye(n)]
        if self.output_bias:
            runs += [(np.zeros(n), -bias[None], no_push) for bias in np.eye(p)]
        if self.input_bias:
            pairs = zip(steady[0][0].T, steady[1][0].T, strict=True)
            runs += [(np.zeros(n), -through[None], push[None]) for push, through in pairs]
        return runs

    def residuals(self, unknowns: Array, *, with_slopes: bool) -> tuple[Array, Array]:
        """Scaled whitened innovations of all records, and their Jacobian.

        Squares of their slopes lack half of what a variance contributes to the information: rows
        without residual, one for each output and record, bring it, so that the product of the
        Jacobian is Fisher's information. A point without a steady filter has no residuals: they
        are NaN, which shortens the step.
        """
        size = self.n_residuals
        try:
            found = self.records(unknowns, with_slopes=with_slopes)
        except (FlightidError, np.linalg.LinAlgError):
            return np.full(size, np.nan), np.full((size, self.n_all), np.nan)
        count = self.n_all if with_slopes else 0
        total = self.n_measured
        level, rise = 0.0, np.zeros(count)
        widened: list[Array] = []
        rows, turns = [], []
        for each, slopes in found:
            triangle = np.linalg.cholesky(each.filter.innovation)
            inverse = np.linalg.inv(triangle)
            rows.append(each.innovations @ inverse.T)
            level += len(each.innovations) * float(np.sum(np.log(np.diag(triangle))))
            turn = np.zeros((count, *triangle.shape))
            if slopes is not None and count:
                relative = inverse @ slopes.innovation @ inverse.T
                diagonal = np.diagonal(relative, axis1=1, axis2=2)
                mean = diagonal.mean(axis=1, keepdims=True)
                widened.append(0.5 * np.sqrt(len(rows[-1])) * (diagonal - mean))
                turn = _lower(relative)
                rise += len(rows[-1]) * np.trace(turn, axis1=1, axis2=2)
            turns.append(turn)
        factor = np.exp(level / total)
        white = np.concatenate([each.ravel() for each in rows])
        whole, first = np.empty((size, count)), 0
        for (each, _), row, turn in zip(found, rows, turns, strict=True):
            # All that turns and stretches whitened innovations is one product with them.
            by = (rise / total)[:, None, None] * np.eye(row.shape[1]) - turn
            into = whole[first : first + row.size].reshape(len(row), -1)
            np.matmul(row, by.transpose(2, 1, 0).reshape(row.shape[1], -1), out=into)
            into += each.slopes.reshape(into.shape)
            first += row.size
        still = np.zeros(size - total)
        curvature = (
            np.array(widened)
            .reshape(len(found), count, len(still) // len(found))
            .transpose(0, 2, 1)
        )
        whole[total:] = np.sqrt(np.mean(white**2)) * curvature.reshape(len(still), count)
        whole *= factor
        return factor * np.concatenate([white, still]), whole


def _lower(matrix: Array) -> Array:
    """Lower triangles with half the diagonal: slopes of a Cholesky factor."""
    share = np.tril(np.ones(matrix.shape[1:])) - 0.5 * np.eye(matrix.shape[2])
    return np.asarray(matrix * share)


def _slopes(
    found: SteadyFilter,
    slopes: SteadyFilter,
    whitener: Array,
    held: HeldModel,
    signals: tuple[Array, Array, Array],
) -> Array:
    """Derivatives of the whitened innovations, (n_samples, n_outputs, n_slopes).

    `signals` are the states, the outputs less what inputs show at once, and the inputs' taps.
    """
    state, seen, taps = signals
    (count, n), (p, _) = slopes.closed.shape[:2], found.c.shape
    if not count:
        return np.zeros((*seen.shape, 0))
    forced, direct = (
        np.zeros((count, n, n + p + len(taps))),
        np.zeros((count, p, n + p + len(taps))),
    )
    forced[:, :, :n], forced[:, :, n : n + p], direct[:, :, :n] = (
        slopes.closed,
        slopes.gain,
        -slopes.c,
    )
    moved = held.weights[1:].swapaxes(1, 2)
    forced[: len(moved), :, n + p :] = moved[:, :n] - found.gain @ moved[:, n:]
    direct[: len(moved), :, n + p :] = -moved[:, n:]
    return _native.slope_recursion(
        found.closed,
        whitener @ found.c,
        forced,
        whitener @ direct,
        np.concatenate([state.T, seen.T, taps]),
    )


def _run(found: SteadyFilter, runs: Sequence[tuple[Array, Array, Array]], n_samples: int) -> Array:
    shape = (n_samples, len(found.closed))
    forcing = [np.broadcast_to(seen @ found.gain.T + push, shape) for _, seen, push in runs]
    starts = np.array([start for start, _, _ in runs])
    closed = np.ascontiguousarray(found.closed)
    return np.asarray(_native.linear_recursion(closed, np.array(forcing), starts))
