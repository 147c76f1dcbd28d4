"""Filter error along the trajectory of a nonlinear model (native: `extended_kalman.rs`).

An extended Kalman filter whose gain varies with the flight. Initial states begin at their
measurement and constants of channels at zero, both with a wide prior in place of elimination.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from flightid import _native
from flightid.errors import FlightidError
from flightid.identification.filter_error.innovations import (
    Filtered,
    FilteredData,
    InnovationsProblem,
    RecordInnovations,
)
from flightid.identification.filter_error.steady_filter import SteadyFilter
from flightid.identification.records.held_model import LinearPoint
from flightid.models import StateSpaceModel
from flightid.models.state_space.integration_steps import steps_per_sample
from flightid.models.state_space.measured_states import measured_point, state_outputs
from flightid.record import Record

Array = NDArray[np.float64]
DIFFERENCE = 1e-5
"""Relative step of differences of whole runs; those of the equations are exact."""
WIDE = 100.0
"""Variance of a measured initial state over that of its measurement."""


@dataclass(frozen=True)
class ExtendedProblem(InnovationsProblem):
    """The same unknowns, for equations that change along the flight.

    Attributes
    ----------
    substeps : tuple of int
        Runge-Kutta steps in a sample interval, by record.
    state_scale : ndarray, shape (n_states,)
        Sizes of the states: deviations of those that begin unmeasured.

    Assumes
    -------
    Noise so small that the equations are nearly linear over its size; white process noise. A gust
    with a memory is a state of the model, named in `process_noise`.

    Reference
    ---------
    Jategaonkar, *Flight Vehicle System Identification*, 2nd ed., §5.5 (time-varying filter; slopes
    of the innovations by differences).
    """

    substeps: tuple[int, ...] = ()
    state_scale: Array | None = None

    @classmethod
    def along(
        cls,
        problem: InnovationsProblem,
        substeps: Sequence[int],
        state_scale: Array,
    ) -> ExtendedProblem:
        """From the problem of the model's linearisation."""
        return cls(
            problem.model, problem.data, problem.noisy, problem.process_scale,
            problem.output_scale, problem.output_bias, problem.input_bias, problem.hold,
            substeps=tuple(substeps), state_scale=state_scale,
        )  # fmt: skip

    def records(self, unknowns: Array, *, with_slopes: bool) -> list[Filtered]:
        """Innovations of every record; slopes are differences of `residuals` alone."""
        del with_slopes
        return [
            (self._found(each, steps, unknowns)[0], [])
            for each, steps in zip(self.data, self.substeps, strict=True)
        ]

    def _found(
        self, data: FilteredData, steps: int, unknowns: Array
    ) -> tuple[RecordInnovations, Array]:
        """One record, and the triangles of its innovations' covariances."""
        model, (process, variance) = self.model, self.noise(unknowns)
        n, (m, _), (p, n_samples) = len(model.states), data.inputs.shape, data.outputs.shape
        shifted = list(range(m)) if self.input_bias else []
        biased = list(range(p)) if self.output_bias else []
        seen = state_outputs(model, data.inputs, data.outputs)
        start = np.concatenate([seen.states(data.outputs[:, :1])[:, 0], np.zeros(m + p)])
        start = start[: n + len(shifted) + len(biased)]
        prior = np.zeros((len(start), len(start)))
        prior[:n, :n] = WIDE * seen.noise(np.diag(variance))
        unseen = np.flatnonzero(np.diag(prior)[:n] == 0.0)
        scale = np.ones(n) if self.state_scale is None else self.state_scale
        prior[unseen, unseen] = scale[unseen] ** 2
        sizes = [np.sqrt(np.mean(rows[used] ** 2, axis=1)) for rows, used in (
            (data.inputs, shifted), (data.outputs, biased))]  # fmt: skip
        places = np.arange(n, len(start))
        prior[places, places] = np.concatenate(sizes) ** 2
        innovations, triangles, states = _native.extended_filter(
            model.native,
            self._values(unknowns),
            np.ascontiguousarray(data.inputs),
            np.ascontiguousarray(data.outputs.T),
            (data.sample_time_s, self.hold, steps),
            (start, prior, shifted, biased),
            (process, variance),
        )
        late = triangles[n_samples // 2 :]
        usual = np.mean(late @ late.swapaxes(1, 2), axis=0)
        own = np.concatenate([states[0, :n], states[-1, n + len(shifted) :], states[-1, n:]])
        made = RecordInnovations(
            innovations,
            states[:, :n],
            np.zeros((n_samples, p, 0)),
            own[: len(start)],
            np.zeros((n_samples * p, 0)),
            SteadyFilter(np.eye(n), np.zeros((n, p)), np.zeros((p, n)), usual, prior[:n, :n]),
        )
        return made, triangles

    def residuals(self, unknowns: Array, *, with_slopes: bool) -> tuple[Array, Array]:
        """Scaled whitened innovations of all records, and their differences by the unknowns."""
        size = self.n_residuals
        try:
            centre = self._whitened(unknowns)
            if not with_slopes:
                return self._scaled(centre), np.zeros((size, 0))
            columns = [self._slope(unknowns, place, centre) for place in range(self.n_all)]
        except (FlightidError, np.linalg.LinAlgError):
            return np.full(size, np.nan), np.full((size, self.n_all), np.nan)
        return self._scaled(centre), np.ascontiguousarray(np.array(columns).T)

    def _whitened(self, unknowns: Array) -> tuple[Array, Array]:
        """Whitened innovations, and mean logarithms of the triangles' diagonals by record."""
        white, logs = [], []
        for each, steps in zip(self.data, self.substeps, strict=True):
            found, triangles = self._found(each, steps, unknowns)
            solved = np.linalg.solve(triangles, found.innovations[:, :, None])
            white.append(solved.ravel())
            logs.append(np.log(np.diagonal(triangles, axis1=1, axis2=2)).mean(axis=0))
        return np.concatenate(white), np.array(logs)

    def _factor(self, logs: Array) -> float:
        """Geometric mean of the deviations."""
        lengths = np.array([each.outputs.shape[1] for each in self.data])
        total = sum(each.outputs.size for each in self.data)
        return float(np.exp(np.sum(lengths[:, None] * logs) / total))

    def _scaled(self, found: tuple[Array, Array]) -> Array:
        white, logs = found
        return np.concatenate([self._factor(logs) * white, np.zeros(logs.size)])

    def _slope(self, unknowns: Array, place: int, centre: tuple[Array, Array]) -> Array:
        """Derivative of the residuals, then of the rows that bring the variances' curvature."""
        low, high = self._around(unknowns, place)
        below, above = self._whitened(low), self._whitened(high)
        step = high[place] - low[place]
        white = (self._factor(above[1]) * above[0] - self._factor(below[1]) * below[0]) / step
        relative = 2.0 * (above[1] - below[1]) / step
        roots = np.sqrt([each.outputs.shape[1] for each in self.data])
        spread = 0.5 * roots[:, None] * (relative - relative.mean(axis=1, keepdims=True))
        level = self._factor(centre[1]) * np.sqrt(np.mean(centre[0] ** 2))
        return np.concatenate([white, level * spread.ravel()])

    def _around(self, unknowns: Array, place: int) -> tuple[Array, Array]:
        """Points on both sides, inside the parameter's bounds."""
        low, high = unknowns.copy(), unknowns.copy()
        size, least, most = 1.0, -np.inf, np.inf
        if place < self.n_free:
            parameter = self.model.parameters.free[place]
            size = max(abs(unknowns[place]), 0.1 * abs(parameter.value or 0.0)) or 1.0
            least, most = parameter.minimum, parameter.maximum
        low[place] = max(unknowns[place] - DIFFERENCE * size, least)
        high[place] = min(unknowns[place] + DIFFERENCE * size, most)
        return low, high


def along_the_flight(
    model: StateSpaceModel, records: Sequence[Record]
) -> tuple[StateSpaceModel, list[int]]:
    """The model seen at the first measured sample, and the steps that its modes ask for there."""
    at = measured_point(model, records)
    steps = [steps_per_sample(model, each.sample_time_s, None, at=at) for each in records]
    return model.linearise(at) if at else model, steps


def has_free_constants(model: StateSpaceModel, point: LinearPoint) -> bool:
    """Whether a free parameter of linear equations acts as a constant alone, about no trim."""
    if any(model.trim.values()):
        return False
    parts = (point.a, point.b, point.c, point.d, point.delays_s[:, :, None])
    moves = [np.any(part[1:] != 0.0, axis=(1, 2)) for part in parts]
    return not bool(np.all(np.any(moves, axis=0)))


def sizes_of_states(point: LinearPoint, spread: Array) -> Array:
    """Deviations of the states as the outputs show them; the mean for those not seen."""
    found = np.abs(np.linalg.pinv(point.c[0])) @ spread
    return np.asarray(np.where(found > 0.0, found, found.mean() or 1.0))
