"""Formulas in model files: their names and their units (native: `expression.rs`, `tape.rs`).

Units are checked by scaling: where every quantity is rewritten in units k times smaller, a formula
that is right in its units changes by exactly the power of k that its own unit demands. Plain
numbers in a formula have no unit. Radians count as plain numbers, degrees do not.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from flightid import _native
from flightid.errors import ModelError
from flightid.units import exponents

FUNCTIONS = frozenset(
    ("sin", "cos", "tan", "asin", "acos", "atan", "sinh", "cosh", "tanh", "exp", "log", "sqrt")
) | {"abs", "sign", "atan2", "min", "max"}
RESERVED = FUNCTIONS | {"pi", "s"}
_TRIALS = 5
_SCALE = 1.7
_ROUNDING = 1e-9


def formula_names(text: str) -> list[str]:
    """Names that occur in a formula, in order.

    Parameters
    ----------
    text : str
        Formula in the grammar of model files.

    Returns
    -------
    list of str

    Raises
    ------
    ModelError
        The text is outside the grammar; the message gives the place.

    Example
    -------
    >>> formula_names("2*zeta*omega + sin(a)^2")
    ['zeta', 'omega', 'a']
    """
    return _native.expression_names(text)


def require_unit(text: str, unit: str, units: Mapping[str, str], *, subject: str) -> None:
    """Refuse a formula whose value cannot have the unit that it should have.

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

    Raises
    ------
    ModelError
        Names, numbers and functions in the formula do not combine to the unit.

    Example
    -------
    >>> require_unit("1/T", "rad/s", {"T": "s"}, subject="tie of omega")
    """
    names = formula_names(text)
    powers = {name: exponents(units[name]) for name in names}
    wanted = exponents(unit)
    bases = sorted({base for each in [*powers.values(), wanted] for base in each})
    tape = _native.Tape([text], names, {})
    for base in bases:
        scaling = np.array([_SCALE ** powers[name].get(base, 0.0) for name in names])
        if not _scales(tape, scaling, _SCALE ** wanted.get(base, 0.0)):
            with_units = ", ".join(f"{name} [{units[name]}]" for name in names)
            raise ModelError(
                f"{subject} does not have its unit: {text!r}",
                found=with_units or "numbers without unit",
                needed=f"a combination that gives {unit!r}",
                action="correct the units of the parameters, or the formula",
            )


def _scales(tape: _native.Tape, scaling: np.ndarray, expected: float) -> bool:
    generator = np.random.default_rng(1)
    for _ in range(_TRIALS):
        values = generator.uniform(0.5, 2.0, len(scaling))
        try:
            before = tape.evaluate(values)[0]
            after = tape.evaluate(values * scaling)[0]
        except ValueError:
            continue  # outside the domain of a logarithm or root: another point decides
        if abs(after - expected * before) > _ROUNDING * (abs(after) + abs(expected * before)):
            return False
    return True
