"""Units as canonical strings, checked and converted by pint, at the edges only.

Inside flightid values are SI and radians unless a record or model is labelled otherwise; nothing
converts in silence. Two units *match* when they are the same unit (`deg/s` and `rad/s` do not).
A lone `g` is what its partner makes of it: standard gravity beside an acceleration, a load factor
beside a plain number, a gram beside a mass.
"""

from __future__ import annotations

import re
from functools import cache
from typing import TYPE_CHECKING

import numpy as np

from flightid.common_units import common_unit
from flightid.errors import UnitError

if TYPE_CHECKING:
    import pint
    from numpy.typing import ArrayLike, NDArray

DIMENSIONLESS = "1"
GRAM, GRAVITY = "gram", "standard_gravity"
SPELLINGS = {
    "gn": "g0",
    "gs": "g0",
    "g's": "g0",
    "KTS": "kt",
    "KT": "kt",
    "KIAS": "kt",
    "KTAS": "kt",
    "KEAS": "kt",
    "KCAS": "kt",
    "dps": "deg/s",
    "DPS": "deg/s",
    "DEG": "deg",
    "DEG/S": "deg/s",
    "DEG/SEC": "deg/s",
    "Deg": "deg",
    "Deg/s": "deg/s",
    "RPM": "rpm",
    "ft-lb": "ft*lbf",
    "ft-lbf": "ft*lbf",
    "fps": "ft/s",
    "fpm": "ft/min",
    "mps": "m/s",
    "nd": "1",
    "pct": "%",
    "psf": "lbf/ft^2",
    "pu": "1",
}
"""Spellings of logs and test reports that pint does not read, or reads as something else."""
KNOT = re.compile(r"(?<![A-Za-z])kn(?![A-Za-z])")
"""Pint's symbol of a knot; aircraft's manuals and logs have kt."""
LONGEST = 100
"""Letters of a unit; what is longer is none."""
DIGIT_POWER = re.compile(r"(?<![A-Za-z_0-9])(s|sec|m|ft|in|kg|rad|deg|slug)([2-4])(?![A-Za-z_0-9])")
"""A power without its sign, as in ``ft/s2``."""


@cache
def _registry() -> pint.UnitRegistry[float]:
    # pint takes a third of a second to load: only work with units pays for it.
    import pint  # noqa: PLC0415

    registry: pint.UnitRegistry[float] = pint.UnitRegistry(autoconvert_offset_to_baseunit=True)
    registry.define("percent = 0.01 = %") if "percent" not in registry else None
    return registry


@cache
def _parse(unit: str) -> pint.Unit:
    text = unit.strip()
    text = DIGIT_POWER.sub(r"\1^\2", SPELLINGS.get(text, text))
    if text in ("", "1", "-"):
        return _registry().dimensionless
    try:
        if len(text) > LONGEST:  # pint takes the square of its length to read it
            raise ValueError(f"a unit of {len(text)} letters")
        return _registry().parse_units(text)
    except Exception as error:
        raise UnitError(
            "unit is not known",
            found=repr(unit[:LONGEST]),
            needed="a unit such as 'rad/s', 'deg', 'ft/s^2', 'm/s', 'V' or '1'",
            action="correct the spelling, or declare '1' for a number without unit",
        ) from error


def _pair(source: str, target: str) -> tuple[pint.Unit, pint.Unit]:
    """Both units, a lone gram read as gravity or as a load factor where the other is no mass."""
    first, second = _parse(source), _parse(target)
    return _beside(first, second), _beside(second, first)


def _beside(unit: pint.Unit, other: pint.Unit) -> pint.Unit:
    registry = _registry()
    gram, gravity = registry.Unit(GRAM), registry.Unit(GRAVITY)
    if unit in (gram, gravity) and other == registry.dimensionless:
        return registry.dimensionless
    if unit == gram and other.dimensionality == gravity.dimensionality:
        return gravity
    return unit


@cache
def canonical(unit: str) -> str:
    """Write a unit in flightid's one spelling.

    Parameters
    ----------
    unit : str
        Any spelling that pint reads; `""`, `"-"` and `"1"` mean dimensionless.

    Returns
    -------
    str
        Canonical spelling, for example ``"rad/s"``.

    Raises
    ------
    UnitError
        The unit is not known.

    Example
    -------
    >>> canonical("radian / second"), canonical("ft/s**2"), canonical("")
    ('rad/s', 'ft/s^2', '1')
    >>> canonical("knots"), canonical("kn/s")
    ('kt', 'kt/s')
    """
    if (known := common_unit(unit)) is not None:
        return known.text
    parsed = _parse(unit)
    if parsed == _registry().dimensionless:
        return DIMENSIONLESS
    return KNOT.sub("kt", f"{parsed:~C}".replace("**", "^"))


def conversion_factor(source: str, target: str) -> float:
    """Multiplier that takes values in `source` to values in `target`.

    Parameters
    ----------
    source, target : str
        Units of the same dimension, without offset (use `convert` for temperatures).

    Returns
    -------
    float
        Dimensionless factor.

    Raises
    ------
    UnitError
        The dimensions differ; the message names both units.

    Example
    -------
    >>> round(conversion_factor("deg/s", "rad/s"), 9)
    0.017453293
    """
    return float(convert(1.0, source, target)) - float(convert(0.0, source, target))


def convert(values: ArrayLike, source: str, target: str) -> NDArray[np.float64]:
    """Convert values from one unit to another of the same dimension.

    Parameters
    ----------
    values : array_like
        Values in `source`, any shape.
    source, target : str
        Units.

    Returns
    -------
    ndarray
        Values in `target`, same shape.

    Raises
    ------
    UnitError
        The dimensions differ; the message names both units.

    Example
    -------
    >>> convert([180.0], "deg", "rad")
    array([3.14159265])
    >>> convert([1.0], "g", "m/s^2"), convert([1.0], "g", "1")
    (array([9.80665]), array([1.]))
    """
    one, two = common_unit(source), common_unit(target)
    if one is not None and two is not None and one.without_angle() == two.without_angle():
        factor = 1.0 if source == target else one.factor / two.factor
        return np.asarray(values, dtype=np.float64) * factor
    registry = _registry()
    first, second = _pair(source, target)
    quantity = registry.Quantity(np.asarray(values, dtype=np.float64), first)
    try:
        return np.asarray(quantity.to(second).magnitude, dtype=np.float64)
    except Exception as error:
        raise UnitError(
            "units do not have the same dimension", found=source, needed=target
        ) from error


def same_dimension(first: str, second: str) -> bool:
    """Tell whether values in one unit could be converted to the other.

    Example
    -------
    >>> same_dimension("deg", "rad"), same_dimension("ft", "s")
    (True, False)
    """
    known, other = common_unit(first), common_unit(second)
    if known is not None and other is not None:
        return known.without_angle() == other.without_angle()
    one, two = _pair(first, second)
    return bool(one.dimensionality == two.dimensionality)


@cache
def is_convertible(source: str, target: str) -> bool:
    """Tell whether a factor between two stated units is safe: same dimension, and same angle.

    A number without unit may stand for anything, and a cycle for a radian, so neither counts.

    Example
    -------
    >>> is_convertible("deg/s", "rad/s"), is_convertible("1", "rad"), is_convertible("Hz", "rad/s")
    (True, False, False)
    """
    known, other = common_unit(source), common_unit(target)
    if known is not None and other is not None:
        return DIMENSIONLESS not in (source, target) and known.powers == other.powers
    one, two = _pair(source, target)
    plain = _registry().dimensionless
    return plain not in (one, two) and _in_base(one)[1] == _in_base(two)[1]


def clash(channel: str, found: str, needed: str, *, where: str, record: str = "") -> UnitError:
    """The error for a channel in another unit than is needed, with what to do about it.

    Parameters
    ----------
    channel : str
    found, needed : str
        Units.
    where : str
        Who needs it, for example ``"than in the model"``.
    record : str
        Where the channel is, where that is known.

    Example
    -------
    >>> str(clash("um", "1", "ft/s", where="than in the model")).split(":")[0]
    "channel 'um' has another unit than in the model"
    """
    action = (
        f"convert it: in a study with units of a [[conditioning]], in Python with "
        f"Record.to_units({channel}={needed!r}), or in the file, headed '{channel} [{needed}]'"
    )
    if canonical(found) == DIMENSIONLESS:
        found = f"{DIMENSIONLESS} (no unit is known)"
        action = (
            f"say its unit: head the column '{channel} [{needed}]' in the file, or read it with "
            f"units={{{channel!r}: {needed!r}}}"
        )
    of = f" of record {record!r}" if record else ""
    return UnitError(
        f"channel {channel!r}{of} has another unit {where}",
        found=found,
        needed=needed,
        action=action,
    )


def require_match(channel: str, found: str, needed: str, *, record: str = "") -> None:
    """Refuse a channel whose unit is not the very unit needed; a load factor may be in g.

    Raises
    ------
    UnitError
        The units differ; see `clash`.

    Example
    -------
    >>> require_match("p", "rad/s", "radian/second")
    """
    if not match(found, needed):
        raise clash(
            channel, canonical(found), canonical(needed), where="than is needed", record=record
        )


def match(found: str, needed: str) -> bool:
    """Whether two units are the same, or a load factor in g and a plain number.

    Example
    -------
    >>> match("g", "1"), match("g", "m/s^2"), match("deg/s", "rad/s")
    (True, False, False)
    """
    known, other = common_unit(found), common_unit(needed)
    if known is not None and other is not None:
        return known.text == other.text
    one, two = _pair(found, needed)
    return bool(one == two)


@cache
def exponents(unit: str) -> dict[str, float]:
    """Powers of the names that a unit is written in; the radian counts as a plain number.

    Units that are products of SI base units without a factor are written out.

    Returns
    -------
    dict of str to float

    Raises
    ------
    UnitError
        The unit is not known.

    Example
    -------
    >>> exponents("ft/s^2"), exponents("rad/s"), exponents("N*m/W")
    ({'foot': 1.0, 'second': -2.0}, {'second': -1.0}, {'second': 1.0})
    """
    if (known := common_unit(unit)) is not None:
        return {name: float(n) for name, n in known.names.items() if name != "radian"}
    registry = _registry()
    result: dict[str, float] = {}
    for name, power in registry.Quantity(1.0, _parse(unit)).unit_items():
        # A newton is written out, since it is exactly kg m/s²; a foot is not a metre.
        written = registry.Quantity(1.0, registry.Unit(str(name)))
        in_base = written.to_base_units()
        chosen = in_base if in_base.magnitude == 1.0 else written
        for base, inner in chosen.unit_items():
            total = result.get(str(base), 0.0) + float(str(power)) * float(str(inner))
            result[str(base)] = total
    return {name: power for name, power in result.items() if name != "radian" and power != 0.0}


@cache
def si_base(unit: str) -> tuple[float, dict[str, float]]:
    """A unit as a factor times powers of SI base units and the radian.

    Returns
    -------
    tuple of float and dict of str to float

    Raises
    ------
    UnitError
        The unit is not known.

    Example
    -------
    >>> si_base("N*m/W"), si_base("ft")
    ((1.0, {'second': 1.0}), (0.3048, {'meter': 1.0}))
    """
    if (known := common_unit(unit)) is not None:
        return round_off(known.factor), {name: float(n) for name, n in known.powers.items()}
    return _in_base(_parse(unit))


def _in_base(unit: pint.Unit) -> tuple[float, dict[str, float]]:
    found = _registry().Quantity(1.0, unit).to_base_units()
    powers = {str(name): float(str(power)) for name, power in found.unit_items()}
    return round_off(float(found.magnitude)), powers


def round_off(factor: float) -> float:
    """A factor without the last digits that its computation left: 0.3048, not 0.30479999999999996.

    Example
    -------
    >>> round_off(0.30479999999999996)
    0.3048
    """
    return float(f"{factor:.15g}")
