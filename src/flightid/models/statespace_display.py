"""The matrices of a state-space model as printed formulas."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from html import escape
from typing import TYPE_CHECKING

from flightid.models.statespace_checks import derivative, point_names
from flightid.models.symbolic import ZERO, Term, derivatives, latex_name

if TYPE_CHECKING:
    from flightid.models.statespace import StateSpaceModel

Rows = tuple[tuple[Term, ...], ...]


@dataclass(frozen=True)
class MatrixDisplay:
    """Symbolic matrices.

    Attributes
    ----------
    m, f, g, h1, h0, d : tuple of tuple of Term
        Rows of the matrices.
    states, inputs, outputs : tuple of str
        Names along rows and columns.
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
    is_linear: bool

    def motion(self) -> str:
        """M ẋ = F x + G u as LaTeX."""
        rates = _column([derivative(name) for name in self.states])
        forced = f"{_matrix(self.f)} {_column(self.states)} + {_matrix(self.g)}"
        return f"{_matrix(self.m)} {rates} = {forced} {_column(self.inputs)}"

    def measurement(self) -> str:
        """Outputs y = H₁ ẋ + H₀ x + D u as LaTeX, without the matrices that are zero."""
        rates = _column([derivative(name) for name in self.states])
        terms = [(self.h1, rates), (self.h0, _column(self.states)), (self.d, _column(self.inputs))]
        shown = " + ".join(f"{_matrix(rows)} {names}" for rows, names in terms if _filled(rows))
        return f"{_column(self.outputs)} = {shown or '0'}"

    def latex(self) -> str:
        """Both, in an aligned environment."""
        return rf"\begin{{gathered}} {self.motion()} \\ {self.measurement()} \end{{gathered}}"

    def html(self) -> str:
        """Both, for a notebook."""
        both = (self.motion(), self.measurement())
        return "".join(f"<div>$${escape(each, quote=False)}$$</div>" for each in both)


def matrices_as_latex(model: StateSpaceModel) -> MatrixDisplay:
    """Derive the matrices of a model symbolically.

    Parameters
    ----------
    model : StateSpaceModel

    Returns
    -------
    MatrixDisplay

    Raises
    ------
    ModelError
        A derivative is too long to be shown.
    """
    n, names = len(model.states), point_names(model)
    equations = [
        derivatives(f"({left}) - ({right})", names) for left, right in model.equations.items()
    ]
    forces = [
        derivatives(f"({right}) - ({left})", names) for left, right in model.equations.items()
    ]
    outputs = [derivatives(output.expression, names) for output in model.measurements.values()]
    entries = [term for row in (*equations, *outputs) for term in row]
    return MatrixDisplay(
        _part(equations, 0, n),
        _part(forces, n, 2 * n),
        _part(forces, 2 * n, len(names)),
        _part(outputs, 0, n),
        _part(outputs, n, 2 * n),
        _part(outputs, 2 * n, len(names)),
        tuple(model.states),
        tuple(model.inputs),
        tuple(model.outputs),
        not frozenset(names) & frozenset().union(*(term.names for term in entries)),
    )


def _part(rows: Sequence[Sequence[Term]], start: int, stop: int) -> Rows:
    return tuple(tuple(row[start:stop]) for row in rows)


def _filled(rows: Rows) -> bool:
    return any(term != ZERO for row in rows for term in row)


def _matrix(rows: Rows) -> str:
    body = r" \\ ".join(" & ".join(term.latex for term in row) for row in rows)
    return rf"\begin{{bmatrix}} {body} \end{{bmatrix}}"


def _column(names: Sequence[str]) -> str:
    body = r" \\ ".join(map(latex_name, names))
    return rf"\begin{{bmatrix}} {body} \end{{bmatrix}}"
