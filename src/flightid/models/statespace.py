"""State-space models as equations with units (native: `model_tape.rs`, `state_space_fit.rs`).

M ẋ = F x + G u(t − τ), y = H₁ ẋ + H₀ x + D u(t − τ). The equations may have factors on the left
and need not be linear: the matrices are then those of the linearisation at the trim point.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from flightid import _native
from flightid.errors import DataError, ModelError, SingularError, UnknownNameError
from flightid.models import statespace_description
from flightid.models.adjustable import Adjustable
from flightid.models.parameters import Parameters
from flightid.models.realisation import Matrices, one_delay_for_each_input
from flightid.models.statespace_checks import check_model, point_names
from flightid.models.statespace_display import MatrixDisplay, matrices_as_latex
from flightid.models.statespace_parts import (
    Output,
    ResponsePair,
    StateSpaceMatrices,
    pair_places,
)
from flightid.table import Table
from flightid.units import canonical

SCHEMA = "flightid.state_space_model/1"
Array = NDArray[np.float64]


@dataclass(frozen=True, repr=False)
class StateSpaceModel(Adjustable):
    """Equations of motion with named, bounded, tied parameters.

    Attributes
    ----------
    states, input_units : mapping of str to str
        Unit by name.
    measurements : mapping of str to Output
        Outputs: formula and unit by name; a formula may hold state derivatives such as ``v'``.
    equations : mapping of str to str
        Right side by left side, one for each state: ``{"tau_f*b'": "-b - tau_f*p"}``.
    parameters : Parameters
        Every other name in the formulas.
    delays : mapping of str to str
        Formula of the delay by input, s; an input left out has none.
    trim : mapping of str to float
        Point of linearisation: states, inputs and state derivatives; those left out are zero.
    pairs : tuple of str
        Names ``"output/input"`` of the responses that a fit uses; all pairs when left out.
    name, source, note : str
        What it is, where it comes from, what to know.

    Raises
    ------
    ModelError
        A formula outside the grammar, a name that is not defined or defined twice, units that
        clash (the message names the equation and both units), or not one equation for each state.

    Assumes
    -------
    Delays act on inputs. A nonlinear model is seen through its linearisation at the trim point:
    biased where the flight leaves the neighbourhood of that point.

    Reference
    ---------
    Tischler & Remple, *Aircraft and Rotorcraft System Identification*, 2nd ed., eqs. 12.1 to 12.5.

    Example
    -------
    >>> from flightid.models import Parameter, Parameters
    >>> roll = StateSpaceModel(
    ...     states={"phi": "rad", "p": "rad/s"}, input_units={"lat": "1"},
    ...     measurements={"p": Output("p", "rad/s")},
    ...     equations={"phi'": "p", "p'": "Lp*p + Llat*lat"},
    ...     parameters=Parameters(
    ...         [Parameter("Lp", -4.0, "1/s"), Parameter("Llat", 20.0, "rad/s^2")]),
    ...     name="roll")
    >>> roll
    StateSpaceModel('roll', 2 states, 1 input, 1 output, 2 parameters, 2 free)
    >>> roll.eigenvalues()
    array([-4.+0.j,  0.+0.j])
    """

    states: Mapping[str, str]
    input_units: Mapping[str, str]
    measurements: Mapping[str, Output]
    equations: Mapping[str, str]
    parameters: Parameters
    delays: Mapping[str, str] = field(default_factory=dict)
    trim: Mapping[str, float] = field(default_factory=dict)
    pairs: tuple[str, ...] = ()
    name: str = "state space"
    source: str = ""
    note: str = ""
    native: _native.StateSpace = field(init=False, compare=False)

    def __post_init__(self) -> None:
        for kind in ("states", "input_units"):
            listed = {name: canonical(unit) for name, unit in getattr(self, kind).items()}
            object.__setattr__(self, kind, listed)
        for kind in ("measurements", "equations", "trim"):
            object.__setattr__(self, kind, dict(getattr(self, kind)))
        stray = set(self.delays) - set(self.inputs)
        if stray:
            raise ModelError("a delay has no input", found=", ".join(sorted(stray)))
        delays = {name: self.delays.get(name, "0") for name in self.inputs}
        object.__setattr__(self, "delays", delays)
        check_model(self)
        object.__setattr__(self, "pairs", tuple(self.pairs) or self._every_pair)
        object.__setattr__(self, "native", self._compiled(self.pairs))

    def _compiled(self, pairs: tuple[str, ...]) -> _native.StateSpace:
        return _native.StateSpace(
            list(self.states),
            self.inputs,
            list(self.equations.items()),
            [output.expression for output in self.measurements.values()],
            list(self.delays.values()),
            [parameter.name for parameter in self.parameters.independent],
            self.parameters.definitions,
            pair_places(pairs, self.outputs, self.inputs),
            list(self._point(None)),
        )

    @property
    def inputs(self) -> tuple[str, ...]:
        """Names of the inputs."""
        return tuple(self.input_units)

    @property
    def outputs(self) -> tuple[str, ...]:
        """Names of the outputs."""
        return tuple(self.measurements)

    @property
    def units(self) -> dict[str, str]:
        """Unit by channel name: inputs and outputs."""
        measured = {name: output.unit for name, output in self.measurements.items()}
        return {**self.input_units, **measured}

    @property
    def _every_pair(self) -> tuple[str, ...]:
        return tuple(f"{output}/{source}" for output in self.outputs for source in self.inputs)

    @property
    def responses(self) -> tuple[ResponsePair, ...]:
        """Pairs of output and input that a fit uses."""
        return tuple(ResponsePair(*pair.split("/")) for pair in self.pairs)

    @property
    def response_names(self) -> tuple[str, ...]:
        """``"output/input"`` of each response that a fit uses."""
        return self.pairs

    def with_responses(self, *names: str) -> StateSpaceModel:
        """Copy of which a fit uses these responses alone, by ``"output/input"``.

        Raises
        ------
        ModelError
            There is no such pair.
        """
        return replace(self, pairs=names)

    def linearise(self, at: Mapping[str, float]) -> StateSpaceModel:
        """Copy whose matrices are those at another point.

        Parameters
        ----------
        at : mapping of str to float
            States, inputs and state derivatives that differ from the present trim, in their units.

        Raises
        ------
        UnknownNameError
            There is no such state, input or state derivative.
        """
        return replace(self, trim={**self.trim, **at})

    def _point(self, at: Mapping[str, float] | None) -> Array:
        names = point_names(self)
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

        Returns
        -------
        StateSpaceMatrices

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
        try:
            forced = np.hstack([found.f, found.g])
            rates: Array = np.asarray(np.linalg.solve(found.m, forced), dtype=np.float64)
        except np.linalg.LinAlgError as error:
            raise SingularError(
                "the equations do not give every state derivative",
                found="a singular matrix M of their factors",
                needed="one independent equation for each state derivative",
            ) from error
        a, b = rates[:, : len(rates)], rates[:, len(rates) :]
        columns = range(len(self.inputs))
        delays = one_delay_for_each_input(columns, list(found.delays_s), list(self.inputs))
        return a, b, found.h0 + found.h1 @ a, found.d + found.h1 @ b, delays

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

    @property
    def is_linear(self) -> bool:
        """Whether the matrices are the same at every point."""
        return self.displayed().is_linear

    def displayed(self) -> MatrixDisplay:
        """M, F, G, H1, H0 and D as printed formulas."""
        return matrices_as_latex(self)

    def latex(self) -> str:
        """M ẋ = F x + G u with the symbolic matrices, as LaTeX."""
        return self.displayed().latex()

    def __repr__(self) -> str:
        """Name and size on one line."""
        return statespace_description.one_line(self)

    def __str__(self) -> str:
        """Equations and outputs, one a line."""
        return "\n".join(statespace_description.lines(self))

    def summary(self) -> Table:
        """Table of the parameters, with the equations below.

        Returns
        -------
        Table
        """
        table = self.parameters.summary().without_empty_columns()
        notes = (*statespace_description.lines(self), *filter(None, [self.source, self.note]))
        return Table(self.name, table.columns, table.rows, notes)

    def to_dict(self) -> dict[str, object]:
        """Plain values with a ``schema`` key; `from_dict` reads them."""
        return {"schema": SCHEMA, **statespace_description.to_plain(self)}

    @classmethod
    def from_dict(cls, content: Mapping[str, object]) -> StateSpaceModel:
        """Build a model from plain values such as a TOML file gives.

        Parameters
        ----------
        content : mapping
            Keys ``states``, ``inputs``, ``outputs``, ``parameters``, ``equations`` and, as needed,
            ``constants``, ``constraints``, ``delays``, ``trim``, ``responses``, ``name``,
            ``source``, ``note``. Formulas may be SymPy objects.

        Raises
        ------
        ModelError
            A key is missing, unknown or of the wrong type, or the model contradicts itself.
        """
        return cls(**statespace_description.from_plain(content))

    def _repr_html_(self) -> str:
        return self.displayed().html() + self.summary()._repr_html_()
