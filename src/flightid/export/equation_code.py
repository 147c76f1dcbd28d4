"""The equations of a state-space model as C functions (native: `equation_listing.rs`)."""

from __future__ import annotations

from collections.abc import Iterable

from flightid import _native
from flightid.errors import ModelError
from flightid.export.names import number_literal
from flightid.export.table_code import table_functions
from flightid.frozen import dataclass
from flightid.models import StateSpaceModel

Line = tuple[str, float, list[int]]
# Ties and kinks as `dual.rs` has them.
_FORMS = {
    "add": "{0} + {1}",
    "subtract": "{0} - {1}",
    "multiply": "{0} * {1}",
    "divide": "{0} / {1}",
    "negate": "-{0}",
    "minimum": "({1} < {0}) ? {1} : {0}",
    "maximum": "({1} > {0}) ? {1} : {0}",
    "less": "({0} < {1}) ? 1.0 : 0.0",
    "lessequal": "({0} <= {1}) ? 1.0 : 0.0",
    "sign": "({0} == 0.0) ? 0.0 : (({0} > 0.0) ? 1.0 : -1.0)",
    "select": "({0} == 0.0) ? {2} : {1}",
}
_CALLS = {
    "sin": "sin", "cos": "cos", "tan": "tan", "asin": "asin", "acos": "acos", "atan": "atan",
    "sinh": "sinh", "cosh": "cosh", "tanh": "tanh", "exp": "exp", "log": "log", "sqrt": "sqrt",
    "abs": "fabs", "atan2": "atan2",
}  # fmt: skip
_FIXED, _MOVING = "fixed", "moving"


@dataclass(frozen=True)
class EquationCode:
    """C text of a model's equations.

    Attributes
    ----------
    tables : str
        Functions of the tables.
    prepare : str
        Statements that set ``fixed[...]`` and ``delay[...]`` from ``parameter[...]``.
    residuals : str
        Statements that set ``residual[...]`` from ``x``, ``u``, ``parameter`` and ``fixed``.
    mass : str
        Statements that set ``mass[row][column]``; empty where every equation begins with its own
        state derivative alone.
    mass_moves : bool
        Whether the factors depend on states or inputs.
    outputs : str
        Statements that set ``y[...]`` from ``dx``, ``x``, ``u``.
    outputs_need_rates : bool
    n_fixed : int
        Numbers that depend on parameters alone.
    """

    tables: str
    prepare: str
    residuals: str
    mass: str
    mass_moves: bool
    outputs: str
    outputs_need_rates: bool
    n_fixed: int


def equation_code(model: StateSpaceModel, prefix: str) -> EquationCode:
    """Write the equations of a model as C statements.

    Parameters
    ----------
    model : StateSpaceModel
    prefix : str
        Beginning of the names of table functions.

    Raises
    ------
    ModelError
        A state derivative does not enter its equation linearly.
    """
    lines, (residuals, mass, outputs, delays) = _native.list_equations(model.native)
    n, m = len(model.states), len(model.inputs)
    writer = _Writer(lines, n, m, prefix)
    unit = len(mass) == n and all(
        row == column and lines[place][:2] == ("constant", 1.0) for row, column, place in mass
    )
    factors = [] if unit else [(f"mass[{row}][{column}]", place) for row, column, place in mass]
    moves = any(writer.kind[place] == _MOVING for _, place in factors)
    late = [(f"delay[{k}]", place) for k, place in enumerate(delays)]
    prepared = writer.statements(late if moves else [*late, *factors], fixed=True)
    rows = [(f"residual[{k}]", place) for k, place in enumerate(residuals)]
    measured = [(f"y[{k}]", place) for k, place in enumerate(outputs)]
    texts = (
        writer.statements([*rows, *factors] if moves else rows, at_rest=True),
        writer.statements(measured),
    )
    return EquationCode(
        tables="\n\n".join(table_functions(model.tables, prefix)),
        prepare="\n".join([*prepared, *writer.kept_statements()]),
        residuals="\n".join(texts[0]),
        mass="yes" if factors else "",
        mass_moves=moves,
        outputs="\n".join(texts[1]),
        outputs_need_rates=any("dx[" in line for line in texts[1]),
        n_fixed=len(writer.kept),
    )


class _Writer:
    """Operations to statements; what depends on parameters alone is kept from call to call."""

    def __init__(self, lines: list[Line], n: int, m: int, prefix: str) -> None:
        self.lines, self._n, self._m, self._prefix = lines, n, m, prefix
        self.kept: dict[int, int] = {}
        self.kind: list[str] = []
        for name, _, arguments in lines:
            if name == "constant":
                self.kind.append("constant")
            elif name == "input":
                self.kind.append(_MOVING if arguments[0] < 2 * n + m else _FIXED)
            else:
                used = {self.kind[place] for place in self._used(name, arguments)}
                self.kind.append(_MOVING if _MOVING in used else _FIXED)

    @staticmethod
    def _used(name: str, arguments: list[int]) -> list[int]:
        return arguments[1:] if name.startswith("table") else arguments

    def statements(
        self, wanted: list[tuple[str, int]], *, fixed: bool = False, at_rest: bool = False
    ) -> list[str]:
        """Assignments of some lines, after all that they need."""
        needed = self._needed((place for _, place in wanted), fixed)
        found = [
            f"    const double v{place} = {self._expression(place, fixed, at_rest)};"
            for place in needed
        ]
        ends = [f"    {target} = {self._name(p, fixed, at_rest)};" for target, p in wanted]
        return found + ends

    def kept_statements(self) -> list[str]:
        """Assignments of what the other statements take from ``fixed``."""
        made = self.statements([(f"fixed[{k}]", p) for p, k in self.kept.items()], fixed=True)
        # A scope of its own: lines may be needed here and for the delays.
        return ["    {", *(f"    {line}" for line in made), "    }"] if made else []

    def _needed(self, wanted: Iterable[int], fixed: bool) -> list[int]:
        open_, found = list(wanted), set()
        while open_:
            place = open_.pop()
            name, _, arguments = self.lines[place]
            leaf = name in ("constant", "input") or (not fixed and self.kind[place] == _FIXED)
            if leaf or place in found:
                continue
            found.add(place)
            open_ += self._used(name, arguments)
        return sorted(found)

    def _name(self, place: int, fixed: bool, at_rest: bool) -> str:
        name, number, arguments = self.lines[place]
        if name == "constant":
            return number_literal(number)
        if name == "input":
            return self._input(arguments[0], at_rest)
        if self.kind[place] == _FIXED and not fixed:
            return f"fixed[{self.kept.setdefault(place, len(self.kept))}]"
        return f"v{place}"

    def _input(self, place: int, at_rest: bool) -> str:
        n, m = self._n, self._m
        if place < n:
            return "0.0" if at_rest else f"dx[{place}]"
        if place < 2 * n:
            return f"x[{place - n}]"
        if place < 2 * n + m:
            return f"u[{place - 2 * n}]"
        return f"parameter[{place - 2 * n - m}]"

    def _expression(self, place: int, fixed: bool, at_rest: bool) -> str:
        name, _, arguments = self.lines[place]
        used = [self._name(a, fixed, at_rest) for a in self._used(name, arguments)]
        if name == "power":
            return self._power(arguments[1], used)
        if name == "table value":
            return f"{self._prefix}_table_{arguments[0]}({', '.join(used)})"
        if name in _CALLS:
            return f"{_CALLS[name]}({', '.join(used)})"
        if name not in _FORMS:
            raise ModelError("an operation has no counterpart in C", found=name)
        return _FORMS[name].format(*used)

    def _power(self, exponent: int, used: list[str]) -> str:
        kind, number, _ = self.lines[exponent]
        if kind == "constant" and number == 2.0:
            return f"{used[0]} * {used[0]}"
        return f"pow({used[0]}, {used[1]})"
