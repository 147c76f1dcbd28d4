"""Right sides of the equations of motion, from measured states and inputs (`model_samples.rs`).

ẋ = f(x, u) is compared after integration over each sample interval: x(k+1) − x(k) is measured,
and the integral of f is a sum over nodes inside. There an input is exactly what its hold says; each
interval is cut where a delay moves a corner into it (Gauss's rule on the pieces). The states run
through the samples as cubics; a step of an input bends them, which no cubic follows, so what the
model's own slope makes of each corner is added to the cubic that leaves it out.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from flightid.errors import ModelError
from flightid.frozen import dataclass
from flightid.identification.records.delayed_inputs import DelayedInputs, lagrange
from flightid.identification.regression.sampled_equations import Reconstruction, StateMeasurements
from flightid.models import StateSpaceModel
from flightid.models.state_space.linear import solved_rates

Array = NDArray[np.float64]
_GAUSS = 0.5 / np.sqrt(3.0)
"""Nodes of Gauss's rule from the middle of a piece, over its length: exact for cubics."""
_NEAR = (-1.0, 0.0, 1.0, 2.0)
"""Samples through which a state's cubic runs, about an interval from 0 to 1."""


@dataclass(frozen=True)
class RightSides:
    """Both kinds of equation at one point, with derivatives by the free parameters.

    Attributes
    ----------
    rates : ndarray, shape (n_states, n_samples − 1)
        Mean state derivative over each sample interval.
    rate_slopes : ndarray, shape (n_states, n_samples − 1, n_free)
    others : ndarray, shape (n_others, n_samples)
        Outputs that are no states, at the samples.
    other_slopes : ndarray, shape (n_others, n_samples, n_free)
    """

    rates: Array
    rate_slopes: Array
    others: Array
    other_slopes: Array


@dataclass(frozen=True)
class _StateValues:
    """State derivatives, then other outputs, at points: (n_points, n_rows) and derivatives."""

    values: Array
    by_input: Array
    by_theta: Array


@dataclass(frozen=True)
class RightSide:
    """State derivatives and remaining outputs that a model computes from measured motion.

    Attributes
    ----------
    reconstruction : Reconstruction
    hold : {"zero", "first", "band_limited"}
        What the inputs do between samples.
    """

    reconstruction: Reconstruction
    hold: str = "band_limited"

    @property
    def model(self) -> StateSpaceModel:
        """Model of the equations."""
        return self.reconstruction.model

    def bends(self, theta: Array, motion: StateMeasurements) -> Bends:
        """What corners of the inputs do to the states between samples, for these parameters."""
        values, late = self._late(theta, motion)
        # Of linear equations derivatives by inputs are the same at every sample.
        told = slice(1) if self.model.is_linear else slice(None)
        states, inputs = motion.states[:, told], late.at(0.0)[0][:, told]
        n = len(self.model.states)
        return Bends.of(late, self._computed(values, states, inputs).by_input[:, :n])

    def at(self, theta: Array, motion: StateMeasurements, bends: Bends) -> RightSides:
        """Values and derivatives at free parameters, shape (n_free,), bends held.

        Raises
        ------
        DataError
            An equation has no value at a sample.
        SingularError
            The equations do not give every state derivative.
        ModelError
            State derivatives enter an equation other than linearly, or a delay is negative.
        """
        values, late = self._late(theta, motion)
        late = bends.late if bends.late.is_like(late) else late
        n, cells = len(self.model.states), motion.n_samples - 1
        pieces = list(pairwise(late.corners))
        places = [a + (b - a) * (0.5 + side * _GAUSS) for a, b in pieces for side in (-1.0, 1.0)]
        weights = np.repeat([0.5 * (b - a) for a, b in pieces], 2)
        paths = [curve(motion.states, place) + bends.at(place) for place in places]
        driven = [late.at(place) for place in places]
        if self.model.is_linear:
            # Means of what is affine are its values at the means.
            parts = (paths, *zip(*driven, strict=True))
            path, inputs, rates = (np.tensordot(weights, np.array(part), axes=1) for part in parts)
            paths, driven, weights = [path], [(inputs, rates)], np.ones(1)
        inside = self._computed(
            values,
            np.concatenate(paths, axis=1),
            np.concatenate([each[:, :-1] for each, _ in driven], axis=1),
        )

        def mean(found: Array) -> Array:
            shaped = found.reshape(len(paths), cells, *found.shape[1:])
            return (
                np.asarray(np.tensordot(weights, shaped, axes=1)) if len(paths) > 1 else shaped[0]
            )

        if self.hold == "zero":
            moving = late.changes()[1][:, :-1].T / motion.sample_time_s
            by_delay = mean(inside.by_input[:, :n]) * moving[:, None]
        else:
            moving = np.concatenate([rates[:, :-1] for _, rates in driven], axis=1).T
            by_delay = mean(inside.by_input[:, :n] * moving[:, None])
        slopes = mean(inside.by_theta[:, :n]) - by_delay @ late.slopes
        others, other_slopes = self._others(values, motion, late)
        return RightSides(mean(inside.values[:, :n]).T, slopes.swapaxes(0, 1), others, other_slopes)

    def _late(self, theta: Array, motion: StateMeasurements) -> tuple[Array, DelayedInputs]:
        values = self.model.parameters.independent_values()
        values[self.model.parameters.free_indices] = theta
        step = motion.sample_time_s
        return values, DelayedInputs.of(self.model, values, motion.inputs, step, self.hold)

    def _others(
        self, values: Array, motion: StateMeasurements, late: DelayedInputs
    ) -> tuple[Array, Array]:
        """Outputs that are no states, at the samples, and their derivatives."""
        n = len(self.model.states)
        if not self.reconstruction.others:
            blank = np.zeros((0, motion.n_samples, late.slopes.shape[1]))
            return np.zeros((0, motion.n_samples)), blank
        inputs, rates = late.at(0.0)
        here = self._computed(values, motion.states, inputs)
        slopes = here.by_theta[:, n:] - (here.by_input[:, n:] * rates.T[:, None]) @ late.slopes
        return here.values[:, n:].T, slopes.swapaxes(0, 1)

    def _computed(self, values: Array, states: Array, inputs: Array) -> _StateValues:
        n, m = states.shape[0], inputs.shape[0]
        free = self.model.parameters.free_indices
        still = np.zeros((states.shape[1], n))
        rest = np.hstack([states.T, inputs.T])
        directions = [*range(n), *range(2 * n, 2 * n + m), *(2 * n + m + k for k in free)]
        sample, rows = self._sampled, np.hstack([still, rest])
        if _is_explicit(self.model):
            factors = sample(values, rows[:1], directions[:n])[1][0, :n]
            turned = -solved_rates(factors, np.eye(n))
            found, slopes = sample(values, rows, directions[n:])
            moving, rates = found[:, :n] @ turned.T, _turned(turned, slopes[:, :n])
            outputs = slopes[:, n:]
        else:
            found, slopes = sample(values, rows, directions[:n])
            moving = -_solve(slopes[:, :n, :n], found[:, :n, None])[:, :, 0]
            found, slopes = sample(values, np.hstack([moving, rest]), directions)
            _require_affine(found[:, :n], slopes[:, :n, :n], moving)
            rates = -_solve(slopes[:, :n, :n], slopes[:, :n, n:])
            outputs = slopes[:, n:, n:] + slopes[:, n:, :n] @ rates
        whole = np.concatenate([rates, outputs], axis=1)
        return _StateValues(np.hstack([moving, found[:, n:]]), whole[:, :, :m], whole[:, :, m:])

    def _sampled(
        self, values: Array, points: Array, directions: Sequence[int]
    ) -> tuple[Array, Array]:
        """Equations, then outputs that are no states, at points (ẋ, x, u), and their derivatives.

        Of linear equations from those at a few points.
        """
        sample, (count, width) = self.model.native.sample, points.shape
        n = len(self.model.states)
        rows = [*range(n), *(n + place for place in self.reconstruction.others)]
        if count <= width + 1 or not self.model.is_linear:
            found, slopes = sample(values, points, directions)
            return found[:, rows], slopes[:, rows]
        # Both are affine: known at the origin and, for their digits, as far out as points lie.
        reach = np.max(np.abs(points), axis=0)
        reach = np.where((reach > 0.0) & np.isfinite(reach), reach, 1.0)
        found, slopes = sample(values, np.vstack([np.zeros(width), np.diag(reach)]), directions)
        found, slopes = found[:, rows], slopes[:, rows].reshape(width + 1, -1)
        places = points / reach
        moved = places @ (slopes[1:] - slopes[0])
        moved += slopes[0]
        values_there = found[0] + places @ (found[1:] - found[0])
        return values_there, moved.reshape(count, len(rows), len(directions))


def _is_explicit(model: StateSpaceModel) -> bool:
    """Whether each equation gives a derivative that stands nowhere else: slopes know no motion."""
    named = [*model.definitions.values(), *model.measurements.values()]
    formulas = [*model.equations.values(), *(each.expression for each in named)]
    derivatives = {f"{state}'" for state in model.states}
    return set(model.equations) == derivatives and not any("'" in each for each in formulas)


def curve(states: Array, place: float) -> Array:
    """States at a place in every sample interval, 0 to 1, by the cubic through four samples.

    Example
    -------
    >>> curve(np.arange(6.0)[None] ** 3, 0.5).tolist()
    [[0.125, 3.375, 15.625, 42.875, 91.125]]
    """
    count = states.shape[1]
    found = np.empty((states.shape[0], count - 1))
    for first, cells, at in (
        (0, slice(0, 1), place),
        (0, slice(1, count - 2), place + 1.0),
        (count - 4, slice(count - 2, count - 1), place + 2.0),
    ):
        wide = cells.stop - cells.start
        weights = lagrange(at, 4)[0]
        found[:, cells] = sum(
            weights[k] * states[:, first + k : first + k + wide] for k in range(4)
        )
    return found


@dataclass(frozen=True)
class Bends:
    """What corners of the inputs do to the states between samples, beyond the cubics.

    Attributes
    ----------
    late : DelayedInputs
    jumps : ndarray, shape (n_inputs, n_states, n_samples)
        Of ẋ at a step, or of ẍ where a straight line turns.
    """

    late: DelayedInputs
    jumps: Array

    @classmethod
    def of(cls, late: DelayedInputs, by_input: Array) -> Bends:
        """From derivatives of ẋ by the inputs, (n_samples or 1, n_states, n_inputs)."""
        _, changes = late.changes()
        return cls(late, by_input.transpose(2, 1, 0) * changes[:, None])

    def at(self, place: float) -> Array:
        """Added to the curve at a place in every interval, (n_states, n_samples − 1), kept."""
        if place not in self._known:
            self._known[place] = self._made(place)
            self._known[place].flags.writeable = False
        return self._known[place]

    @cached_property
    def _known(self) -> dict[float, Array]:
        return {}

    def _made(self, place: float) -> Array:
        n_states, count = self.jumps.shape[1:]
        found = np.zeros((n_states, count - 1))
        if self.late.hold == "band_limited":
            return found
        weights = lagrange(place + 1.0, 4)[0]
        for corner, jumps in zip(self.late.changes()[0], self.jumps, strict=True):
            for beside in (-1, 0, 1):
                bent = self._bent(np.array([place, *_NEAR]) - corner - beside)
                missed = bent[0] - weights @ bent[1:]
                # The first and the last interval have no neighbours on one side: left as they are.
                found[:, 1:-1] += missed * jumps[:, 1 + beside : count - 2 + beside]
        return found

    def _bent(self, since: Array) -> Array:
        """Motion since a corner of unit size, by times in samples."""
        after = np.maximum(since, 0.0) * self.late.sample_time_s
        return after if self.late.hold == "zero" else 0.5 * after**2


def _solve(matrix: Array, right: Array) -> Array:
    """M⁻¹ of each sample times its right side; one factorisation where M never changes."""
    if np.array_equal(matrix, np.broadcast_to(matrix[:1], matrix.shape)):
        return np.asarray(solved_rates(matrix[0], np.eye(len(matrix[0]))) @ right)
    return solved_rates(matrix, right)


def _turned(factor: Array, right: Array) -> Array:
    """One factor, which mostly is one or minus one, times the right side of each sample."""
    diagonal = np.diagonal(factor)
    if np.array_equal(factor, np.diag(diagonal)):
        return np.asarray(right * diagonal[:, None])
    return np.asarray(factor @ right)


def _require_affine(residuals: Array, factors: Array, moving: Array) -> None:
    size = (np.abs(factors) @ np.abs(moving)[:, :, None])[:, :, 0]
    worst = float(np.max(np.abs(residuals) - 1e-6 * size, initial=0.0))
    if worst > 1e-9 * (1.0 + float(size.max(initial=0.0))):
        raise ModelError(
            "state derivatives enter an equation other than linearly",
            found=f"a remainder of {worst:.3g}",
            needed="equations linear in the state derivatives",
        )
