"""Parameters of a fit or model as numbers with their spread: ties followed, bounds left out."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from flightid.errors import ModelError
from flightid.identification.fit import Fit
from flightid.identification.uncertain_of import NO_COVARIANCE
from flightid.models import StateSpaceModel, TransferFunctionModel
from flightid.uncertainty.uncertain import Uncertain


def uncertain_parameters(source: object) -> Uncertain[dict[str, float]]:
    """Values of all parameters by name, with the covariance of those that were fitted.

    Parameters
    ----------
    source : Fit, StateSpaceModel or TransferFunctionModel
        A model from the file of a fit has that fit's covariance.

    Returns
    -------
    Uncertain of dict of str to float

    Raises
    ------
    ModelError
        The source has no named parameters.

    Example
    -------
    >>> import flightid as fid
    >>> uncertain_parameters(fid.load_model("r50_hover")).value["Krfb"]
    -8.26
    """
    model = source.model if isinstance(source, Fit) else source
    if not isinstance(model, StateSpaceModel | TransferFunctionModel):
        raise ModelError(
            "there are no named parameters in this",
            found=type(model).__name__,
            needed="a state-space or transfer-function model, or a fit of one",
        )
    parameters = model.parameters
    tape = parameters.tape(parameters.names)
    known = source if isinstance(source, Fit) else model.estimated
    names = () if known is None else known.names
    covariance = None if known is None else known.covariance
    covariance = source.carried if isinstance(source, Fit) else covariance

    def make(numbers: NDArray[np.float64]) -> dict[str, float]:
        given: Mapping[str, float] = dict(zip(names, map(float, numbers), strict=True))
        values = tape.evaluate(parameters.independent_values(given))
        return dict(zip(parameters.names, map(float, values), strict=True))

    centre = np.array([parameters[name].value for name in names], dtype=np.float64)
    reason = "" if covariance is not None else NO_COVARIANCE
    if known is not None and covariance is None:
        reason = "the fit knows no errors of its data"
    return Uncertain(centre, covariance, make, None, reason)
