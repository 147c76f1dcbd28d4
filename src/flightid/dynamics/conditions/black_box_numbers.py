"""What of a black box means the same in another: steady gains and delays of its responses."""

from __future__ import annotations

import numpy as np

from flightid.identification.uncertain_of import uncertain_of
from flightid.models import InnovationsModel, PolynomialModel
from flightid.responses.pair import quotient_unit
from flightid.uncertainty.estimate import Estimate, Reading

CHOSEN = "fixed"
"""Whole samples that a structure was asked for, or that a scan chose: no error belongs to them."""


def black_box_numbers(source: object) -> dict[str, Reading]:
    """Steady gains with intervals, and delays, by name; none of a model that has neither.

    Parameters
    ----------
    source : Fit or model

    Example
    -------
    >>> from flightid.models import PolynomialModel
    >>> model = PolynomialModel(("u",), "y", 0.1, a=[1, -0.5], b=[[2.0]], nk=(2,))
    >>> {name: number.value for name, number in black_box_numbers(model).items()}
    {'steady gain y/u': 4.0, 'delay y/u': 0.2}
    """
    known = uncertain_of(source)
    model = known.value
    if not isinstance(model, PolynomialModel | InnovationsModel):
        return {}
    steady = [name for name, value in model.gains().items() if value is not None]

    def gains_of(each: PolynomialModel | InnovationsModel) -> list[float]:
        gains = each.gains()
        return [np.nan if (value := gains[name]) is None else value for name in steady]

    found: dict[str, Reading] = {}
    carried = known.carried(gains_of)
    for place, name in enumerate(steady):
        output, _, driving = name.partition("/")
        unit = quotient_unit(model.units.get(output, "1"), model.units.get(driving, "1"))
        told = f"steady gain {name}"
        found[told] = carried.number(place, told, unit)
    if isinstance(model, PolynomialModel):
        for driving, samples in zip(model.inputs, model.nk, strict=True):
            told = f"delay {model.output}/{driving}"
            found[told] = Estimate(told, samples * model.sample_time_s, "s", None, CHOSEN)
    return found
