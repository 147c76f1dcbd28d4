"""Coefficients of black boxes as named parameters."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

from flightid.errors import UnknownNameError
from flightid.frozen import dataclass
from flightid.models.parameters import Parameter


@dataclass(frozen=True, repr=False)
class Coefficient(Parameter):
    """A free number of a black box, named by lag, entry or term.

    Example
    -------
    >>> Coefficient("b1[voltage]", 0.5, "deg/V")
    Parameter(b1[voltage] = 0.5 deg/V, free in [-inf, inf])
    """

    def _check_name(self) -> None:
        """No formula names it, so it may be any text."""


def coefficients(
    names: Sequence[str], values: Iterable[float], units: Sequence[str]
) -> Mapping[str, Parameter]:
    """Coefficients by name.

    Example
    -------
    >>> coefficients(["a1"], [-0.5], ["1"])["a1"].value
    -0.5
    """
    rows = zip(names, values, units, strict=True)
    return {name: Coefficient(name, float(value), unit) for name, value, unit in rows}


def replaced(parameters: Mapping[str, Parameter], values: Mapping[str, float]) -> list[float]:
    """Values of all coefficients in order, some of them replaced.

    Raises
    ------
    UnknownNameError
        There is no such coefficient.

    Example
    -------
    >>> replaced(coefficients(["a1", "b1"], [-0.5, 2.0], ["1", "1"]), {"b1": 3.0})
    [-0.5, 3.0]
    """
    numbers = {name: item.value or 0.0 for name, item in parameters.items()}
    return replaced_numbers(numbers, values)


def replaced_numbers(numbers: Mapping[str, float], values: Mapping[str, float]) -> list[float]:
    """The same of plain numbers.

    Raises
    ------
    UnknownNameError
        There is no such coefficient.

    Example
    -------
    >>> replaced_numbers({"a1": -0.5, "b1": 2.0}, {"b1": 3.0})
    [-0.5, 3.0]
    """
    for name in values:
        if name not in numbers:
            raise UnknownNameError(
                "there is no such coefficient",
                found=repr(name),
                needed=f"one of {', '.join(numbers)}"[:300],
            )
    return [float(values.get(name, number)) for name, number in numbers.items()]
