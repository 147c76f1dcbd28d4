"""Units that most logs and models are written in, told without pint, whose loading takes 0.3 s.

Only a unit in flightid's own spelling is told here; whatever else, and whatever lies between two
units of unlike kind, is pint's to say.
"""

from __future__ import annotations

import re
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
FACTOR = re.compile(r"([*/]|^1/|^)([A-Za-zµ]+)(?:\^([2-9]))?")


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
    """What a unit in its canonical spelling or by its name stands for; None where pint must say.

    Example
    -------
    >>> common_unit("ft/s^2")[1:]
    (0.3048, {'meter': 1, 'second': -2}, {'foot': 1, 'second': -2})
    >>> common_unit("radian / second") is common_unit("s*rad") is common_unit("g") is None
    True
    """
    if text == "1":
        return CommonUnit(text, 1.0, {}, {})
    if text in SHORT:
        return common_unit(SHORT[text])
    parts = list(FACTOR.finditer(text))
    if text[:1] in "*/" or "".join(part[0] for part in parts) != text:
        return None
    if any(part[2] not in SYMBOLS for part in parts):
        return None
    above = [part[2] for part in parts if part[1] in ("", "*")]
    below = [part[2] for part in parts if part[1] not in ("", "*")]
    order = [*sorted(above, key=NAMES.__getitem__), *sorted(below, key=NAMES.__getitem__)]
    if order != [part[2] for part in parts] or len(set(order)) < len(order):
        return None
    factor, powers, names = 1.0, dict[str, int](), dict[str, int]()
    for part in parts:
        power = int(part[3] or 1) * (1 if part[1] in ("", "*") else -1)
        size, bases = SYMBOLS[part[2]]
        factor *= size**power
        _add(powers, bases, power)
        _add(names, bases if size == 1.0 else {NAMES[part[2]]: 1}, power)
    return CommonUnit(text, factor, powers, names)


def _add(total: dict[str, int], powers: dict[str, int], times: int) -> None:
    for name, power in powers.items():
        total[name] = total.get(name, 0) + times * power
        if total[name] == 0:
            del total[name]
