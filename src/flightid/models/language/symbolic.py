r"""Derivatives of formulas as LaTeX, for showing the matrices of a model.

The parsed formula is walked once; each node carries its value and its derivatives as printed
terms, as dual numbers carry numbers. Nothing recurses and the length of a term is bounded.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping, Sequence
from functools import cache

from flightid import _native
from flightid.errors import ModelError
from flightid.frozen import dataclass

MAXIMUM_TERM = 20_000
_TURNS = 8
_SUM, _PRODUCT, _ATOM = 0, 1, 2
_NUMBERED = re.compile(r"([A-Za-z]+)(\d+)")
_PLAIN_WORD = re.compile(r"[a-z]{4,}")
_WORD = re.compile(r"\w+")
_GREEK = frozenset(
    _WORD.findall(
        "alpha beta gamma delta epsilon zeta eta theta iota kappa lambda mu nu xi rho sigma tau "
        "phi chi psi omega Gamma Delta Theta Lambda Xi Sigma Phi Psi Omega"
    )
)
_STANDARD = frozenset(
    _WORD.findall("sin cos tan sinh cosh tanh exp arcsin arccos arctan ln min max")
)
_COMMANDS = {"asin": "arcsin", "acos": "arccos", "atan": "arctan", "log": "ln"}


@dataclass(frozen=True)
class Formula:
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


Slopes = dict[str, Formula]
ZERO = Formula("0", number=0.0)
ONE = Formula("1", number=1.0)


class Printer:
    r"""Formulas and their derivatives by some names, as printed terms.

    Parameters
    ----------
    variables : sequence of str
        Names to derive by.
    definitions : mapping of str to str
        Formulas of auxiliary quantities: printed by their names, derived through.
    tables : sequence of str
        Names of the tables that formulas may call.

    Example
    -------
    >>> printer = Printer(["p", "V"], {"qbar": "0.5*rho*V^2"})
    >>> [term.latex for term in printer.derivatives("qbar*S")]
    ['0', '0.5 \\rho 2 V S']
    """

    def __init__(
        self,
        variables: Sequence[str],
        definitions: Mapping[str, str] | None = None,
        tables: Sequence[str] = (),
    ) -> None:
        self._variables = list(variables)
        self._wanted = frozenset(variables)
        self._definitions = definitions or {}
        self._tables = list(tables)
        self._known: dict[str, tuple[Formula, Slopes]] = {}

    def value(self, text: str) -> Formula:
        """The formula itself.

        Raises
        ------
        ModelError
            It is outside the grammar, or too long to be shown.
        """
        return self._walk(text)[0]

    def derivatives(self, text: str) -> list[Formula]:
        """Derivative by each variable; ``ZERO`` where the formula does not hold it.

        Raises
        ------
        ModelError
            The formula is outside the grammar, or a derivative is too long to be shown.
        """
        slopes = self._walk(text)[1]
        return [slopes.get(variable, ZERO) for variable in self._variables]

    def _name(self, name: str) -> tuple[Formula, Slopes]:
        if name not in self._known:
            names, slopes = frozenset([name]), {name: ONE} if name in self._wanted else {}
            if name in self._definitions:
                # Compiling the model has bounded the chain of definitions and found it open.
                inner, slopes = self._walk(self._definitions[name])
                names |= inner.names
            self._known[name] = Formula(latex_name(name), names=names), slopes
        return self._known[name]

    def _walk(self, text: str) -> tuple[Formula, Slopes]:
        values: list[Formula] = []
        slopes: list[Slopes] = []
        slope: Slopes
        for kind, name, number, places in _native.expression_nodes(text, self._tables):
            inner = [values[place] for place in places]
            outer = [slopes[place] for place in places]
            if kind == "number":
                value, slope = _number(number), {}
            elif kind == "name":
                value, slope = self._name(name)
            elif kind == "select":
                value, slope = _choice(*inner), _chosen(inner[0], *outer[1:])
            else:
                value = _value(kind, inner) if kind != "table" else _looked_up(name, inner)
                partial = _table_partials if kind == "table" else _partials
                slope = _chain(partial(kind if kind != "table" else name, inner, value), outer)
            values.append(value)
            slopes.append(slope)
        return values[-1], slopes[-1]


def _chain(partials: list[Formula], inner: list[Slopes]) -> Slopes:
    slope: Slopes = {}
    for factor, slopes in zip(partials, inner, strict=True):
        for variable, outer in slopes.items():
            slope[variable] = _add(slope.get(variable, ZERO), _times(factor, outer))
    return slope


def derivatives(text: str, variables: Sequence[str]) -> list[Formula]:
    r"""Derivatives of a formula by some of its names.

    Parameters
    ----------
    text : str
        Formula.
    variables : sequence of str
        Names.

    Returns
    -------
    list of Formula
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
    return Printer(variables).derivatives(text)


def latex_name(name: str) -> str:
    r"""A name as LaTeX: Greek letters, the tail as an index, a prime as a dot.

    Example
    -------
    >>> latex_name("tau_f"), latex_name("Nped"), latex_name("p'"), latex_name("rudder")
    ('\\tau_{f}', 'N_{\\mathrm{ped}}', '\\dot{p}', '\\mathrm{rudder}')
    """
    if name.endswith("'"):
        return rf"\dot{{{latex_name(name[:-1])}}}"
    head, _, tail = name.partition("_")
    numbered = _NUMBERED.fullmatch(head)
    if numbered and numbered[1] in _GREEK:
        head, tail = numbered[1], "_".join(filter(None, (numbered[2], tail)))
    if not tail and head not in _GREEK and len(head) > 1 and not _PLAIN_WORD.fullmatch(head):
        head, tail = head[0], head[1:]
    if head in _GREEK:
        head = f"\\{head}"
    elif len(head) > 1:
        head = rf"\mathrm{{{head}}}"
    index = ",".join(map(_index, filter(None, tail.split("_"))))
    return f"{head}_{{{index}}}" if index else head or r"\_"


def _index(text: str) -> str:
    if text in _GREEK:
        return f"\\{text}"
    return text if len(text) == 1 or text.isdigit() else rf"\mathrm{{{text}}}"


def _number(value: float) -> Formula:
    turns = value / math.pi
    if turns == round(turns) and 0.0 < turns <= _TURNS:
        return Formula(r"\pi" if turns == 1.0 else rf"{turns:g} \pi", _PRODUCT, value)
    text = f"{value:.6g}"
    if "e" in text:
        digits, power = text.split("e")
        text = rf"{digits} \cdot 10^{{{int(power)}}}"
    return Formula(text, _SUM if value < 0.0 else _ATOM, value)


def _made(latex: str, level: int, *parts: Formula) -> Formula:
    if len(latex) > MAXIMUM_TERM:
        raise ModelError(
            "a derivative of the model is too long to be shown",
            found=f"{len(latex)} characters",
            needed=f"at most {MAXIMUM_TERM}",
        )
    return Formula(latex, level, names=frozenset().union(*(part.names for part in parts)))


def _bracketed(term: Formula, level: int) -> str:
    return term.latex if term.level >= level else rf"\left({term.latex}\right)"


def _negate(a: Formula) -> Formula:
    if a.number is not None:
        return ZERO if a.number == 0.0 else _number(-a.number)
    if a.latex.startswith("-") and a.level == _PRODUCT:
        return _made(a.latex[1:], _PRODUCT, a)
    return _made("-" + _bracketed(a, _PRODUCT), _PRODUCT, a)


def _add(a: Formula, b: Formula) -> Formula:
    if a.number == 0.0:
        return b
    if b.number == 0.0:
        return a
    if a.number is not None and b.number is not None:
        return _number(a.number + b.number)
    joint = " " if b.latex.startswith("-") else " + "
    return _made(a.latex + joint + b.latex, _SUM, a, b)


def _times(a: Formula, b: Formula) -> Formula:
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
    if b.latex[:1].isdigit() and not a.latex[:1].isdigit():
        a, b = b, a  # a number stands first
    return _made(f"{_bracketed(a, _PRODUCT)} {_bracketed(b, _PRODUCT)}", _PRODUCT, a, b)


def _divide(a: Formula, b: Formula) -> Formula:
    if a.number == 0.0 or b.number == 1.0:
        return a
    if a.latex.startswith("-") and (a.level == _PRODUCT or a.number is not None):
        return _negate(_divide(_negate(a), b))
    return _made(rf"\frac{{{a.latex}}}{{{b.latex}}}", _PRODUCT, a, b)


def _power(a: Formula, b: Formula) -> Formula:
    if b.number == 1.0:
        return a
    if b.number == 0.0:
        return ONE
    base = a.latex if re.fullmatch(r"[A-Za-z0-9.]", a.latex) else rf"\left({a.latex}\right)"
    return _made(f"{base}^{{{b.latex}}}", _ATOM, a, b)


def _call(function: str, *arguments: Formula) -> Formula:
    shown = ", ".join(argument.latex for argument in arguments)
    command = _COMMANDS.get(function, function)
    command = f"\\{command}" if command in _STANDARD else rf"\operatorname{{{command}}}"
    return _made(rf"{command}\left({shown}\right)", _ATOM, *arguments)


_VALUES: dict[str, Callable[..., Formula]] = {
    "negate": _negate,
    "add": _add,
    "subtract": lambda a, b: _add(a, _negate(b)),
    "multiply": _times,
    "divide": _divide,
    "power": _power,
    "less": lambda a, b: _made(f"{a.latex} < {b.latex}", _SUM, a, b),
    "lessequal": lambda a, b: _made(rf"{a.latex} \le {b.latex}", _SUM, a, b),
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
    "minimum": ("where(a <= b, 1, 0)", "where(a <= b, 0, 1)"),
    "maximum": ("where(a >= b, 1, 0)", "where(a >= b, 0, 1)"),
    "less": ("0", "0"),
    "lessequal": ("0", "0"),
}


def _value(kind: str, inner: list[Formula]) -> Formula:
    if kind in _VALUES:
        return _VALUES[kind](*inner)
    return _call(_NAMES.get(kind, kind), *inner)


@cache
def _nodes(text: str) -> list[tuple[str, str, float, list[int]]]:
    return _native.expression_nodes(text)


def _partials(kind: str, inner: list[Formula], value: Formula) -> list[Formula]:
    known = {"a": inner[0], "b": inner[-1], "f": value}
    found = []
    for text in _PARTIALS[kind]:
        terms: list[Formula] = []
        for function, name, number, places in _nodes(text):
            if function == "number":
                terms.append(_number(number))
            elif function == "name":
                terms.append(known[name])
            elif function == "select":
                terms.append(_choice(*(terms[place] for place in places)))
            else:
                terms.append(_value(function, [terms[place] for place in places]))
        found.append(terms[-1])
    return found


def _choice(test: Formula, first: Formula, second: Formula) -> Formula:
    if first == second:
        return first
    rows = rf"{first.latex} & {test.latex} \\ {second.latex} & \text{{otherwise}}"
    return _made(rf"\begin{{cases}} {rows} \end{{cases}}", _ATOM, test, first, second)


def _chosen(test: Formula, first: Slopes, second: Slopes) -> Slopes:
    both = dict.fromkeys([*first, *second])
    return {name: _choice(test, first.get(name, ZERO), second.get(name, ZERO)) for name in both}


def _looked_up(name: str, inner: list[Formula], mark: str = "") -> Formula:
    shown = ", ".join(argument.latex for argument in inner)
    return _made(rf"{mark}\mathrm{{{_plain(name)}}}\left({shown}\right)", _ATOM, *inner)


def _table_partials(name: str, inner: list[Formula], _value: Formula) -> list[Formula]:
    return [
        _looked_up(name, inner, rf"\partial_{{{place}}} ") for place in range(1, len(inner) + 1)
    ]


def _plain(name: str) -> str:
    return name.replace("_", r"\_")
