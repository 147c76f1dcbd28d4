"""Start values of pairs that a parameter at zero keeps shut."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from flightid.conventions import Light
from flightid.errors import FlightidError
from flightid.findings import Finding
from flightid.identification.frequency_domain.model_curves import looks_of, start_curves
from flightid.identification.frequency_domain.selection import SelectedResponse
from flightid.models import GreyBoxModel

Array = NDArray[np.float64]
STEP = 1e-3
"""Trial value of a parameter at zero, of which its response is a straight line nearly."""


def opened(
    model: GreyBoxModel, selected: Sequence[SelectedResponse]
) -> tuple[GreyBoxModel, list[Finding]]:
    """The model with parameters at zero moved where a pair has no response without them.

    Decibels of nothing have no slope. Such a parameter starts where least squares on the measured
    pairs that it opens puts it, to first order.

    Parameters
    ----------
    model : GreyBoxModel
    selected : sequence of SelectedResponse

    Returns
    -------
    model, and list of Finding
    """
    seen, _ = looks_of(_curves(model, selected))
    shut = np.flatnonzero(~seen).tolist()
    zero = [p for p in model.parameters.free if p.value == 0.0] if shut else []
    moved: dict[str, float] = {}
    for parameter in zero:
        step = STEP if parameter.maximum > STEP else -STEP
        trial = model.with_values({parameter.name: step})
        above, below = 0.0, 0.0
        curves = _curves(trial, selected)
        for place in shut if curves else ():
            slope = curves[place] / step
            above += float(np.sum((slope.conj() * selected[place].response).real))
            below += float(np.sum(np.abs(slope) ** 2))
        if above != 0.0 and below > 0.0:
            half = 0.5 * np.array([parameter.minimum, parameter.maximum])
            moved[parameter.name] = float(np.clip(above / below, *half))
    if not any(moved.values()):
        return model, []
    words = ", ".join(f"{name} = {value:.3g}" for name, value in moved.items())
    text = f"started away from zero, where a pair has no response: {words}"
    action = "give other start values where these are far off"
    return model.with_values(moved), [Finding("start-opened", Light.GREEN, text, action)]


def _curves(
    model: GreyBoxModel, selected: Sequence[SelectedResponse]
) -> list[NDArray[np.complex128]]:
    """Responses at the points; none where the model has no value at one of them."""
    try:
        return start_curves(model, [each.omega_rad_s for each in selected])
    except FlightidError:
        return []
