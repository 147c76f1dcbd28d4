"""SymPy objects as formulas of a model: walked node by node, never run as code.

SymPy is not needed to use flightid: objects of its classes can only be given where it is installed.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from flightid.errors import ModelError

_MAXIMUM_DEPTH = 60
# SymPy carries no types.
Item = Any
Inner = Callable[[Item], str]
Writer = Callable[[Item, Inner], str | None]


def is_sympy(item: object) -> bool:
    """Whether an object is SymPy's."""
    # Undefined functions are classes made on the spot, with no module of their own.
    modules = [base.__module__ or "" for base in type(item).__mro__]
    return any(module.partition(".")[0] == "sympy" for module in modules)


def sympy_formula(item: object, subject: str = "a formula") -> str:
    """A SymPy expression as a formula.

    Symbols keep their names; functions of time such as ``x(t)`` are the names of states or inputs,
    and their derivatives by time the derivatives of states. `Piecewise` becomes ``where``.

    Parameters
    ----------
    item : sympy expression
    subject : str
        What it is, for the message.

    Returns
    -------
    str

    Raises
    ------
    ModelError
        It holds what has no place in a formula, or is nested too deep.
    """
    return _walk(item, subject, 0)


def sympy_sides(equation: object) -> tuple[str, str]:
    """Left and right side of a SymPy equation.

    Returns
    -------
    tuple of str

    Raises
    ------
    ModelError
        It is no ``Eq``, or holds what has no place in a formula.
    """
    if type(equation).__name__ != "Equality" or not is_sympy(equation):
        raise ModelError(
            "an equation is neither two sides nor a SymPy Eq",
            found=repr(equation)[:80],
            needed='equation("p\'", "Lp*p") or equation(sympy.Eq(...))',
        )
    sides: Any = equation
    return sympy_formula(sides.lhs, "a left side"), sympy_formula(sides.rhs, "a right side")


def _walk(item: Item, subject: str, depth: int) -> str:
    if depth > _MAXIMUM_DEPTH:
        raise ModelError(f"{subject} is nested too deep", needed=f"at most {_MAXIMUM_DEPTH} levels")

    def inner(part: Item) -> str:
        return _walk(part, subject, depth + 1)

    kind = type(item).__name__
    written = _WRITERS.get(kind, _undefined)(item, inner)
    if written is None:
        raise ModelError(
            f"{subject} holds what has no place in a formula",
            found=f"{kind}: {str(item)[:80]}",
            needed=f"one of {', '.join(sorted(_WRITERS))}",
        )
    return written


def _undefined(item: Item, inner: Inner) -> str | None:
    """A function without a meaning in SymPy: of time, a state or input; else a table."""
    if not getattr(item, "is_Function", False) or not hasattr(item, "name"):
        return None
    if [str(argument) for argument in item.args] == ["t"]:
        return str(item.name)
    return f"{item.name}({', '.join(map(inner, item.args))})"


def _called(name: str) -> Writer:
    return lambda item, inner: f"{name}({', '.join(map(inner, item.args))})"


def _folded(name: str) -> Writer:
    def write(item: Item, inner: Inner) -> str:
        text = inner(item.args[0])
        for argument in item.args[1:]:
            text = f"{name}({text}, {inner(argument)})"
        return text

    return write


def _between(sign: str) -> Writer:
    return lambda item, inner: f"({sign.join(map(inner, item.args))})"


def _constant(text: str) -> Writer:
    return lambda _item, _inner: text


def _rational(item: Item, _inner: Inner) -> str:
    return f"({item})" if item.q == 1 else f"({item.p}/{item.q})"


def _power(item: Item, inner: Inner) -> str:
    base, exponent = item.args
    if str(exponent) == "1/2":
        return f"sqrt({inner(base)})"
    return f"({inner(base)})^({inner(exponent)})"


def _rate(item: Item, inner: Inner) -> str | None:
    (_, *orders) = item.args
    by_time = len(orders) == 1 and str(orders[0][0]) == "t" and int(orders[0][1]) == 1
    name = inner(item.args[0]) if by_time else ""
    return f"{name}'" if name.isidentifier() else None


def _cases(item: Item, inner: Inner) -> str | None:
    *cases, (last, test) = item.args
    if type(test).__name__ != "BooleanTrue":
        return None  # a choice with nothing for the rest has no value there
    text = inner(last)
    for value, condition in reversed(cases):
        text = f"where({inner(condition)}, {inner(value)}, {text})"
    return text


_SAME = ("sin", "cos", "tan", "asin", "acos", "atan", "sinh", "cosh", "tanh", "exp", "log", "sign")
_WRITERS: dict[str, Writer] = {
    **{name: _called(name) for name in (*_SAME, "atan2")},
    **dict.fromkeys(("Integer", "Rational", "Half", "One", "Zero", "NegativeOne"), _rational),
    **dict.fromkeys(("Symbol", "Dummy"), lambda item, _inner: str(item.name)),
    "Float": lambda item, _inner: f"({float(item)!r})",
    "Pi": _constant("pi"),
    "Exp1": _constant("exp(1)"),
    "BooleanTrue": _constant("1"),
    "BooleanFalse": _constant("0"),
    "Add": _between(" + "),
    "Mul": _between("*"),
    "StrictLessThan": _between(" < "),
    "LessThan": _between(" <= "),
    "StrictGreaterThan": _between(" > "),
    "GreaterThan": _between(" >= "),
    "Pow": _power,
    "Abs": _called("abs"),
    "Not": _called("not"),
    "Min": _folded("min"),
    "Max": _folded("max"),
    "And": _folded("and"),
    "Or": _folded("or"),
    "Derivative": _rate,
    "Piecewise": _cases,
}
