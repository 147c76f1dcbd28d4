"""What every model with parameters can do: copies with other values, fixed, free or tied ones."""

from __future__ import annotations

from collections.abc import Mapping
from copy import copy
from dataclasses import replace
from typing import Any, Self, cast

from flightid.models.parameters import Parameters


class Adjustable:
    """Base of frozen models that hold `parameters`; a copy with others is no fit's any more."""

    parameters: Parameters

    def _with_parameters(self, parameters: Parameters) -> Self:
        # Every model is a dataclass; this base alone is not.
        return cast("Self", replace(cast("Any", self), parameters=parameters, estimated=None))

    def with_values(self, values: Mapping[str, float]) -> Self:
        """Copy with other parameter values.

        Raises
        ------
        UnknownNameError
            There is no such parameter.
        ModelError
            A parameter is tied, or a value lies outside its bounds.
        """
        # Equations and formulas hold names alone: they stay checked and compiled.
        made = copy(self)
        object.__setattr__(made, "parameters", self.parameters.with_values(values))
        object.__setattr__(made, "estimated", None)
        return made

    def with_fixed(self, **values: float) -> Self:
        """Copy with parameters fixed at values, given as ``name=value``."""
        changed = self.parameters
        for name, value in values.items():
            changed = changed.with_parameter(
                replace(changed[name], value=value, free=False, tie=None)
            )
        return self._with_parameters(changed)

    def with_free(self, *names: str) -> Self:
        """Copy with parameters free, tied ones without their tie."""
        changed = self.parameters
        for name in names:
            changed = changed.with_parameter(replace(changed[name], free=True, tie=None))
        return self._with_parameters(changed)

    def with_tie(self, name: str, formula: str) -> Self:
        """Copy with one parameter given by a formula of others.

        Raises
        ------
        ModelError
            The formula is outside the grammar, circular, or wrong in its unit.
        """
        tied = replace(self.parameters[name], tie=formula, value=None)
        return self._with_parameters(self.parameters.with_parameter(tied))
