"""The matrices of a state-space model as printed formulas."""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from html import escape

from flightid.frozen import dataclass
from flightid.models.language.symbolic import ZERO, Formula, Printer, latex_name
from flightid.models.state_space.linear import Linearisation
from flightid.models.state_space.parts import derivative

REMEMBERED = 32
"""Structures whose matrices are kept."""
_BREAK = r" \\ "
Rows = tuple[tuple[Formula, ...], ...]


@dataclass(frozen=True)
class MatrixDisplay:
    """Symbolic matrices.

    Attributes
    ----------
    m, f, g, h1, h0, d : tuple of tuple of Formula
        Rows of the matrices.
    states, inputs, outputs : tuple of str
        Names along rows and columns.
    delays : tuple of Formula
        Delay of each input.
    definitions : tuple of (str, Formula)
        Auxiliary quantities: printed name and formula.
    is_linear : bool
        Whether no entry holds a state, input or state derivative.
    """

    m: Rows
    f: Rows
    g: Rows
    h1: Rows
    h0: Rows
    d: Rows
    states: tuple[str, ...]
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    delays: tuple[Formula, ...]
    definitions: tuple[tuple[str, Formula], ...]
    is_linear: bool

    def motion(self) -> str:
        """M ẋ = F x + G u as LaTeX."""
        rates = _column([derivative(name) for name in self.states])
        forced = f"{_matrix(self.f)} {_column(self.states)} + {_matrix(self.g)}"
        return f"{_matrix(self.m)} {rates} = {forced} {self._late_inputs()}"

    def _late_inputs(self) -> str:
        """Inputs, those with a delay at their earlier time."""
        if all(delay == ZERO for delay in self.delays):
            return _column(self.inputs)
        times = ["t" if delay == ZERO else f"t - {delay.latex}" for delay in self.delays]
        names = [
            rf"{latex_name(name)}({time})" for name, time in zip(self.inputs, times, strict=True)
        ]
        return rf"\begin{{bmatrix}} {_BREAK.join(names)} \end{{bmatrix}}"

    def measurement(self) -> str:
        """Outputs y = H₁ ẋ + H₀ x + D u as LaTeX, without the matrices that are zero."""
        rates = _column([derivative(name) for name in self.states])
        terms = [(self.h1, rates), (self.h0, _column(self.states)), (self.d, self._late_inputs())]
        shown = " + ".join(f"{_matrix(rows)} {names}" for rows, names in terms if _filled(rows))
        return f"{_column(self.outputs)} = {shown or '0'}"

    def _lines(self) -> list[str]:
        where = [f"{name} = {term.latex}" for name, term in self.definitions]
        return [self.motion(), self.measurement(), *where]

    def latex(self) -> str:
        """Both, with the definitions below, in a gathered environment."""
        return rf"\begin{{gathered}} {_BREAK.join(self._lines())} \end{{gathered}}"

    def html(self) -> str:
        """Both, with the definitions below, for a notebook."""
        return "".join(f"<div>$${escape(each, quote=False)}$$</div>" for each in self._lines())


def matrices_as_latex(model: Linearisation) -> MatrixDisplay:
    """Derive the matrices of a model symbolically.

    Parameters
    ----------
    model : Linearisation

    Raises
    ------
    ModelError
        A derivative is too long to be shown.
    """
    return _derived(
        (tuple(model.states), tuple(model.inputs), tuple(model.outputs)),
        tuple(model.point_names),
        tuple(model.equations.items()),
        tuple(output.expression for output in model.measurements.values()),
        tuple((name, output.expression) for name, output in model.definitions.items()),
        tuple(model.tables),
        tuple(model.delays.values()),
    )


@lru_cache(maxsize=REMEMBERED)
def _derived(
    channels: tuple[tuple[str, ...], ...],
    names: tuple[str, ...],
    sides: tuple[tuple[str, str], ...],
    measured: tuple[str, ...],
    defined: tuple[tuple[str, str], ...],
    tables: tuple[str, ...],
    delays: tuple[str, ...],
) -> MatrixDisplay:
    """Values have no part in this: a search asks it of the same equations again and again."""
    states, inputs, outputs = channels
    n, definitions = len(states), dict(defined)
    printer = Printer(names, definitions, tables)
    by_names = printer.derivatives
    equations = [by_names(f"({left}) - ({right})") for left, right in sides]
    forces = [by_names(f"({right}) - ({left})") for left, right in sides]
    answers = [by_names(each) for each in measured]
    entries = [term for row in (*equations, *answers) for term in row]
    return MatrixDisplay(
        _part(equations, 0, n),
        _part(forces, n, 2 * n),
        _part(forces, 2 * n, len(names)),
        _part(answers, 0, n),
        _part(answers, n, 2 * n),
        _part(answers, 2 * n, len(names)),
        states,
        inputs,
        outputs,
        tuple(printer.value(delay) for delay in delays),
        tuple((latex_name(name), printer.value(text)) for name, text in defined),
        not frozenset(names) & frozenset().union(*(term.names for term in entries)),
    )


def _part(rows: Sequence[Sequence[Formula]], start: int, stop: int) -> Rows:
    return tuple(tuple(row[start:stop]) for row in rows)


def _filled(rows: Rows) -> bool:
    return any(term != ZERO for row in rows for term in row)


def _matrix(rows: Rows) -> str:
    body = _BREAK.join(" & ".join(term.latex for term in row) for row in rows)
    return rf"\begin{{bmatrix}} {body} \end{{bmatrix}}"


def _column(names: Sequence[str]) -> str:
    body = _BREAK.join(map(latex_name, names))
    return rf"\begin{{bmatrix}} {body} \end{{bmatrix}}"
