"""Least squares on the equations of motion of several records: residuals, slopes, weights."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from flightid.errors import FitError
from flightid.frozen import dataclass
from flightid.identification.regression.equation_operators import FourierRows, Operator
from flightid.identification.regression.right_side import Bends, RightSide
from flightid.identification.regression.rounds import Rows
from flightid.identification.regression.sampled_equations import StateMeasurements

Array = NDArray[np.float64]
ROUNDING = 1e-10
"""Share of a slope's length below which what constants leave of it is rounding."""


@dataclass(frozen=True)
class EquationRegression:
    """Equations of motion of all records.

    Attributes
    ----------
    right : RightSide
    motions : tuple of StateMeasurements
    operators : tuple of Operator
    bends : tuple of Bends
        What corners of the inputs do to the states between samples, by record.
    used : ndarray of int
        Equations that hold a free parameter.
    """

    right: RightSide
    motions: tuple[StateMeasurements, ...]
    operators: tuple[Operator, ...]
    bends: tuple[Bends, ...]
    used: NDArray[np.intp]

    @classmethod
    def of(
        cls,
        right: RightSide,
        motions: Sequence[StateMeasurements],
        operators: Sequence[Operator],
        start: Array,
    ) -> EquationRegression:
        """Find the equations that a free parameter moves.

        Raises
        ------
        FitError
            There is none.
        """
        bends = tuple(right.bends(start, motion) for motion in motions)
        pairs = zip(motions, bends, strict=True)
        sides = [right.at(start, motion, bent) for motion, bent in pairs]
        slopes = [part for each in sides for part in (each.rate_slopes, each.other_slopes)]
        moves = [np.any(part != 0.0, axis=(1, 2)) for part in slopes]
        moved = np.concatenate([np.any(moves[::2], axis=0), np.any(moves[1::2], axis=0)])
        if not np.any(moved):
            raise FitError(
                "no equation holds a free parameter",
                needed="at least one",
                action="free a parameter, or start it away from zero",
            )
        return cls(right, tuple(motions), tuple(operators), bends, np.flatnonzero(moved))

    def renewed(self, theta: Array) -> EquationRegression:
        """The same with the bends that these parameters make."""
        bends = tuple(self.right.bends(theta, motion) for motion in self.motions)
        return replace(self, bends=bends)

    @property
    def n_states(self) -> int:
        """Number of state equations, used or not."""
        return len(self.right.model.states)

    def names(self) -> tuple[str, ...]:
        """Name of each used equation: a state with a prime, or an output."""
        model = self.right.model
        every = [f"{state}'" for state in model.states]
        every += [model.outputs[place] for place in self.right.reconstruction.others]
        return tuple(every[place] for place in self.used)

    def left(self, place: int) -> Array:
        """What is measured of the used equations of one record."""
        return self._lefts[place]

    @cached_property
    def _lefts(self) -> tuple[Array, ...]:
        sides = (
            [operator.derivative(motion.states), operator.values(motion.others)]
            for motion, operator in zip(self.motions, self.operators, strict=True)
        )
        return tuple(np.concatenate(both, axis=0)[self.used] for both in sides)

    def rows(self, theta: Array, weights: Sequence[Array]) -> list[Rows]:
        """Residuals and slopes, the unknown constants taken out under these weights."""
        found = []
        for place, (motion, operator) in enumerate(zip(self.motions, self.operators, strict=True)):
            sides = self.right.at(theta, motion, self.bends[place])
            values = [operator.means(sides.rates), operator.values(sides.others)]
            residuals = self.left(place) - np.concatenate(values)[self.used]
            slopes = [
                operator.means(np.moveaxis(sides.rate_slopes, 2, 1)),
                operator.values(np.moveaxis(sides.other_slopes, 2, 1)),
            ]
            moved = -np.concatenate(slopes)[self.used]
            own = np.zeros((*residuals.shape, len(residuals)))
            rows = Rows(residuals, np.moveaxis(moved, 1, 2).copy(), own)
            if isinstance(operator, FourierRows):
                # Constants have no harmonic; what rounding leaves of them is no slope.
                still = [_constant(each) for each in (sides.rate_slopes, sides.other_slopes)]
                rows.slopes[:] *= ~np.concatenate(still)[self.used][:, None, :]
            found.append(self._without_constants(rows, operator, weights[place]))
        return found

    def _without_constants(self, rows: Rows, operator: Operator, weights: Array) -> Rows:
        for row, equation in enumerate(self.used):
            direction = operator.nuisance(is_state=bool(equation < self.n_states))
            if direction is None:
                continue
            weighed = direction * weights[row] ** 2
            weighed /= weighed @ direction
            along = direction * weights[row]
            rows.own[row, :, row] = along / np.linalg.norm(along)
            rows.residuals[row] -= direction * (weighed @ rows.residuals[row])
            before = np.linalg.norm(rows.slopes[row], axis=0)
            rows.slopes[row] -= np.multiply.outer(direction, weighed @ rows.slopes[row])
            # A parameter that is a constant of its equation leaves rounding, which is no slope.
            left = np.linalg.norm(rows.slopes[row], axis=0)
            rows.slopes[row][:, left <= ROUNDING * before] = 0.0
        return rows

    def reach(self) -> Array:
        """Root mean square of each equation's left side over all records."""
        lefts = [self.left(place) for place in range(len(self.motions))]
        power = np.sum([np.sum(left**2, axis=1) for left in lefts], axis=0)
        count = sum(left.shape[1] for left in lefts)
        size = np.sqrt(power / count)
        if np.any(size == 0.0):
            still = [name for name, each in zip(self.names(), size, strict=True) if each == 0.0]
            raise FitError(
                "an equation does not move in any record",
                found=", ".join(still),
                needed="motion of every state whose equation is fitted",
                action="fix the parameters of that equation, or add records that excite it",
            )
        return np.asarray(size)


def _constant(slopes: Array) -> NDArray[np.bool_]:
    """Where slopes (n_equations, n_samples, n_free) stay the same over a record."""
    if not slopes.size:
        return np.zeros((slopes.shape[0], slopes.shape[2]), dtype=bool)
    return np.asarray(np.ptp(slopes, axis=1) <= ROUNDING * np.abs(slopes).max(axis=1))
