r"""Derivatives of formulas as LaTeX, for showing the matrices of a model.

The parsed formula is walked once; each node carries its value and its derivatives as printed
terms, as dual numbers carry numbers. Nothing recurses and the length of a term is bounded.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache

from flightid import _native
from flightid.errors import ModelError

MAXIMUM_TERM = 20_000
_SUM, _PRODUCT, _ATOM = 0, 1, 2
_GREEK = frozenset(
    [
        "alpha",
        "beta",
        "gamma",
        "delta",
        "epsilon",
        "zeta",
        "eta",
        "theta",
        "iota",
        "kappa",
        "lambda",
        "mu",
        "nu",
        "xi",
        "rho",
        "sigma",
        "tau",
        "phi",
        "chi",
        "psi",
        "omega",
        "Gamma",
        "Delta",
        "Theta",
        "Lambda",
        "Xi",
        "Sigma",
        "Phi",
        "Psi",
        "Omega",
    ]
)
_COMMANDS = {"asin": "arcsin", "acos": "arccos", "atan": "arctan", "log": "ln"}


@dataclass(frozen=True)
class Term:
    """A printed formula.

    Attributes
    ----------
    latex : str
    level : int
        Sum, product or atom: what needs brackets.
    number : float or None
        Its value, where it is a plain number.
    names : frozenset of str
        Names that occur in it.
    """

    latex: str
    level: int = _ATOM
    number: float | None = None
    names: frozenset[str] = frozenset()


ZERO = Term("0", number=0.0)
ONE = Term("1", number=1.0)


def derivatives(text: str, variables: Sequence[str]) -> list[Term]:
    r"""Derivatives of a formula by some of its names.

    Parameters
    ----------
    text : str
        Formula.
    variables : sequence of str
        Names.

    Returns
    -------
    list of Term
        One for each variable; ``ZERO`` where the formula does not hold it.

    Raises
    ------
    ModelError
        The formula is outside the grammar, or a derivative is too long to be shown.

    Example
    -------
    >>> [term.latex for term in derivatives("-Lp*p + g*sin(phi)", ["p", "phi", "r"])]
    ['-L_{p}', 'g \\cos\\left(\\phi\\right)', '0']
    """
    values: list[Term] = []
    slopes: list[dict[str, Term]] = []
    wanted = set(variables)
    for kind, name, number, places in _native.expression_nodes(text):
        inner = [values[place] for place in places]
        if kind == "number":
            values.append(_number(number))
            slopes.append({})
            continue
        if kind == "name":
            values.append(Term(latex_name(name), names=frozenset([name])))
            slopes.append({name: ONE} if name in wanted else {})
            continue
        values.append(_value(kind, inner))
        partial = _partials(kind, inner, values[-1])
        slope: dict[str, Term] = {}
        for factor, place in zip(partial, places, strict=True):
            for variable, outer in slopes[place].items():
                slope[variable] = _add(slope.get(variable, ZERO), _times(factor, outer))
        slopes.append(slope)
    return [slopes[-1].get(variable, ZERO) for variable in variables]


def latex_name(name: str) -> str:
    r"""A name as LaTeX: Greek letters, the tail as an index, a prime as a dot.

    Example
    -------
    >>> latex_name("tau_f"), latex_name("Nped"), latex_name("p'")
    ('\\tau_{f}', 'N_{\\mathrm{ped}}', '\\dot{p}')
    """
    if name.endswith("'"):
        return rf"\dot{{{latex_name(name[:-1])}}}"
    head, _, tail = name.partition("_")
    if not tail and head not in _GREEK and len(head) > 1:
        head, tail = head[0], head[1:]
    head = f"\\{head}" if head in _GREEK else head
    if head and not re.fullmatch(r"\\?[A-Za-z]+", head):
        head = rf"\mathrm{{{head}}}"
    index = ",".join(map(_index, filter(None, tail.split("_"))))
    return f"{head}_{{{index}}}" if index else head or r"\_"


def _index(text: str) -> str:
    if text in _GREEK:
        return f"\\{text}"
    return text if len(text) == 1 or text.isdigit() else rf"\mathrm{{{text}}}"


def _number(value: float) -> Term:
    text = f"{value:.6g}"
    if "e" in text:
        digits, power = text.split("e")
        text = rf"{digits} \cdot 10^{{{int(power)}}}"
    return Term(text, _SUM if value < 0.0 else _ATOM, value)


def _made(latex: str, level: int, *parts: Term) -> Term:
    if len(latex) > MAXIMUM_TERM:
        raise ModelError(
            "a derivative of the model is too long to be shown",
            found=f"{len(latex)} characters",
            needed=f"at most {MAXIMUM_TERM}",
        )
    return Term(latex, level, names=frozenset().union(*(part.names for part in parts)))


def _bracketed(term: Term, level: int) -> str:
    return term.latex if term.level >= level else rf"\left({term.latex}\right)"


def _negate(a: Term) -> Term:
    if a.number is not None:
        return ZERO if a.number == 0.0 else _number(-a.number)
    if a.latex.startswith("-") and a.level == _PRODUCT:
        return _made(a.latex[1:], _PRODUCT, a)
    return _made("-" + _bracketed(a, _PRODUCT), _PRODUCT, a)


def _add(a: Term, b: Term) -> Term:
    if a.number == 0.0:
        return b
    if b.number == 0.0:
        return a
    if a.number is not None and b.number is not None:
        return _number(a.number + b.number)
    joint = " " if b.latex.startswith("-") else " + "
    return _made(a.latex + joint + b.latex, _SUM, a, b)


def _times(a: Term, b: Term) -> Term:
    if a.number is not None and b.number is not None:
        return _number(a.number * b.number)
    for one, other in ((a, b), (b, a)):
        if one.number == 0.0:
            return ZERO
        if one.number == 1.0:
            return other
        if one.number == -1.0:
            return _negate(other)
    if b.latex.startswith("-") and b.level == _PRODUCT:
        return _negate(_times(a, _negate(b)))
    return _made(f"{_bracketed(a, _PRODUCT)} {_bracketed(b, _PRODUCT)}", _PRODUCT, a, b)


def _divide(a: Term, b: Term) -> Term:
    if a.number == 0.0 or b.number == 1.0:
        return a
    if a.latex.startswith("-") and (a.level == _PRODUCT or a.number is not None):
        return _negate(_divide(_negate(a), b))
    return _made(rf"\frac{{{a.latex}}}{{{b.latex}}}", _PRODUCT, a, b)


def _power(a: Term, b: Term) -> Term:
    if b.number == 1.0:
        return a
    if b.number == 0.0:
        return ONE
    base = a.latex if re.fullmatch(r"[A-Za-z0-9.]", a.latex) else rf"\left({a.latex}\right)"
    return _made(f"{base}^{{{b.latex}}}", _ATOM, a, b)


def _call(function: str, *arguments: Term) -> Term:
    shown = ", ".join(argument.latex for argument in arguments)
    command = _COMMANDS.get(function, function)
    standard = (
        "sin",
        "cos",
        "tan",
        "sinh",
        "cosh",
        "tanh",
        "exp",
        "arcsin",
        "arccos",
        "arctan",
        "ln",
    )
    command = f"\\{command}" if command in standard else rf"\operatorname{{{command}}}"
    return _made(rf"{command}\left({shown}\right)", _ATOM, *arguments)


_VALUES: dict[str, Callable[..., Term]] = {
    "negate": _negate,
    "add": _add,
    "subtract": lambda a, b: _add(a, _negate(b)),
    "multiply": _times,
    "divide": _divide,
    "power": _power,
    "sqrt": lambda a: _made(rf"\sqrt{{{a.latex}}}", _ATOM, a),
}
_NAMES = {"minimum": "min", "maximum": "max"}
# Derivatives of each function of a (and b) by its arguments; f is its value.
_PARTIALS = {
    "negate": ("-1",),
    "add": ("1", "1"),
    "subtract": ("1", "-1"),
    "multiply": ("b", "a"),
    "divide": ("1/b", "-a/b^2"),
    "power": ("b*a^(b - 1)", "f*log(a)"),
    "sin": ("cos(a)",),
    "cos": ("-sin(a)",),
    "tan": ("1/cos(a)^2",),
    "asin": ("1/sqrt(1 - a^2)",),
    "acos": ("-1/sqrt(1 - a^2)",),
    "atan": ("1/(1 + a^2)",),
    "sinh": ("cosh(a)",),
    "cosh": ("sinh(a)",),
    "tanh": ("1 - f^2",),
    "exp": ("f",),
    "log": ("1/a",),
    "sqrt": ("1/(2*f)",),
    "abs": ("sign(a)",),
    "sign": ("0",),
    "atan2": ("b/(a^2 + b^2)", "-a/(a^2 + b^2)"),
    "minimum": ("0.5*(1 + sign(b - a))", "0.5*(1 - sign(b - a))"),
    "maximum": ("0.5*(1 + sign(a - b))", "0.5*(1 - sign(a - b))"),
}


def _value(kind: str, inner: list[Term]) -> Term:
    if kind in _VALUES:
        return _VALUES[kind](*inner)
    return _call(_NAMES.get(kind, kind), *inner)


@cache
def _nodes(text: str) -> list[tuple[str, str, float, list[int]]]:
    return _native.expression_nodes(text)


def _partials(kind: str, inner: list[Term], value: Term) -> list[Term]:
    known = {"a": inner[0], "b": inner[-1], "f": value}
    found = []
    for text in _PARTIALS[kind]:
        terms: list[Term] = []
        for function, name, number, places in _nodes(text):
            if function == "number":
                terms.append(_number(number))
            elif function == "name":
                terms.append(known[name])
            else:
                terms.append(_value(function, [terms[place] for place in places]))
        found.append(terms[-1])
    return found
