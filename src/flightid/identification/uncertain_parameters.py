"""Parameters of a fit or model as numbers with their spread: ties followed, bounds left out."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from flightid.errors import ModelError
from flightid.identification.fit import Fit
from flightid.identification.frequency_domain.estimates import known_parameters
from flightid.identification.uncertain_of import NO_COVARIANCE, uncertain_of
from flightid.models import GreyBoxModel, StateSpaceModel, TransferFunctionModel
from flightid.uncertainty.estimate import Estimate
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
    model, names, known = _known(source)
    parameters = model.parameters
    tape = parameters.tape(parameters.names)

    def make(numbers: NDArray[np.float64]) -> dict[str, float]:
        given: Mapping[str, float] = dict(zip(names, map(float, numbers), strict=True))
        values = tape.evaluate(parameters.independent_values(given))
        return dict(zip(parameters.names, map(float, values), strict=True))

    centre = np.array([parameters[name].value for name in names], dtype=np.float64)
    return Uncertain(centre, known.covariance, make, None, known.reason)


def parameter_estimates(source: object) -> dict[str, Estimate]:
    """Every parameter with its interval or why it has none: of a fit and of its file the same.

    Parameters
    ----------
    source : Fit, StateSpaceModel or TransferFunctionModel
        A model from the file of a fit has that fit's covariance.

    Returns
    -------
    dict of str to Estimate
        Without percentages, with normal intervals; see `Fit.carried`.

    Raises
    ------
    ModelError
        The source has no named parameters.

    Example
    -------
    >>> import flightid as fid
    >>> parameter_estimates(fid.load_model("r50_hover"))["Krfb"].reason
    'the model is given as numbers, without a covariance'
    """
    model, names, known = _known(source)
    if known.reason == NO_COVARIANCE:
        return {
            name: Estimate(name, p.value or 0.0, p.unit, None, NO_COVARIANCE, status=p.status)
            for name, p in model.parameters.items()
        }
    return known_parameters(model, names, known.covariance, withheld=known.reason)


def _known(source: object) -> tuple[GreyBoxModel, tuple[str, ...], Uncertain[object]]:
    """The model, names of what was fitted, and what is known of them, by `uncertain_of`."""
    model = source.model if isinstance(source, Fit) else source
    if not isinstance(model, StateSpaceModel | TransferFunctionModel):
        raise ModelError(
            "there are no named parameters in this",
            found=type(model).__name__,
            needed="a state-space or transfer-function model, or a fit of one",
        )
    fitted = source if isinstance(source, Fit) else model.estimated
    return model, () if fitted is None else fitted.names, uncertain_of(source)
