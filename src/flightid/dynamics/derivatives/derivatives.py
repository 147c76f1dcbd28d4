"""Stability and control derivatives of a model, with and without dimensions.

A further one is a parameter of its model in `models/library/`; its name is known here.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import numpy as np
import scipy
from numpy.typing import NDArray

from flightid.dynamics.derivatives.nondimensional import FORCES, MOMENTS, Normalisation
from flightid.errors import ModelError, UnitError
from flightid.findings import Finding
from flightid.frozen import dataclass
from flightid.identification import Fit
from flightid.identification.uncertain_of import source_findings
from flightid.identification.uncertain_parameters import parameter_estimates
from flightid.models import StateSpaceModel
from flightid.result import Result
from flightid.table import Cell, Column, Table
from flightid.uncertainty.estimate import Estimate, Reading
from flightid.uncertainty.quantiles import interval_words, shown
from flightid.units import convert, same_dimension

Array = NDArray[np.float64]
AXES: Mapping[str, str] = {
    "u": "X", "V": "X", "v": "Y", "beta": "Y", "w": "Z", "alpha": "Z", "p": "L", "q": "M", "r": "N",
}  # fmt: skip
"""Letter of the force or moment by the state whose rate it changes."""
WORDS = {
    "X": "force along x", "Y": "force along y", "Z": "force along z", "L": "rolling moment",
    "M": "pitching moment", "N": "yawing moment",
}  # fmt: skip
STABILITY, CONTROL, RATE = "stability", "control", "by a state's rate"


@dataclass(frozen=True)
class Derivative:
    """One derivative: what changes by what.

    Attributes
    ----------
    name : str
        The parameter's.
    axis : str
        X, Y, Z, L, M, N per mass or inertia, or the state whose rate it is.
    variable : str
        State, input, or state with ``dot``.
    kind : {"stability", "control", "by a state's rate"}
    dimensional : Estimate
        In the parameter's unit.
    si : Estimate
        In SI and radians; an input without dimension stays as it is.
    coefficient : Estimate or None
        Without dimensions, where a normalisation was given that knows it.
    status : str
        ``"free"``, ``"fixed"``, ``"tied"``, ``"at bound"`` or ``"not seen"``.
    note : str
        The parameter's.

    Example
    -------
    >>> import flightid as fid
    >>> fid.derivatives(fid.load_model("r50_hover"))["Lb"]
    Derivative(Lb: rolling moment by b = 166 1/s^2)
    """

    name: str
    axis: str
    variable: str
    kind: str
    dimensional: Reading
    si: Reading
    coefficient: Reading | None
    status: str
    note: str = ""

    @property
    def meaning(self) -> str:
        """What changes by what, in words."""
        what = WORDS.get(self.axis, f"rate of {self.axis}")
        by = f"rate of {self.variable[:-3]}" if self.kind == RATE else self.variable
        return f"{what} by {by}"

    def __repr__(self) -> str:
        """Name, meaning and value on one line."""
        return f"Derivative({self.name}: {self.meaning} = {self.dimensional.text})"

    def to_dict(self) -> dict[str, object]:
        """Plain values."""
        without = self.coefficient
        return {
            "axis": self.axis,
            "variable": self.variable,
            "kind": self.kind,
            "meaning": self.meaning,
            "dimensional": self.dimensional.to_dict(),
            "si": self.si.to_dict(),
            "coefficient": None if without is None else {"name": without.name, **without.to_dict()},
            "status": self.status,
            "note": self.note,
        }


@dataclass(frozen=True, repr=False, eq=False)
class DerivativeTable(Result, schema="flightid.derivatives/1"):
    """Result of `flightid.derivatives`.

    Attributes
    ----------
    name : str
        The model's.
    derivatives : tuple of Derivative
        Forces, moments, then what belongs to other states.
    others : tuple of str
        Parameters that are no derivatives: time constants, delays, geometry.
    normalisation : str
        Whose convention the coefficients follow; empty without one.
    findings : tuple of Finding

    Example
    -------
    >>> import flightid as fid
    >>> fid.derivatives(fid.load_model("short_period"))
    DerivativeTable('Short period': 4 stability, 2 control)
    """

    name: str
    derivatives: tuple[Derivative, ...]
    others: tuple[str, ...]
    normalisation: str = ""
    findings: tuple[Finding, ...] = ()

    def __iter__(self) -> Iterator[Derivative]:
        return iter(self.derivatives)

    def __len__(self) -> int:
        return len(self.derivatives)

    def __getitem__(self, name: str) -> Derivative:
        """The derivative of a name, or of a coefficient's name."""
        for each in self.derivatives:
            if name == each.name or (each.coefficient and name == each.coefficient.name):
                return each
        raise ModelError(
            "there is no such derivative",
            found=repr(name),
            needed=", ".join(each.name for each in self.derivatives),
        )

    @property
    def coefficients(self) -> dict[str, float]:
        """Values without dimensions by name."""
        found = (each.coefficient for each in self.derivatives)
        return {q.name: q.value for q in found if q is not None and q.value is not None}

    def summary(self, *, level: float | None = None) -> Table:
        """Table of the derivatives by force and moment, with and without dimensions."""
        level = shown(level)
        columns = (
            Column("derivative"),
            Column("meaning"),
            Column("kind"),
            Column("value"),
            Column("unit"),
            Column(f"{interval_words(level)} low"),
            Column(f"{interval_words(level)} high"),
            Column("coefficient"),
            Column("value", digits=4),
            Column(f"{interval_words(level)} low"),
            Column(f"{interval_words(level)} high"),
            Column("status"),
        )
        notes = [f"Not derivatives: {', '.join(self.others)}."] if self.others else []
        notes += [f"Coefficients after {self.normalisation}."] if self.normalisation else []
        reasons = {each.dimensional.reason for each in self.derivatives} - {""}
        notes += [f"No interval: {reason}." for reason in sorted(reasons)]
        without = {e.si.reason for e in self.derivatives if e.si.value is None}
        notes += [f"No coefficient: {reason}." for reason in sorted(without)]
        rows = tuple(_row(each, level) for each in self.derivatives)
        title = f"Derivatives of {self.name}"
        return Table(
            title, columns, rows, (*notes, *map(str, self.findings))
        ).without_empty_columns()

    def __repr__(self) -> str:
        """Counts on one line."""
        controls = sum(each.kind == CONTROL for each in self.derivatives)
        return (
            f"DerivativeTable({self.name!r}: {len(self.derivatives) - controls} stability, "
            f"{controls} control)"
        )

    def _computed(self) -> dict[str, object]:
        return {"derivatives": {each.name: each for each in self.derivatives}}


def derivatives(source: object, normalisation: Normalisation | None = None) -> DerivativeTable:
    """Stability and control derivatives of a state-space model, with units and intervals.

    A parameter is a derivative where it stands once in the equations, as the factor of one state,
    one state's rate or one input; the equation says of what, so that its name does not matter.

    Parameters
    ----------
    source : Fit or StateSpaceModel
        A model from the file of a fit has its intervals, one alone has none.
    normalisation : FixedWing or Rotorcraft, optional
        Mass, geometry and condition for coefficients without dimensions. Taken as known exactly.

    Raises
    ------
    ModelError
        Not a state-space model, or one without a parameter that is a derivative.

    Assumes
    -------
    Derivatives per mass or inertia, moments free of the product of inertia. A coefficient by speed
    is the whole change, thus holds twice the trim value (CXu = 2 CX0 + V ∂CX/∂V).

    Reference
    ---------
    Klein & Morelli, *Aircraft System Identification*, 2006, sections 3.7 and 5.1; Padfield,
    *Helicopter Flight Dynamics*, 2nd ed., section 4.3.

    Example
    -------
    >>> import flightid as fid
    >>> from flightid.dynamics import FixedWing
    >>> navion = FixedWing(1247.4, 1420.9, 4067.5, 4786.0, 17.094, 1.7374, 10.18, 53.645)
    >>> found = derivatives(fid.load_model("fixed_wing_lateral"), navion)
    >>> round(found["Cnbeta"].coefficient.value, 3)
    0.07
    """
    model = source.model if isinstance(source, Fit) else source
    if not isinstance(model, StateSpaceModel):
        raise ModelError(
            "derivatives need a state-space model",
            found=type(model).__name__,
            needed="StateSpaceModel or a fit of one",
            action="a transfer function has poles and gains: see modes",
        )
    found = list(_found(source, model, normalisation))
    if not found:
        raise ModelError(
            "no parameter of the model is a derivative",
            found=", ".join(model.parameters),
            needed="parameters that stand once, as the factor of a state or input",
            action="for coefficients linearise at the trim, and see modes",
        )
    order = [*FORCES, *MOMENTS]
    found.sort(key=lambda d: order.index(d.axis) if d.axis in order else len(order))
    names = {each.name for each in found}
    others = tuple(name for name in model.parameters if name not in names)
    convention = "" if normalisation is None else normalisation.source
    known = source_findings(source)
    return DerivativeTable(model.name, tuple(found), others, convention, known)


def _found(
    source: object, model: StateSpaceModel, normalisation: Normalisation | None
) -> Iterator[Derivative]:
    known = parameter_estimates(source)
    slopes = model.with_free(*model.parameters).matrix_derivatives()
    owners = _owners(model)
    states, inputs = list(model.states), list(model.inputs)
    for name, parameter in model.parameters.items():
        matrices = slopes[name]
        parts = np.hstack([matrices.f, matrices.g, -matrices.m])
        places = np.argwhere(parts)
        if len(places) != 1 or abs(parts[tuple(places[0])]) != 1.0:
            continue
        row, column = map(int, places[0])
        variable = [*states, *inputs, *(f"{s}dot" for s in states)][column]
        axis = AXES.get(owners[row], owners[row])
        conventional = name.startswith(axis) and name != axis
        kind = STABILITY if column < len(states) else CONTROL
        kind = RATE if column >= len(states) + len(inputs) else kind
        if (parameter.status != "free" or kind == RATE) and not conventional:
            continue
        value = known[name].as_reading()
        si = _in_si(value, axis, variable, model)
        yield Derivative(
            name, axis, variable, kind, value, si,
            _coefficient(si, axis, variable, kind, normalisation),
            known[name].status, parameter.note,
        )  # fmt: skip


def _owners(model: StateSpaceModel) -> list[str]:
    """State whose rate each equation gives, by the pattern of the left sides."""
    m = model.matrices().m
    cost = 1000.0 * (m == 0.0) + (1.0 - np.eye(len(m)))
    _, columns = scipy.optimize.linear_sum_assignment(cost)
    states = list(model.states)
    return [states[k] for k in columns]


def _in_si(value: Reading, axis: str, variable: str, model: StateSpaceModel) -> Reading:
    """The derivative in SI; of a state without a letter, as it is."""
    if axis not in WORDS:
        return value
    unit = _si_unit(axis, variable, model)
    try:
        scale = float(convert([1.0], value.unit, unit)[0])
    except UnitError:
        reason = f"its unit {value.unit} is not that of a {WORDS[axis]} per mass or inertia"
        return Estimate(value.name, None, unit, None, reason)
    return value.scaled(scale, unit=unit)


def _si_unit(axis: str, variable: str, model: StateSpaceModel) -> str:
    load = "m/s^2" if axis in FORCES else "1/s^2"
    base, rate = (variable[:-3], " * s") if variable.endswith("dot") else (variable, "")
    declared = model.states.get(base) or model.input_units.get(base, "1")
    for unit in ("rad", "m/s"):
        if same_dimension(declared, unit):
            return f"{load} / ({unit}){rate}" if unit != "rad" else f"({load}){rate}"
    if same_dimension(declared, "rad/s"):
        return f"({load}) * s{rate}"
    return f"({load}) / ({declared}){rate}"


def _coefficient(
    si: Reading, axis: str, variable: str, kind: str, normalisation: Normalisation | None
) -> Reading | None:
    if normalisation is None or axis not in WORDS:
        return None
    factor = normalisation.factor(axis, variable)
    if factor is None:
        return None
    unit = "1"
    if kind == CONTROL and " / (" in si.unit:
        unit = "1/(" + si.unit.rsplit(" / (", 1)[1]
    return si.scaled(1.0 / factor, name=normalisation.symbol(axis, variable), unit=unit)


def _row(each: Derivative, level: float) -> tuple[Cell, ...]:
    unit = "" if each.dimensional.unit == "1" else each.dimensional.unit
    value = each.dimensional
    cells: list[Cell] = [value.value, unit, *(value.interval(level) or (None, None))]
    without = each.coefficient
    if without is None:
        cells += [None, None, None, None]
    else:
        cells += [without.name, without.value, *(without.interval(level) or (None, None))]
    return (each.name, each.meaning, each.kind, *cells, each.status)
