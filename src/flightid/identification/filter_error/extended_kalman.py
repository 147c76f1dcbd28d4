"""Filter error along the trajectory of a nonlinear model (native: `extended_kalman.rs`).

An extended Kalman filter whose gain varies with the flight. Initial states begin at their
measurement and constants of channels at zero, both with a wide prior in place of elimination.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from flightid import _native
from flightid.errors import FlightidError
from flightid.frozen import dataclass
from flightid.identification.filter_error.innovations import (
    Filtered,
    InnovationsProblem,
    RecordInnovations,
)
from flightid.identification.filter_error.steady_filter import SteadyFilter
from flightid.identification.records.held_model import LinearPoint
from flightid.models import StateSpaceModel
from flightid.models.state_space.first_sample import first_outputs, measured_point
from flightid.models.state_space.integration_steps import steps_per_sample
from flightid.models.state_space.measured_states import StateOutputs
from flightid.record import Record

Array = NDArray[np.float64]
WIDE = 100.0
"""Variance of a measured initial state over that of its measurement."""


_Given = tuple[
    _native.StateSpace,
    Array,
    Array,
    Array,
    tuple[float, str, int],
    tuple[Array, Array, list[int], list[int]],
    tuple[Array, Array],
]
_Run = tuple[tuple[Array, Array, Array], tuple[Array, Array]]
"""Innovations, their triangles and predicted states; whitened innovations and mean logarithms."""


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
    Jategaonkar, *Flight Vehicle System Identification*, 2nd ed., §5.5 (time-varying filter). His
    slopes of the innovations are differences of whole runs; these are exact.
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
            reference=problem.reference, substeps=tuple(substeps), state_scale=state_scale,
        )  # fmt: skip

    @cached_property
    def _seen(self) -> list[StateOutputs]:
        """What each record's first sample tells of its states: the same for all unknowns."""
        return [first_outputs(self.model, each.inputs, each.outputs) for each in self.data]

    def records(self, unknowns: Array, *, with_slopes: bool) -> list[Filtered]:
        """Innovations of every record; slopes come with `residuals` alone."""
        del with_slopes
        return [
            (self._found(place, *self._filtered(place, unknowns)), None)
            for place in range(len(self.data))
        ]

    @cached_property
    def _last(self) -> dict[int, tuple[bytes, tuple[_Given, _Run]]]:
        """What each record's last run found, and where: evidence asks for it after its slopes."""
        return {}

    def _filtered(self, place: int, unknowns: Array) -> tuple[_Given, _Run]:
        """What the filter of one record is given and finds."""
        at = unknowns.tobytes()
        kept = self._last.get(place)
        if kept is None or kept[0] != at:
            given = self._given(place, unknowns)
            kept = at, (given, _native.extended_filter(*given))
            self._last[place] = kept
        return kept[1]

    def _with_slopes(self, place: int, unknowns: Array) -> tuple[_Run, tuple[Array, Array]]:
        """The same with slopes of the whitened innovations and of the logarithms."""
        given = self._given(place, unknowns)
        ahead = self._ahead(self._seen[place], given)
        run, slopes = _native.extended_filter_slopes(*given, ahead)
        self._last[place] = unknowns.tobytes(), (given, run)
        return run, slopes

    def _found(self, place: int, given: _Given, run: _Run) -> RecordInnovations:
        """One record as it is kept."""
        p, n_samples = self.data[place].outputs.shape
        start, prior, shifted, _ = given[-2]
        (innovations, triangles, states), _ = run
        n = len(self.model.states)
        late = triangles[n_samples // 2 :]
        usual = np.mean(late @ late.swapaxes(1, 2), axis=0)
        own = np.concatenate([states[0, :n], states[-1, n + len(shifted) :], states[-1, n:]])
        return RecordInnovations(
            innovations,
            states[:, :n],
            np.zeros((n_samples, p, 0)),
            own[: len(start)],
            np.zeros((n_samples * p, 0)),
            np.zeros((len(start), 0)),
            SteadyFilter(np.eye(n), np.zeros((n, p)), np.zeros((p, n)), usual, prior[:n, :n]),
        )

    def _given(self, place: int, unknowns: Array) -> _Given:
        """What the native filter takes of one record."""
        data, seen = self.data[place], self._seen[place]
        process, variance = self.noise(unknowns)
        n, (m, _), (p, _) = len(self.model.states), data.inputs.shape, data.outputs.shape
        shifted = list(range(m)) if self.input_bias else []
        biased = list(range(p)) if self.output_bias else []
        start = np.zeros(n + len(shifted) + len(biased))
        start[:n] = seen.states(data.outputs[:, :1])[:, 0]
        prior = np.zeros((len(start), len(start)))
        prior[:n, :n] = WIDE * seen.noise(np.diag(variance))
        unseen = np.flatnonzero(np.diag(prior)[:n] == 0.0)
        scale = np.ones(n) if self.state_scale is None else self.state_scale
        prior[unseen, unseen] = scale[unseen] ** 2
        sizes = [np.sqrt(np.mean(rows[used] ** 2, axis=1)) for rows, used in (
            (data.inputs, shifted), (data.outputs, biased))]  # fmt: skip
        places = np.arange(n, len(start))
        prior[places, places] = np.concatenate(sizes) ** 2
        return (
            self.model.native,
            self._values(unknowns),
            np.ascontiguousarray(data.inputs),
            np.ascontiguousarray(data.outputs.T),
            (data.sample_time_s, self.hold, self.substeps[place]),
            (start, prior, shifted, biased),
            (process, variance),
        )

    def _ahead(self, seen: StateOutputs, given: _Given) -> tuple[Array, Array, Array, Array]:
        """How values, prior, densities and variances change with each unknown."""
        (_, prior, _, _), (process, variance) = given[-2:]
        count, n, p = self.n_all, len(process), len(variance)
        values = np.zeros((count, len(given[1])))
        values[np.arange(self.n_free), self.model.parameters.free_indices] = 1.0
        densities, variances = np.zeros((count, n)), np.zeros((count, p))
        for place, state in enumerate(self.noisy, self.n_free):
            densities[place, state] = 2.0 * process[state]
        begun = np.zeros((count, *prior.shape))
        for place, output in enumerate(self.measured, self.n_free + len(self.noisy)):
            variances[place, output] = 2.0 * variance[output]
            begun[place, :n, :n] = WIDE * seen.noise(np.diag(variances[place]))
        return values, begun, densities, variances

    def residuals(self, unknowns: Array, *, with_slopes: bool) -> tuple[Array, Array]:
        """Scaled whitened innovations of all records, and their exact slopes by the unknowns.

        Rows without residual follow: they bring the curvature of the variances.
        """
        size, count = self.n_residuals, self.n_all if with_slopes else 0
        lengths = np.array([each.outputs.shape[1] for each in self.data], dtype=np.float64)
        total = sum(each.outputs.size for each in self.data)
        white, logs, turned, moved = [], [], [], []
        try:
            for place in range(len(self.data)):
                if with_slopes:
                    (_, (found, log)), slopes = self._with_slopes(place, unknowns)
                    turned.append(slopes[0])
                    moved.append(slopes[1])
                else:
                    _, (_, (found, log)) = self._filtered(place, unknowns)
                white.append(found.ravel())
                logs.append(log)
        except (FlightidError, np.linalg.LinAlgError):
            return np.full(size, np.nan), np.full((size, self.n_all), np.nan)
        factor = float(np.exp(np.sum(lengths[:, None] * np.array(logs)) / total))
        rows = np.concatenate(white)
        ended = factor * np.concatenate([rows, np.zeros(len(lengths) * len(logs[0]))])
        if not with_slopes:
            return ended, np.zeros((size, count))
        spread = np.array(moved)
        rise = np.tensordot(lengths, spread.sum(axis=1), axes=1) / total
        curved = np.sqrt(lengths)[:, None, None] * (spread - spread.mean(axis=1, keepdims=True))
        level = np.sqrt(np.mean(rows**2))
        slope = [*turned, level * curved.reshape(-1, count)]
        jacobian = factor * np.concatenate(slope)
        jacobian[: rows.size] += np.multiply.outer(factor * rows, rise)
        return ended, np.ascontiguousarray(jacobian)


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
