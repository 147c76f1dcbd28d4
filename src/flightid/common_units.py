"""Units that most logs and models are written in, told without pint, whose loading takes 0.3 s.

Products, quotients, powers and brackets of the symbols below are told here; whatever else, and
whatever lies between two units of unlike kind, is pint's to say.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from functools import cache
from math import pi
from typing import NamedTuple

SYMBOLS = {
    "A": (1.0, {"ampere": 1}),
    "cdeg": (pi / 18000.0, {"radian": 1}),
    "deg": (pi / 180.0, {"radian": 1}),
    "ft": (0.3048, {"meter": 1}),
    "h": (3600.0, {"second": 1}),
    "in": (0.0254, {"meter": 1}),
    "kg": (1.0, {"kilogram": 1}),
    "m": (1.0, {"meter": 1}),
    "mA": (0.001, {"ampere": 1}),
    "ms": (0.001, {"second": 1}),
    "N": (1.0, {"kilogram": 1, "meter": 1, "second": -2}),
    "Pa": (1.0, {"kilogram": 1, "meter": -1, "second": -2}),
    "rad": (1.0, {"radian": 1}),
    "s": (1.0, {"second": 1}),
    "µs": (1e-6, {"second": 1}),
    "V": (1.0, {"ampere": -1, "kilogram": 1, "meter": 2, "second": -3}),
}
"""Factor to SI base units and the radian, and powers of those."""
NAMES = {
    "A": "ampere", "cdeg": "centidegree", "deg": "degree", "ft": "foot", "h": "hour",
    "in": "inch", "kg": "kilogram", "m": "meter", "mA": "milliampere", "ms": "millisecond",
    "N": "newton", "Pa": "pascal", "rad": "radian", "s": "second", "µs": "microsecond", "V": "volt",
}  # fmt: skip
"""By whose order the canonical spelling goes."""
SHORT = {"us": "µs"} | {name: symbol for symbol, name in NAMES.items()}
"""Units that go by their names, and microseconds in plain letters."""
LONGEST = 60
"""Letters from which on pint is asked."""
TOKEN = re.compile(r"\^[1-9]|[*/()1]|[A-Za-zµ]+")
"""A power, a sign, a bracket or a name."""
SPACED = re.compile(r" ?([*/]) ?")


class CommonUnit(NamedTuple):
    """A unit: its canonical spelling, and factor times powers of SI base units and the radian.

    `names` holds powers of the names it is written in, SI units without factor written out.
    """

    text: str
    factor: float
    powers: dict[str, int]
    names: dict[str, int]

    def without_angle(self) -> dict[str, int]:
        """Powers of physical dimension: a radian is a plain number."""
        return {base: power for base, power in self.powers.items() if base != "radian"}


@cache
def common_unit(text: str) -> CommonUnit | None:
    """What a unit of symbols and names stands for; None where pint must say.

    Example
    -------
    >>> common_unit("ft/s^2")[1:]
    (0.3048, {'meter': 1, 'second': -2}, {'foot': 1, 'second': -2})
    >>> common_unit("(radian/second) / (in*s)").text
    'rad/in/s^2'
    >>> common_unit("radian second") is common_unit("g") is None
    True
    """
    if len(text) > LONGEST:
        return None
    tokens = TOKEN.findall(text)
    if "".join(tokens) != SPACED.sub(r"\1", text):
        return None
    symbols = _product(tokens)
    if symbols is None or tokens:
        return None
    return _written(symbols)


def _product(tokens: list[str]) -> dict[str, int] | None:
    """Powers of symbols in the factors that stand first, taken off; None where they are none."""
    found, sign = dict[str, int](), 1
    while True:
        factor = _factor(tokens)
        if factor is None:
            return None
        _add(found, factor, sign)
        if not tokens or tokens[0] not in ("*", "/"):
            return found
        sign = 1 if tokens.pop(0) == "*" else -1


def _factor(tokens: list[str]) -> dict[str, int] | None:
    """A symbol, a name, a one or a bracket, with its power."""
    first = tokens.pop(0) if tokens else ""
    if first == "(":
        found = _product(tokens)
        if found is None or not tokens or tokens.pop(0) != ")":
            return None
    elif first == "1":
        found = {}
    elif (symbol := SHORT.get(first, first)) in SYMBOLS:
        found = {symbol: 1}
    else:
        return None
    power = int(tokens.pop(0)[1:]) if tokens and tokens[0].startswith("^") else 1
    return {symbol: times * power for symbol, times in found.items()}


def _written(symbols: Mapping[str, int]) -> CommonUnit:
    """A unit of powers of symbols, above and below in the order of names."""
    order = sorted(symbols, key=NAMES.__getitem__)
    above = [_power(symbol, symbols[symbol]) for symbol in order if symbols[symbol] > 0]
    below = [_power(symbol, -symbols[symbol]) for symbol in order if symbols[symbol] < 0]
    factor, powers, names = 1.0, dict[str, int](), dict[str, int]()
    for symbol in order:
        size, bases = SYMBOLS[symbol]
        factor *= size ** symbols[symbol]
        _add(powers, bases, symbols[symbol])
        _add(names, bases if size == 1.0 else {NAMES[symbol]: 1}, symbols[symbol])
    text = "/".join(["*".join(above) or "1", *below])
    return CommonUnit(text, factor, powers, names)


def _power(symbol: str, power: int) -> str:
    return symbol if power == 1 else f"{symbol}^{power}"


def _add(total: dict[str, int], powers: Mapping[str, int], times: int) -> None:
    for name, power in powers.items():
        total[name] = total.get(name, 0) + times * power
        if total[name] == 0:
            del total[name]
