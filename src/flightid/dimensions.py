"""Units of formulas, found by walking the parsed formula (native: `expression.rs`).

Plain numbers have no unit, except zero, which has any. Radians count as plain numbers, degrees do
not: an angle in degrees clashes with one in radians and may not stand inside a sine.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Mapping, Sequence
from itertools import combinations, product
from typing import Protocol

from flightid import _native
from flightid.errors import ModelError, UnitError
from flightid.units import canonical, exponents, si_base


class _UnitBearer(Protocol):
    """What has a unit."""

    @property
    def unit(self) -> str: ...


class _Table(_UnitBearer, Protocol):
    """A table that formulas call; see `flightid.models.language.tables`."""

    @property
    def axes(self) -> Sequence[_UnitBearer]: ...


Powers = dict[str, float]
Tables = Mapping[str, _Table]
_NO_TABLES: Tables = {}
_SAME = 1e-9
_ALIKE = {"add": "adds", "subtract": "subtracts", "minimum": "compares", "maximum": "compares"}
_ALIKE |= {"atan2": "compares", "less": "compares", "lessequal": "compares"}
_PLAIN = {"atan2", "less", "lessequal"}
_KEPT = {"negate", "abs"}


class _ClashError(Exception):
    """What a formula does with which units."""


def require_unit(
    text: str, unit: str, units: Mapping[str, str], *, subject: str, tables: Tables = _NO_TABLES
) -> None:
    """Refuse a formula whose value does not have the unit that it should have.

    Parameters
    ----------
    text : str
        Formula.
    unit : str
        Unit its value should have.
    units : mapping of str to str
        Unit by name, of every name in the formula.
    subject : str
        What the formula is, for the message.
    tables : mapping of str to TableFunction
        Tables that it may call.

    Raises
    ------
    ModelError
        Names, numbers and functions in the formula do not combine to the unit; both are named.

    Example
    -------
    >>> require_unit("1/T", "rad/s", {"T": "s"}, subject="tie of omega")
    """
    found, wanted = _powers(text, units, subject, tables), exponents(unit)
    if found is not None and not _same(found, wanted):
        raise ModelError(
            f"{subject} does not have its unit: {text!r}",
            found=repr(_in_words_of(found, (unit, *units.values()))),
            needed=repr(canonical(unit)),
            action="correct the units of the parameters, or the formula",
        )


def unit_of(text: str, units: Mapping[str, str], *, subject: str) -> str:
    """Unit of a formula; that of zero is ``"1"``.

    Raises
    ------
    ModelError
        The formula mixes units.

    Example
    -------
    >>> unit_of("2*zeta*omega", {"zeta": "1", "omega": "rad/s"}, subject="a coefficient")
    '1/s'
    """
    return _shown(_powers(text, units, subject, _NO_TABLES) or {})


def require_balance(
    left: str,
    right: str,
    units: Mapping[str, str],
    *,
    subject: str,
    tables: Tables = _NO_TABLES,
) -> None:
    """Refuse an equation whose sides have different units.

    Parameters
    ----------
    left, right : str
        Formulas of both sides.
    units : mapping of str to str
        Unit by name, of every name in them.
    subject : str
        Which equation it is, for the message.
    tables : mapping of str to TableFunction
        Tables that they may call.

    Raises
    ------
    ModelError
        The units of the sides differ, or a side mixes units; both units are named.

    Example
    -------
    >>> require_balance("T*x'", "-x", {"T": "s", "x": "m", "x'": "m/s"}, subject="equation of x")
    """
    first = _powers(left, units, subject, tables)
    second = _powers(right, units, subject, tables)
    if first is not None and second is not None and not _same(first, second):
        raise ModelError(
            f"{subject} has different units on its sides: {left} = {right}",
            found=" = ".join(repr(_in_words_of(side, units.values())) for side in (first, second)),
            needed="the same unit on both sides",
            action="correct the units of the parameters, or the equation",
        )


def _powers(text: str, units: Mapping[str, str], subject: str, tables: Tables) -> Powers | None:
    """Powers of the base units of a formula; None for zero, which has any unit."""
    found: list[Powers | None] = []
    numbers: list[float | None] = []
    try:
        for kind, name, value, places in _native.expression_nodes(text, list(tables)):
            inner = [found[place] for place in places]
            constants = [numbers[place] for place in places]
            numbers.append(value if kind == "number" else _constant(kind, constants))
            if kind == "number":
                found.append(None if value == 0.0 else {})
            elif kind == "name":
                found.append(exponents(units[name]))
            elif kind == "table":
                found.append(_looked_up(name, tables[name], inner))
            else:
                found.append(_combine(kind, inner, constants))
    except _ClashError as clash:
        raise ModelError(
            f"{subject} does not have its unit: {text!r}",
            found=f"a formula that {clash}",
            needed="units that go together",
            action="correct the units of the parameters, or the formula",
        ) from None
    return found[-1]


def _constant(kind: str, values: list[float | None]) -> float | None:
    """Number of a constant exponent such as -2 or 1/3."""
    if any(value is None for value in values):
        return None
    numbers = [value for value in values if value is not None]
    if kind == "negate":
        return -numbers[0]
    if kind == "divide" and numbers[1] != 0.0:
        return numbers[0] / numbers[1]
    return None


def _looked_up(name: str, table: _Table, inner: list[Powers | None]) -> Powers:
    if len(inner) != len(table.axes):
        raise _ClashError(f"calls table {name} with {len(inner)} values for {len(table.axes)} axes")
    for powers, axis in zip(inner, table.axes, strict=True):
        if powers is not None and not _same(powers, exponents(axis.unit)):
            raise _ClashError(
                f"calls table {name} with {_shown(powers)!r} along an axis in {axis.unit!r}"
            )
    return exponents(table.unit)


def _combine(kind: str, inner: list[Powers | None], numbers: list[float | None]) -> Powers | None:
    if kind in _ALIKE:
        shared = _shared(_ALIKE[kind], inner)
        return {} if kind in _PLAIN else shared
    if kind == "select":
        if inner[0]:
            raise _ClashError(f"asks whether {_shown(inner[0])!r} holds, which is no comparison")
        return _shared("chooses between", inner[1:])
    if kind in _KEPT:
        return inner[0]
    if kind in ("sqrt", "power"):
        return _power([inner[0], {}], 0.5) if kind == "sqrt" else _power(inner, numbers[1])
    if kind in ("multiply", "divide"):
        first, second = inner
        known = first is not None and second is not None
        sign = 1.0 if kind == "multiply" else -1.0
        found = _product(first or {}, second or {}, sign)
        return None if not known else {} if _same(found, {}) else found
    if kind != "sign" and inner[0]:
        raise _ClashError(f"takes {kind} of {_shown(inner[0])!r}, which is neither '1' nor 'rad'")
    return {}


def _shared(does: str, inner: list[Powers | None]) -> Powers | None:
    known = [powers for powers in inner if powers is not None]
    if len(known) == 2 and not _same(*known):
        raise _ClashError(f"{does} {_shown(known[0])!r} and {_shown(known[1])!r}")
    return known[0] if known else None


def _power(inner: list[Powers | None], exponent: float | None) -> Powers | None:
    base, raised = inner
    if raised:
        raise _ClashError(f"has an exponent in {_shown(raised)!r}, which is not '1'")
    if base is None or not base:
        return base
    if exponent is None:
        raise _ClashError(f"raises {_shown(base)!r} to a power that is not a plain number")
    return _scaled(base, exponent)


def _scaled(powers: Powers, factor: float) -> Powers:
    return {base: power * factor for base, power in powers.items() if power * factor != 0.0}


def _product(first: Powers, second: Powers, sign: float) -> Powers:
    bases = [*first, *(base for base in second if base not in first)]
    sums = {base: first.get(base, 0.0) + sign * second.get(base, 0.0) for base in bases}
    return {base: power for base, power in sums.items() if abs(power) > _SAME}


def _same(first: Powers, second: Powers) -> bool:
    """Whether two units are one: lbf is slug ft/s², but a foot is no metre.

    Example
    -------
    >>> _same(exponents("lbf"), exponents("slug*ft/s^2")), _same(exponents("ft"), exponents("m"))
    (True, False)
    """
    rest = _product(first, second, -1.0)
    logarithm, powers = 0.0, Powers()
    for name, power in rest.items():
        factor, base = si_base(name)
        logarithm += power * math.log(factor)
        powers = _product(powers, base, power)
    return abs(logarithm) < _SAME and not set(powers) - {"radian"}


def _in_words_of(powers: Powers, units: Iterable[str]) -> str:
    """A unit as a product of powers of the units that a model speaks of, such as volt.

    Example
    -------
    >>> _in_words_of({**{n: 2 * p for n, p in exponents("V").items()}, "second": -8.0}, ["V", "s"])
    'V^2/s^2'
    """
    if len(powers) < 2:
        return _shown(powers)
    atoms = _atoms(units)
    for count in (1, 2):
        for chosen in combinations(atoms, count):
            for given in product((1, -1, 2, -2, 3, -3), repeat=count):
                rest = powers
                for atom, power in zip(chosen, given, strict=True):
                    rest = _product(rest, _scaled(atoms[atom], power), -1.0)
                if set(rest) <= {"second"}:
                    left = dict(zip(chosen, map(float, given), strict=True))
                    seconds = rest.get("second", 0.0)
                    return _shown({**left, **({"second": seconds} if seconds else {})})
    return _shown(powers)


def _atoms(units: Iterable[str]) -> dict[str, Powers]:
    """Names of units that are more than a base unit, such as volt, with their powers."""
    found: dict[str, Powers] = {}
    for unit in units:
        for name in re.findall(r"[A-Za-z]+", canonical(unit)):
            try:
                powers = exponents(name)
            except UnitError:
                continue
            if len(powers) > 1:
                found[name] = powers
    return found


def _shown(powers: Powers) -> str:
    return canonical(" * ".join(f"{base}**{power:.6g}" for base, power in powers.items()))
