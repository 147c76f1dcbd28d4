"""Initial states and biases of each record as a model declares them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from flightid.identification.records.options import ESTIMATE, RecordOptions
from flightid.models import GreyBoxModel, RecordValue, StateSpaceModel

Array = NDArray[np.float64]
Declared = Mapping[str, RecordValue]


def declared_numbers(
    model: GreyBoxModel, options: RecordOptions, kind: str, names: Sequence[str]
) -> dict[str, RecordValue]:
    """What the model declares for some of the names, where the options leave it to the model.

    An option that differs from its default is the user's word and overrules the model's.

    Parameters
    ----------
    model : TransferFunctionModel or StateSpaceModel
    options : RecordOptions
    kind : str
        ``"initial"``, ``"bias"`` or ``"reference"``.
    names : sequence of str
        States, outputs or inputs.

    Returns
    -------
    dict of str to RecordValue
    """
    left_to_model = {
        "initial": isinstance(options.initial_state, str) and options.initial_state == ESTIMATE,
        "bias": options.output_bias is True,
        "reference": options.input_bias is False,
    }
    if not isinstance(model, StateSpaceModel) or not left_to_model[kind]:
        return {}
    declared = model.initial if kind == "initial" else model.biases
    return {name: item for name, item in declared.items() if name in names}


def with_declared(
    values: Array, free: Sequence[int], names: Sequence[str], declared: Declared
) -> tuple[Array, list[int], list[tuple[float, float]]]:
    """Values, free places and their bounds, with the declared ones in their place.

    Returns
    -------
    tuple
    """
    filled, places = values.copy(), set(free)
    limits: dict[int, tuple[float, float]] = {}
    for name, item in declared.items():
        place = list(names).index(name)
        filled[place] = item.value
        (places.add if item.free else places.discard)(place)
        limits[place] = (item.minimum, item.maximum)
    ordered = sorted(places)
    return filled, ordered, [limits.get(place, (-np.inf, np.inf)) for place in ordered]
