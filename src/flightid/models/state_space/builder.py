"""Models built in Python, line by line, from formulas as text or as SymPy objects."""

from __future__ import annotations

from typing import Any, Self

from flightid.errors import ModelError
from flightid.models.language.sympy_input import is_sympy, sympy_formula, sympy_sides
from flightid.models.state_space.model import StateSpaceModel


class ModelBuilder:
    """A state-space model in the making; each call adds a line and returns the builder.

    Formulas are text in the grammar of model files, or SymPy expressions.

    Parameters
    ----------
    name : str
        Name of the model.
    source, note : str, optional
        Where it comes from, what to know.

    Reference
    ---------
    The grammar: see `flightid.StateSpaceModel`.

    Example
    -------
    >>> roll = (
    ...     ModelBuilder("roll with servo")
    ...     .state("p", "rad/s")
    ...     .input("lat")
    ...     .parameter("Lp", -4.0, "1/s", min=-60.0, max=0.0, note="roll damping")
    ...     .parameter("Llat", 20.0, "rad/s^2")
    ...     .equation("p'", "Lp*p + Llat*lat")
    ...     .output("p")
    ...     .block("servo", at="lat", kind="first_order_lag", T=0.05)
    ...     .build())
    >>> roll
    StateSpaceModel('roll with servo', 2 states, 1 input, 1 output, 3 parameters, 2 free)
    """

    def __init__(self, name: str, *, source: str = "", note: str = "") -> None:
        self._content: dict[str, Any] = {"name": name, "source": source, "note": note}

    def _add(self, table: str, name: object, entry: object) -> Self:
        key = sympy_formula(name, f"a name in {table}") if is_sympy(name) else str(name)
        entries = self._content.setdefault(table, {})
        if key in entries:
            raise ModelError(f"{table} holds {key!r} already")
        entries[key] = entry
        return self

    def state(self, name: object, unit: str = "1") -> Self:
        """A state with its unit.

        Raises
        ------
        ModelError
            It is there already.
        """
        return self._add("states", name, unit)

    def input(self, name: object, unit: str = "1", *, delay: object = None) -> Self:
        """An input with its unit, and a formula of its delay, s.

        Raises
        ------
        ModelError
            It is there already.
        """
        if delay is not None:
            self._add("delays", name, delay)
        return self._add("inputs", name, unit)

    def parameter(
        self,
        name: object,
        value: float | None = None,
        unit: str = "1",
        *,
        min: float | None = None,
        max: float | None = None,
        fixed: bool = False,
        tie: object = None,
        note: str = "",
    ) -> Self:
        """A parameter; `tie` is a formula of others that gives its value.

        Raises
        ------
        ModelError
            It is there already.
        """
        if tie is not None:
            self._add("constraints", name, tie)
        given = {"value": value, "min": min, "max": max}
        numbers = {key: number for key, number in given.items() if number is not None}
        return self._add(
            "parameters", name, {**numbers, "unit": unit, "fixed": fixed, "note": note}
        )

    def constant(self, name: object, value: float, unit: str = "1", *, note: str = "") -> Self:
        """A fixed parameter.

        Raises
        ------
        ModelError
            It is there already.
        """
        return self._add("constants", name, {"value": value, "unit": unit, "note": note})

    def define(self, name: object, expression: object, unit: str = "1") -> Self:
        """An auxiliary quantity that formulas may name.

        Raises
        ------
        ModelError
            It is there already.
        """
        return self._add("definitions", name, {"expression": expression, "unit": unit})

    def equation(self, left: object, right: object = None) -> Self:
        """An equation: two sides, or one SymPy ``Eq``.

        Raises
        ------
        ModelError
            The left side is there already, or it is no equation.
        """
        if right is None:
            left, right = sympy_sides(left)
        return self._add("equations", left, right)

    def output(self, name: object, expression: object = None, unit: str | None = None) -> Self:
        """An output: a state by its name, or a formula with its unit.

        Raises
        ------
        ModelError
            It is there already.
        """
        formula = name if expression is None else expression
        entry = {"expression": formula} if unit is None else {"expression": formula, "unit": unit}
        return self._add("outputs", name, entry)

    def table(self, name: str, description: dict[str, object]) -> Self:
        """A table that formulas may call; the keys are those of model files.

        Raises
        ------
        ModelError
            It is there already.
        """
        return self._add("tables", name, description)

    def block(self, name: str, *, at: object, kind: str, **values: object) -> Self:
        """An actuator at an input, a sensor or filter at an output.

        Raises
        ------
        ModelError
            It is there already.
        """
        return self._add("blocks", name, {"at": str(at), "kind": kind, **values})

    def trim(self, **values: float) -> Self:
        """Point of linearisation.

        Raises
        ------
        ModelError
            A value is there already.
        """
        for name, value in values.items():
            self._add("trim", name, value)
        return self

    def initial(self, name: object, value: float = 0.0, **options: object) -> Self:
        """An initial state that each record has for itself: ``min``, ``max``, ``free``.

        Raises
        ------
        ModelError
            It is there already.
        """
        return self._add("initial", name, {"value": value, **options})

    def bias(self, name: object, value: float = 0.0, **options: object) -> Self:
        """A bias of an output, or shift of an input, of each record: ``min``, ``max``, ``free``.

        Raises
        ------
        ModelError
            It is there already.
        """
        return self._add("biases", name, {"value": value, **options})

    def __repr__(self) -> str:
        """What is there so far, on one line."""
        counts = {key: len(table) for key, table in self._content.items() if key not in _TEXTS}
        listed = ", ".join(f"{count} {key}" for key, count in counts.items())
        return f"ModelBuilder({self._content['name']!r}: {listed or 'empty'})"

    def build(self) -> StateSpaceModel:
        """The model, checked and compiled.

        Raises
        ------
        ModelError
            The model contradicts itself; the message names the equation and both units.
        """
        return StateSpaceModel.from_dict(self._content)


_TEXTS = ("name", "source", "note")
