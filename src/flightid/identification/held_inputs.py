"""Which hold a fit uses: what it is told, else what its data know, else what is then said."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import fields, replace
from typing import Any, cast

from flightid.identification.fit import Fit
from flightid.record import InputHold, Record
from flightid.record.chosen_hold import ChosenHold, chosen_hold, hold_of_shapes
from flightid.record.hold import HOLDS
from flightid.responses import FrequencyResponse


def hold_for(
    options: type[Any], data: Sequence[object], given: Mapping[str, Any]
) -> ChosenHold | None:
    """The hold of a fit.

    Parameters
    ----------
    options : type
        Options of the method: what its field ``hold`` has as default is assumed where nobody
        knows.
    data : sequence of FrequencyResponse or Record
    given : mapping
        What the caller said; None counts as nothing.

    Returns
    -------
    ChosenHold or None
        None where the method does not ask how inputs move.

    Raises
    ------
    DataError
        Data with different holds, and none is told.
    """
    defaults = {field.name: field.default for field in fields(options)}
    if "hold" not in defaults:
        return None
    declared, assumed = given.get("hold"), cast("InputHold", defaults["hold"])
    if declared is not None:
        return ChosenHold(declared, "declared")
    records = [item for item in data if isinstance(item, Record)]
    responses = [item for item in data if isinstance(item, FrequencyResponse)]
    if not responses:
        return chosen_hold(records, None, known=HOLDS, assumed=assumed)
    shapes = [("response", each.input_shape) for each in responses]
    shapes += [(each.name, each.input_shape) for each in records]
    found = hold_of_shapes(shapes, HOLDS, assumed)
    # Without the records' samples or without the correction nothing runs between samples.
    idle = not records and (
        given.get("correct_bias") is False or all(each.linear is None for each in responses)
    )
    return replace(found, findings=()) if idle else found


def with_hold_said(fit: Fit, held: ChosenHold) -> Fit:
    """The fit that says on whose word its inputs were held."""
    return replace(
        fit,
        findings=(*fit.findings, *held.findings),
        provenance={**fit.provenance, "inputs": held.to_dict()},
    )
