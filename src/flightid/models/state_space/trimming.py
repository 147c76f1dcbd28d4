"""Equilibria of a state-space model, by Newton's method with the exact Jacobian."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from flightid import _native
from flightid.errors import FitError, FlightidError, UnknownNameError
from flightid.frozen import dataclass
from flightid.models.state_space.linear import Linearisation

MAXIMUM_ITERATIONS = 100
_HALVINGS = 30
_TOLERANCE = 1e-11
Array = NDArray[np.float64]


def find_trim(
    model: Linearisation,
    at: Mapping[str, float],
    solve_for: Sequence[str] | None,
    require: Sequence[str],
) -> dict[str, float]:
    """Point at which every equation holds.

    Parameters
    ----------
    model : Linearisation
    at : mapping of str to float
        States, inputs and state derivatives that are held, instead of the model's trim.
    solve_for : sequence of str, optional
        What is found; all states that are not in `at` when left out.
    require : sequence of str
        Formulas that shall be zero too.

    Returns
    -------
    dict of str to float
        Every state, input and state derivative that is not zero.

    Raises
    ------
    UnknownNameError
        There is no such state or input.
    ModelError
        A formula of `require` is outside the grammar or names what is not defined.
    FitError
        No equilibrium was found from this start, or more than one is near.
    """
    names = list(model.point_names)
    wanted = list(solve_for) if solve_for is not None else [x for x in model.states if x not in at]
    for name in (*wanted, *at):
        if name not in names:
            raise UnknownNameError(
                "a trim names what is neither state nor input",
                found=repr(name),
                needed=f"one of {', '.join(names)}",
            )
    point = {**model.trim, **at}
    z = np.array([float(point.get(name, 0.0)) for name in names])
    search = _Search(model, [names.index(name) for name in wanted], tuple(require))
    z = search.solve(z)
    return {name: float(value) for name, value in zip(names, z, strict=True) if value != 0.0}


@dataclass(frozen=True)
class _State:
    """Residuals at a point, their derivatives, and the size of their terms."""

    z: Array
    residuals: Array
    slopes: Array

    @property
    def holds(self) -> bool:
        # What a residual may keep of rounding: a part of the size of its first-order terms, and
        # what a least-squares step spills over from the largest unknown.
        steep = np.abs(self.slopes)
        size = steep @ np.abs(self.z)
        spilt = 1e-3 * steep.max(axis=1, initial=0.0) * np.abs(self.z).max(initial=0.0)
        return bool(np.all(np.abs(self.residuals) <= _TOLERANCE * np.maximum(size, spilt)))


class _Search:
    def __init__(self, model: Linearisation, places: list[int], require: tuple[str, ...]) -> None:
        self._model, self._places, self._require = model, places, require
        names = [parameter.name for parameter in model.parameters.independent]
        auxiliary = {name: output.expression for name, output in model.definitions.items()}
        self._extra = _native.Tape(
            list(require),
            [*model.point_names, *names],
            {**model.parameters.definitions, **auxiliary},
            {name: table.native for name, table in model.tables.items()},
        )

    def _at(self, z: Array) -> _State:
        n, parameters = len(self._model.states), self._model.parameters.independent_values()
        values, slopes = self._model.native.linearise(parameters, z)
        joined = np.concatenate([z, parameters])
        extra = self._extra.evaluate(joined)
        extra_slopes = self._extra.jacobian(joined, list(range(len(z))))
        return _State(z, np.concatenate([values[:n], extra]), np.vstack([slopes[:n], extra_slopes]))

    def solve(self, z: Array) -> Array:
        try:
            state = self._at(z)
        except FlightidError as error:
            raise self._none("equations without a value at the start") from error
        weight = np.maximum(np.abs(state.slopes).max(axis=1, initial=0.0), 1e-300)
        for _ in range(MAXIMUM_ITERATIONS):
            if state.holds:
                return state.z
            step = self._step(state, weight)
            moved = self._shortened(state, step, weight)
            if moved is None:
                break
            state = moved
        sides = [*self._model.equations, *self._require]
        worst = int(np.argmax(np.abs(state.residuals) / weight))
        raise self._none(f"{sides[worst]!r} left with {state.residuals[worst]:.3g}")

    def _step(self, state: _State, weight: Array) -> Array:
        """Newton's step; what no equation holds, such as a heading, stays where it is."""
        jacobian = state.slopes[:, self._places] / weight[:, None]
        scale = np.abs(jacobian).max(axis=0, initial=0.0)
        known = scale > 0.0
        step = np.zeros(len(self._places))
        if not known.any():
            return step
        found, _, rank, _ = np.linalg.lstsq(
            jacobian[:, known] / scale[known], -state.residuals / weight, rcond=1e-12
        )
        if rank < known.sum():
            names = [self._model.point_names[place] for place in self._places]
            raise FitError(
                f"the trim of {self._model.name} is not determined",
                found=f"{rank} independent equations for {', '.join(names)}",
                needed="one for each state or input that is solved for",
                action="hold one with `at`, or give a formula that shall be zero to `require`",
            )
        step[known] = found / scale[known]
        return step

    def _shortened(self, state: _State, step: Array, weight: Array) -> _State | None:
        """The first of ever shorter steps that brings the residuals down; None where none does."""
        before = float(np.linalg.norm(state.residuals / weight))
        for halving in range(_HALVINGS):
            z = state.z.copy()
            z[self._places] += step * 0.5**halving
            try:
                found = self._at(z)
            except FlightidError:
                continue
            if found.holds or float(np.linalg.norm(found.residuals / weight)) < before:
                return found
        return None

    def _none(self, found: str) -> FitError:
        return FitError(
            f"no equilibrium of {self._model.name} was found",
            found=found,
            needed="values of states and inputs at which every equation holds",
            action="start nearer with `at`, hold fewer values, or add an input to `solve_for`",
        )
