"""Inputs stand before the output: what an older order of arguments would turn round in silence."""

from __future__ import annotations

from flightid.errors import ModelError


def require_inputs_first(inputs: object, output: object) -> None:
    """Refuse names that can only be meant the other way round.

    Raises
    ------
    ModelError
        One name stands where several belong, or several where one does.
    """
    if isinstance(inputs, str) or not isinstance(output, str):
        raise ModelError(
            "inputs stand before the output",
            found=f"{inputs!r}, {output!r}",
            needed="a sequence of names, then one name",
        )
