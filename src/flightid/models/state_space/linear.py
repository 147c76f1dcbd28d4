"""A state-space model as numbers: matrices, their derivatives, eigenvalues, responses."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from flightid import _native
from flightid.errors import DataError, SingularError, UnknownNameError
from flightid.models.adjustable import Adjustable
from flightid.models.language.blocks import ModelBlock
from flightid.models.language.record_values import RecordValue
from flightid.models.language.tables import TableFunction
from flightid.models.linear.linear_system import LinearSystem
from flightid.models.linear.realisation import Matrices, one_delay_for_each_input
from flightid.models.state_space.parts import (
    Output,
    StateSpaceMatrices,
    derivative,
    pair_places,
)

Array = NDArray[np.float64]


def solved_rates(m: Array, right: Array) -> Array:
    """State derivatives of M ẋ = right.

    Raises
    ------
    SingularError
        M is singular.
    """
    try:
        return np.asarray(np.linalg.solve(m, right), dtype=np.float64)
    except np.linalg.LinAlgError as error:
        raise SingularError(
            "the equations do not give every state derivative",
            found="a singular matrix M of their factors",
            needed="one independent equation for each state derivative",
        ) from error


class Linearisation(Adjustable):
    """What follows from the linearisation of a state-space model; its base."""

    states: Mapping[str, str]
    input_units: Mapping[str, str]
    measurements: Mapping[str, Output]
    equations: Mapping[str, str]
    delays: Mapping[str, str]
    trim: Mapping[str, float]
    pairs: tuple[str, ...]
    definitions: Mapping[str, Output]
    tables: Mapping[str, TableFunction]
    initial: Mapping[str, RecordValue]
    biases: Mapping[str, RecordValue]
    blocks: tuple[ModelBlock, ...]
    bare: Linearisation | None
    source: str
    note: str
    native: _native.StateSpace

    if TYPE_CHECKING:

        @property
        def name(self) -> str: ...  # noqa: D102 - the model documents it

        @property
        def units(self) -> dict[str, str]: ...  # noqa: D102 - the model documents it

    @property
    def inputs(self) -> tuple[str, ...]:
        """Names of the inputs."""
        return tuple(self.input_units)

    @property
    def outputs(self) -> tuple[str, ...]:
        """Names of the outputs."""
        return tuple(self.measurements)

    @property
    def point_names(self) -> tuple[str, ...]:
        """Names of a point of linearisation: state derivatives, states, inputs."""
        return (*map(derivative, self.states), *self.states, *self.inputs)

    @property
    def _every_pair(self) -> tuple[str, ...]:
        return tuple(f"{output}/{source}" for output in self.outputs for source in self.inputs)

    def _compiled(self, pairs: tuple[str, ...]) -> _native.StateSpace:
        auxiliary = {name: output.expression for name, output in self.definitions.items()}
        return _native.StateSpace(
            list(self.states),
            self.inputs,
            list(self.equations.items()),
            [output.expression for output in self.measurements.values()],
            list(self.delays.values()),
            [parameter.name for parameter in self.parameters.independent],
            {**self.parameters.definitions, **auxiliary},
            pair_places(pairs, self.outputs, self.inputs),
            list(self._point(None)),
            {name: table.native for name, table in self.tables.items()},
        )

    def _point(self, at: Mapping[str, float] | None) -> Array:
        names = self.point_names
        given = {**self.trim, **(at or {})}
        for name in given:
            if name not in names:
                raise UnknownNameError(
                    "a point of linearisation has an unknown name",
                    found=repr(name),
                    needed=f"one of {', '.join(names)}",
                )
        return np.array([float(given.get(name, 0.0)) for name in names])

    def _slopes(
        self, values: Mapping[str, float] | None, at: Mapping[str, float] | None
    ) -> tuple[Array, Array]:
        return self.native.linearise(self.parameters.independent_values(values), self._point(at))

    def matrices(
        self, values: Mapping[str, float] | None = None, at: Mapping[str, float] | None = None
    ) -> StateSpaceMatrices:
        """M, F, G, H0, H1, D and the delays as numbers, exact.

        Parameters
        ----------
        values : mapping of str to float, optional
            Parameter values instead of the model's.
        at : mapping of str to float, optional
            Point instead of the trim; a linear model has the same matrices everywhere.

        Raises
        ------
        UnknownNameError
            There is no such parameter, state or input.
        DataError
            An equation or output has no derivative at this point.
        """
        found, slopes = self._slopes(values, at)
        return StateSpaceMatrices.split(slopes, found, len(self.states), len(self.outputs))

    def matrix_derivatives(
        self, values: Mapping[str, float] | None = None, at: Mapping[str, float] | None = None
    ) -> dict[str, StateSpaceMatrices]:
        """Exact derivatives of the matrices by each free parameter.

        Returns
        -------
        dict of str to StateSpaceMatrices
            By parameter; through ties too. The delays' part is theirs in s per parameter unit.
        """
        numbers, point = self.parameters.independent_values(values), self._point(at)
        places = self.parameters.free_indices
        found = self.native.sensitivities(numbers, point, places)
        late = self.parameters.tape(self.delays.values()).jacobian(numbers, places)
        n, p = len(self.states), len(self.outputs)
        return {
            parameter.name: StateSpaceMatrices.split(slopes, late[:, k], n, p)
            for k, (parameter, slopes) in enumerate(zip(self.parameters.free, found, strict=True))
        }

    def matrix_second_derivatives(
        self, values: Mapping[str, float] | None = None, at: Mapping[str, float] | None = None
    ) -> dict[tuple[str, str], StateSpaceMatrices]:
        """Exact second derivatives of the matrices by pairs of free parameters.

        Returns
        -------
        dict of (str, str) to StateSpaceMatrices
            By pair, in the order of the parameters; a pair left out has none. The delays' part is
            theirs.
        """
        numbers, point = self.parameters.independent_values(values), self._point(at)
        places, found = self.native.curvatures(numbers, point, self.parameters.free_indices)
        n, p = len(self.states), len(self.outputs)
        free = [parameter.name for parameter in self.parameters.free]
        slopes: dict[tuple[str, str], tuple[Array, Array]] = {}
        for (row, column, first, second), value in zip(places, found, strict=True):
            empty = np.zeros((n + p, len(point))), np.zeros(len(self.inputs))
            entries, late = slopes.setdefault((free[first], free[second]), empty)
            if row < n + p:
                entries[row, column] = value
            else:
                late[row - n - p] = value
        order = [(a, b) for k, b in enumerate(free) for a in free[: k + 1] if (a, b) in slopes]
        return {pair: StateSpaceMatrices.split(*slopes[pair], n, p) for pair in order}

    def residuals(
        self, values: Mapping[str, float] | None = None, at: Mapping[str, float] | None = None
    ) -> dict[str, float]:
        """Left minus right side of each equation at a point: all zero where it is a trim.

        Returns
        -------
        dict of str to float
            By left side.
        """
        found, _ = self._slopes(values, at)
        return dict(zip(self.equations, map(float, found), strict=False))

    def state_space(
        self, values: Mapping[str, float] | None = None, at: Mapping[str, float] | None = None
    ) -> Matrices:
        """A, B, C, D and the delay of each input, for simulation.

        Returns
        -------
        tuple of ndarray
            A = M⁻¹F (n, n), B = M⁻¹G (n, n_inputs), C = H0 + H1 A (n_outputs, n),
            D + H1 B (n_outputs, n_inputs) and the delays (n_inputs,), s.

        Raises
        ------
        SingularError
            The equations do not give every state derivative (M is singular).
        ModelError
            A negative delay.
        """
        found = self.matrices(values, at)
        rates = solved_rates(found.m, np.hstack([found.f, found.g]))
        a, b = rates[:, : len(rates)], rates[:, len(rates) :]
        columns = range(len(self.inputs))
        delays = one_delay_for_each_input(columns, list(found.delays_s), list(self.inputs))
        return a, b, found.h0 + found.h1 @ a, found.d + found.h1 @ b, delays

    def constants(self) -> tuple[Array, Array]:
        """Constant terms of ẋ and of the outputs, such as M0: zero about a declared trim.

        Returns
        -------
        tuple of ndarray
            Shapes (n_states,) and (n_outputs,). A model with a trim holds departures from it.
        """
        n, p = len(self.states), len(self.outputs)
        if any(self.trim.values()):
            return np.zeros(n), np.zeros(p)
        found, slopes = self._slopes(None, None)
        rates = np.asarray(-np.linalg.solve(slopes[:n, :n], found[:n]), dtype=np.float64)
        return rates, found[n : n + p] + slopes[n : n + p, :n] @ rates

    @property
    def sample_time_s(self) -> None:
        """None: continuous time."""
        return None

    def linear_system(self) -> LinearSystem:
        """The linear system at the trim, with the delays of the inputs.

        Raises
        ------
        SingularError
            The equations do not give every state derivative.
        ModelError
            A negative delay.
        """
        a, b, c, d, delays_s = self.state_space()
        units = {**self.units, **self.states}
        return LinearSystem(
            a, b, c, d, self.inputs, self.outputs, delays_s, tuple(self.states), None, units,
            self.name,
        )  # fmt: skip

    def eigenvalues(
        self, values: Mapping[str, float] | None = None, at: Mapping[str, float] | None = None
    ) -> NDArray[np.complex128]:
        """Eigenvalues of M⁻¹F, rad/s, by real part.

        Returns
        -------
        ndarray of complex, shape (n_states,)
        """
        found = np.linalg.eigvals(self.state_space(values, at)[0]).astype(np.complex128)
        order = np.lexsort((found.imag, found.real))
        return np.asarray(found[order], dtype=np.complex128)

    def frequency_response(
        self, omega_rad_s: ArrayLike, values: Mapping[str, float] | None = None
    ) -> NDArray[np.complex128]:
        """H(jω) = {[H0 + jω H1] [jωM − F]⁻¹ G + D} e^(−jωτ) of all pairs.

        Parameters
        ----------
        omega_rad_s : array_like, shape (n_freqs,)
            Frequencies, rad/s.
        values : mapping of str to float, optional
            Parameter values instead of the model's.

        Returns
        -------
        ndarray of complex, shape (n_outputs, n_inputs, n_freqs)
            In output unit over input unit.

        Raises
        ------
        DataError
            A frequency is a pole of the model, for example an integrator at ω = 0.
        """
        omega = np.ascontiguousarray(np.atleast_1d(omega_rad_s), dtype=np.float64)
        every = self._every_pair
        native = self.native if self.pairs == every else self._compiled(every)
        try:
            found = native.response(self.parameters.independent_values(values), omega)
        except SingularError as error:
            raise DataError(
                "the model has no finite response at these frequencies",
                found=f"{omega.min():g} to {omega.max():g} rad/s",
                needed="frequencies that are not poles of the model",
            ) from error
        return found.reshape(len(self.outputs), len(self.inputs), len(omega))
