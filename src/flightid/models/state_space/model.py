"""State-space models as equations with units (native: `model_tape.rs`, `state_space_response.rs`).

M ẋ = F x + G u(t − τ), y = H₁ ẋ + H₀ x + D u(t − τ). The equations may have factors on the left
and need not be linear: the matrices are then those of the linearisation at the trim point.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import field, replace

from flightid import _native
from flightid.errors import ModelError, UnknownNameError
from flightid.frozen import dataclass
from flightid.models.estimated import EstimateProvenance
from flightid.models.language.blocks import ModelBlock
from flightid.models.language.record_values import RecordValue
from flightid.models.language.tables import TableFunction
from flightid.models.parameters import Parameters
from flightid.models.state_space import description
from flightid.models.state_space.block_equations import split_own, written_out
from flightid.models.state_space.checks import check_model
from flightid.models.state_space.display import MatrixDisplay, matrices_as_latex
from flightid.models.state_space.linear import Linearisation
from flightid.models.state_space.parts import Output, ResponsePair
from flightid.models.state_space.trimming import find_trim
from flightid.result import TableView
from flightid.table import Table
from flightid.units import canonical

_COPIED = ("measurements", "equations", "trim", "definitions", "tables", "initial", "biases")
SCHEMA = "flightid.state_space_model/1"


@dataclass(frozen=True, repr=False)
class StateSpaceModel(Linearisation, TableView):
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
    definitions : mapping of str to Output
        Auxiliary quantities that formulas may name, such as the dynamic pressure.
    tables : mapping of str to TableFunction
        Tables that formulas may call.
    initial : mapping of str to RecordValue
        States whose initial values a fit to records frees in each record, or sets.
    biases : mapping of str to RecordValue
        Outputs with a bias, or inputs with a reference shift, in each record.
    blocks : tuple of ModelBlock
        Actuators, sensors and filters that are already written out in states and equations.
    bare : StateSpaceModel or None
        The model without its blocks.
    estimated : EstimateProvenance or None
        What a fit knew of the parameters, where the model comes from its file.

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
    definitions: Mapping[str, Output] = field(default_factory=dict)
    tables: Mapping[str, TableFunction] = field(default_factory=dict)
    initial: Mapping[str, RecordValue] = field(default_factory=dict)
    biases: Mapping[str, RecordValue] = field(default_factory=dict)
    blocks: tuple[ModelBlock, ...] = ()
    bare: StateSpaceModel | None = field(default=None, compare=False)
    estimated: EstimateProvenance | None = field(default=None, compare=False)
    native: _native.StateSpace = field(init=False, compare=False)

    def __post_init__(self) -> None:
        for kind in ("states", "input_units"):
            listed = {name: canonical(unit) for name, unit in getattr(self, kind).items()}
            object.__setattr__(self, kind, listed)
        for kind in _COPIED:
            object.__setattr__(self, kind, dict(getattr(self, kind)))
        stray = set(self.delays) - set(self.inputs)
        if stray:
            raise ModelError("a delay has no input", found=", ".join(sorted(stray)))
        delays = {name: self.delays.get(name, "0") for name in self.inputs}
        object.__setattr__(self, "delays", delays)
        check_model(self)
        object.__setattr__(self, "pairs", tuple(self.pairs) or self._every_pair)
        object.__setattr__(self, "native", self._compiled(self.pairs))

    @property
    def units(self) -> dict[str, str]:
        """Unit by channel name: inputs and outputs."""
        measured = {name: output.unit for name, output in self.measurements.items()}
        return {**self.input_units, **measured}

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

    def with_outputs(self, *names: str) -> StateSpaceModel:
        """Copy that measures these outputs alone; records then need no others.

        Raises
        ------
        UnknownNameError
            There is no such output.
        """
        for name in names:
            if name not in self.measurements:
                raise UnknownNameError(
                    "the model has no such output", found=name, needed=", ".join(self.measurements)
                )
        return replace(
            self,
            measurements={key: self.measurements[key] for key in self.outputs if key in names},
            pairs=tuple(pair for pair in self.pairs if pair.split("/")[0] in names),
            biases={k: v for k, v in self.biases.items() if k in names or k in self.inputs},
            bare=None if self.bare is None else self.bare.with_outputs(*names),
        )

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

    def trimmed(
        self,
        solve_for: Sequence[str] | None = None,
        at: Mapping[str, float] | None = None,
        require: Sequence[str] = (),
    ) -> StateSpaceModel:
        """Copy whose trim is an equilibrium: every equation holds there.

        Parameters
        ----------
        solve_for : sequence of str, optional
            States and inputs to find, starting at the present trim; all states that are not in
            `at` when left out. What no equation needs, such as a heading, stays as it is.
        at : mapping of str to float, optional
            States, inputs and state derivatives to hold; a derivative not named is held at the
            present trim's, zero as a rule.
        require : sequence of str, optional
            Formulas that shall be zero too, such as ``"theta - alpha"`` for level flight.

        Raises
        ------
        UnknownNameError
            There is no such state or input.
        FitError
            No equilibrium was found from this start, or nothing tells it from others near it.

        Reference
        ---------
        Stevens, Lewis & Johnson, *Aircraft Control and Simulation*, 3rd ed., sec. 3.6.

        Example
        -------
        >>> from flightid.models import load_model
        >>> aeroplane = load_model("fixed_wing_longitudinal_coefficients")
        >>> slower = aeroplane.trimmed(
        ...     ["alpha", "theta", "elevator", "thrust"], {"V": 45.0}, ["theta - alpha"])
        >>> {name: round(value, 3) for name, value in slower.trim.items()}
        {'V': 45.0, 'alpha': 0.039, 'theta': 0.039, 'elevator': -0.029, 'thrust': 1336.631}
        """
        return replace(self, trim=find_trim(self, at or {}, solve_for, require))

    def with_block(
        self, name: str, *, at: str, kind: str, note: str = "", **values: object
    ) -> StateSpaceModel:
        """Copy with an actuator at an input, or a sensor or filter at an output.

        It stands behind those that are at that place already.

        Parameters
        ----------
        name : str
            Name of the block, of its output and of its states.
        at : str
            Input or output.
        kind : str
            One of `flightid.models.language.blocks.KINDS`.
        note : str, optional
        **values
            What the kind needs: numbers, or formulas of the model's parameters.

        Raises
        ------
        ModelError
            The block contradicts itself or the model.

        Example
        -------
        >>> from flightid.models import load_model
        >>> yaw = load_model("quadrotor_yaw").with_block(
        ...     "motor", at="tau_psi", kind="first_order_lag", T=0.05)
        >>> print(yaw.blocks[0], list(yaw.states))
        ModelBlock(motor at tau_psi: first_order_lag, T = motor_T) ['r', 'psi', 'motor_1']
        """
        block = ModelBlock(name, at, kind, values, note)
        return self._with_blocks((*self.blocks, block))

    def _with_blocks(self, blocks: tuple[ModelBlock, ...]) -> StateSpaceModel:
        """The structure of the bare model with blocks, and everything else from this one."""
        trim, own = split_own(self.blocks, self.trim)
        initial, own_initial = split_own(self.blocks, self.initial)
        bare = self.bare or self
        base = replace(
            bare, parameters=self.parameters, trim=trim, initial=initial, blocks=(), bare=None,
            biases=self.biases, pairs=self.pairs, name=self.name, source=self.source,
            note=self.note,
        )  # fmt: skip
        found = replace(base, **written_out(base, blocks)) if blocks else base
        return replace(found, trim={**found.trim, **own}, initial={**found.initial, **own_initial})

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
        return description.one_line(self)

    def __str__(self) -> str:
        """Equations and outputs, one a line."""
        return "\n".join(description.lines(self))

    def summary(self) -> Table:
        """Table of the parameters, with the equations below."""
        table = self.parameters.summary().without_empty_columns()
        notes = (*description.lines(self), *filter(None, [self.source, self.note]))
        return Table(self.name, table.columns, table.rows, notes)

    def _repr_html_(self) -> str:
        return self.displayed().html() + super()._repr_html_()

    def to_dict(self) -> dict[str, object]:
        """Plain values with a ``schema`` key; `from_dict` reads them."""
        return {"schema": SCHEMA, **description.to_plain(self)}

    @classmethod
    def from_dict(cls, content: Mapping[str, object]) -> StateSpaceModel:
        """Build a model from plain values such as a TOML file gives.

        Parameters
        ----------
        content : mapping
            Keys ``states``, ``inputs``, ``outputs``, ``parameters``, ``equations`` and, as needed,
            ``definitions``, ``constants``, ``constraints``, ``delays``, ``tables``, ``blocks``,
            ``trim``, ``initial``, ``biases``, ``responses``, ``name``, ``source``, ``note``.
            Formulas may be SymPy objects.

        Raises
        ------
        ModelError
            A key is missing, unknown or of the wrong type, or the model contradicts itself.
        """
        described, blocks = description.from_plain(content)
        if not blocks:
            return cls(**described)
        trim, own = split_own(blocks, described["trim"])
        initial, own_initial = split_own(blocks, described["initial"])
        bare = cls(**{**described, "trim": trim, "initial": initial})  # type: ignore[arg-type]
        found = replace(bare, **written_out(bare, blocks))
        return replace(found, trim={**found.trim, **own}, initial={**found.initial, **own_initial})
