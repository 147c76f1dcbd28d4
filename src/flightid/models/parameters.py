"""Parameters of a model: value, unit, bounds, free or fixed, tie to others, note."""

from __future__ import annotations

import math
from collections.abc import ItemsView, Iterable, Iterator, KeysView, Mapping, ValuesView
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from flightid import _native
from flightid.dimensions import require_unit
from flightid.errors import ModelError, UnknownNameError
from flightid.formula import formula_names, require_name
from flightid.frozen import dataclass
from flightid.result import TableView
from flightid.table import Column, Table
from flightid.units import canonical


@dataclass(frozen=True)
class Parameter:
    """One named number of a model.

    Attributes
    ----------
    name : str
        Name as in formulas: letters, digits, underscores.
    value : float or None
        Value, or start of a fit, in `unit`; None where a tie gives it.
    unit : str
        Unit; `"1"` for a plain number.
    minimum, maximum : float
        Bounds of a fit, in `unit`; infinite where open.
    free : bool
        Whether a fit may change it.
    tie : str or None
        Formula of other parameters that gives the value.
    note : str
        What it means, and where the value comes from.

    Example
    -------
    >>> Parameter("Lp", -5.0, "1/s", minimum=-60.0, maximum=0.0, note="roll damping")
    Parameter(Lp = -5 1/s, free in [-60, 0])
    """

    name: str
    value: float | None = None
    unit: str = "1"
    minimum: float = -math.inf
    maximum: float = math.inf
    free: bool = True
    tie: str | None = None
    note: str = ""

    def __post_init__(self) -> None:
        self._check_name()
        object.__setattr__(self, "unit", canonical(self.unit))
        if self.tie is not None:
            object.__setattr__(self, "free", False)
            return
        self._check_numbers()

    def _check_name(self) -> None:
        require_name(self.name, "a parameter")

    def _check_numbers(self) -> None:
        value = self.value
        if value is not None and self.minimum <= value <= self.maximum and math.isfinite(value):
            return  # as nearly all are
        if self.value is None or not math.isfinite(self.value):
            raise ModelError(
                f"parameter {self.name} has no value",
                found=self.value,
                needed="a finite number, or a tie",
            )
        if math.isnan(self.minimum) or math.isnan(self.maximum) or self.minimum > self.maximum:
            raise ModelError(
                f"bounds of parameter {self.name} contradict each other",
                found=f"min {self.minimum:g}, max {self.maximum:g}",
                needed="min at most max",
            )
        if not self.minimum <= self.value <= self.maximum:
            raise ModelError(
                f"value of parameter {self.name} lies outside its bounds",
                found=f"{self.value:g}",
                needed=f"between {self.minimum:g} and {self.maximum:g} {self.unit}",
                action="start inside the bounds, or widen them",
            )

    def with_value(self, value: float) -> Parameter:
        """Copy with another value; of a tied one, what its tie gives.

        Raises
        ------
        ModelError
            The value lies outside the bounds.
        """
        made = object.__new__(type(self))  # a copy: models are made by the thousand
        made.__dict__.update(self.__dict__, value=value)
        if self.tie is None:
            made._check_numbers()
        return made

    @property
    def status(self) -> str:
        """``"free"``, ``"fixed"`` or ``"tied"``."""
        if self.tie is not None:
            return "tied"
        return "free" if self.free else "fixed"

    def __repr__(self) -> str:
        """Name, value, unit and what a fit may do, on one line."""
        shown = "?" if self.value is None else f"{self.value:.6g}"
        unit = "" if self.unit == "1" else f" {self.unit}"
        limits = f" in [{self.minimum:g}, {self.maximum:g}]" if self.free else ""
        tie = f" = {self.tie}" if self.tie else ""
        return f"Parameter({self.name} = {shown}{unit}, {self.status}{tie}{limits})"

    def to_dict(self) -> dict[str, object]:
        """Plain values; an open bound is None."""
        return {
            "value": self.value,
            "unit": self.unit,
            "min": self.minimum if math.isfinite(self.minimum) else None,
            "max": self.maximum if math.isfinite(self.maximum) else None,
            "status": self.status,
            "tie": self.tie,
            "note": self.note,
        }


class Parameters(Mapping[str, Parameter], TableView):
    """Named parameters, checked against each other: ties known, not circular, right in their units.

    Parameters
    ----------
    parameters : iterable of Parameter
        In the order in which results list them.

    Raises
    ------
    ModelError
        A name given twice; a tie that is unknown, circular or wrong in its unit.

    Example
    -------
    >>> both = Parameters([Parameter("Nr", -4.0, "1/s"), Parameter("K", unit="1/s", tie="-2*Nr")])
    >>> both["K"].value
    8.0
    """

    __slots__ = ("_items",)

    def __init__(self, parameters: Iterable[Parameter]) -> None:
        self._items: dict[str, Parameter] = {}
        for parameter in parameters:
            if parameter.name in self._items:
                raise ModelError(f"parameter {parameter.name} is given twice")
            self._items[parameter.name] = parameter
        self._check_ties()
        self._evaluate()

    def _evaluate(self) -> None:
        """Values of tied parameters, and all values as plain floats."""
        known: Iterable[float | None] = (each.value for each in self.values())
        if self.tied:
            known = self.tape(self.names).evaluate(self.independent_values())
        for each, value in zip([*self.values()], known, strict=True):
            if type(each.value) is not float or each.value != value:
                self._items[each.name] = each.with_value(float(value or 0.0))

    def _check_ties(self) -> None:
        units = self.units
        for parameter in self.tied:
            tie = parameter.tie or ""
            for name in formula_names(tie):
                if name not in self._items:
                    raise ModelError(
                        f"tie of parameter {parameter.name} names an unknown parameter",
                        found=repr(name),
                        needed=f"one of {', '.join(self._items)}",
                    )
            require_unit(tie, parameter.unit, units, subject=f"tie of parameter {parameter.name}")

    def __getitem__(self, name: str) -> Parameter:
        try:
            return self._items[name]
        except KeyError:
            raise UnknownNameError(
                "there is no such parameter",
                found=repr(name),
                needed=f"one of {', '.join(self._items)}",
            ) from None

    def __iter__(self) -> Iterator[str]:
        return iter(self._items)

    def __len__(self) -> int:
        return len(self._items)

    def keys(self) -> KeysView[str]:
        """Names; as of any mapping, without asking for each by name."""
        return self._items.keys()

    def values(self) -> ValuesView[Parameter]:
        """Parameters, in order."""
        return self._items.values()

    def items(self) -> ItemsView[str, Parameter]:
        """Names and parameters, in order."""
        return self._items.items()

    def __contains__(self, name: object) -> bool:
        return name in self._items

    def __repr__(self) -> str:
        """Counts on one line."""
        free = sum(parameter.free for parameter in self.values())
        return f"Parameters({len(self)}: {free} free, {', '.join(self)})"

    @property
    def names(self) -> list[str]:
        """All names, in order."""
        return list(self._items)

    @property
    def units(self) -> dict[str, str]:
        """Unit by name."""
        return {name: parameter.unit for name, parameter in self._items.items()}

    @property
    def independent(self) -> list[Parameter]:
        """Parameters without a tie: the inputs of every formula."""
        return [parameter for parameter in self.values() if parameter.tie is None]

    @property
    def free(self) -> list[Parameter]:
        """Parameters that a fit may change."""
        return [parameter for parameter in self.values() if parameter.free]

    @property
    def tied(self) -> list[Parameter]:
        """Parameters given by a tie."""
        return [parameter for parameter in self.values() if parameter.tie is not None]

    @property
    def free_indices(self) -> list[int]:
        """Places of the free parameters among the independent ones."""
        return [i for i, parameter in enumerate(self.independent) if parameter.free]

    @property
    def definitions(self) -> dict[str, str]:
        """Formula by name, of the tied parameters."""
        return {parameter.name: parameter.tie or "" for parameter in self.tied}

    def independent_values(self, values: Mapping[str, float] | None = None) -> NDArray[np.float64]:
        """Values of the independent parameters, some of them replaced.

        Parameters
        ----------
        values : mapping of str to float, optional
            Values by name, in the parameters' units.

        Returns
        -------
        ndarray, shape (n_independent,)

        Raises
        ------
        UnknownNameError
            There is no such parameter.
        ModelError
            A tied parameter was given a value.
        """
        given = dict(values or {})
        for name in given:
            if self[name].tie is not None:
                raise ModelError(
                    f"parameter {name} is tied and cannot be given a value",
                    found=f"{name} = {self[name].tie}",
                    action="give values to the parameters in its tie",
                )
        return np.array([float(given.get(p.name, p.value or 0.0)) for p in self.independent])

    def tape(self, formulas: Iterable[str]) -> _native.Tape:
        """Formulas of these parameters, compiled for the independent ones.

        Returns
        -------
        Tape

        Raises
        ------
        ModelError
            A formula is outside the grammar, names what is unknown, or ties form a circle.
        """
        names = tuple(parameter.name for parameter in self.independent)
        return _compiled(tuple(formulas), names, tuple(self.definitions.items()))

    def with_values(self, values: Mapping[str, float]) -> Parameters:
        """Copy with other values of some independent parameters.

        Raises
        ------
        UnknownNameError
            There is no such parameter.
        ModelError
            A parameter is tied, or a value lies outside its bounds.
        """
        self.independent_values(values)
        made = Parameters.__new__(Parameters)
        # Names, units and ties are those that were checked.
        made._items = {
            p.name: p.with_value(float(values[p.name])) if p.name in values else p
            for p in self.values()
        }
        made._evaluate()
        return made

    def with_parameter(self, parameter: Parameter) -> Parameters:
        """Copy with one parameter replaced by another of the same name.

        Raises
        ------
        UnknownNameError
            There is no parameter of that name.
        """
        _ = self[parameter.name]
        return Parameters(parameter if p.name == parameter.name else p for p in self.values())

    def summary(self) -> Table:
        """Table of all parameters."""
        columns = tuple(
            Column(heading)
            for heading in ("parameter", "value", "unit", "min", "max", "status", "tie", "note")
        )
        rows = []
        for p in self.values():
            low = p.minimum if math.isfinite(p.minimum) else None
            high = p.maximum if math.isfinite(p.maximum) else None
            rows.append((p.name, p.value, p.unit, low, high, p.status, p.tie, p.note))
        return Table("Parameters", columns, tuple(rows))

    def to_dict(self) -> dict[str, object]:
        """Plain values by name."""
        return {name: parameter.to_dict() for name, parameter in self._items.items()}


@lru_cache(maxsize=64)
def _compiled(
    formulas: tuple[str, ...], names: tuple[str, ...], definitions: tuple[tuple[str, str], ...]
) -> _native.Tape:
    """Formulas compiled once for all models whose parameters have the same names and ties."""
    return _native.Tape(list(formulas), list(names), dict(definitions))
