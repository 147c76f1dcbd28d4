"""The same structure by way of the injected excitation, where a loop biases a fit of records."""

from __future__ import annotations

from typing import Any

from flightid.conventions import Light
from flightid.errors import FlightidError
from flightid.evidence.evidence import LOOP
from flightid.frozen import dataclass
from flightid.identification.fit import Fit
from flightid.identification.identify import identify
from flightid.models import StateSpaceModel, TransferFunctionModel
from flightid.record import Record
from flightid.responses import estimate_response

DIRECT = ("output_error", "equation_error", "fourier_regression", "fourier_output_error")
"""Methods without a model of the noise that a loop feeds back."""
KEPT = ("starts", "seed", "maximum_iterations", "hold")
"""Options that mean the same to a fit of a response."""


@dataclass(frozen=True, eq=False)
class InstrumentFit:
    """A fit of a response to the excitation in place of one that feedback biases.

    Attributes
    ----------
    fit : Fit
    reason : str
        What was taken in place of what, and why.
    """

    fit: Fit
    reason: str


def instrument_fit(fit: Fit) -> InstrumentFit | None:
    """The structure of a fit again, from the response to the excitation that its records hold.

    A loop feeds noise and gusts of the outputs back to the inputs. A model that runs free along
    those inputs takes them for the vehicle's answer, and is biased however long the records are.
    What was injected does not know the noise: a response by way of it, and what is fitted to that,
    is consistent, and the error bound of the fit is then measured by way of it too.

    Parameters
    ----------
    fit : Fit
        Of records, by a method without a model of the noise.

    Returns
    -------
    InstrumentFit or None
        None where the evidence of the fit says that the loop was open, the records lack an
        excitation for each input, the new fit cannot be made, or it is red or without errors.

    Assumes
    -------
    The excitation was drawn before the flight: a stick that a pilot moves after what he sees is no
    instrument. Costs bias less and noise more: a few windows stand behind low frequencies.

    Reference
    ---------
    Söderström & Stoica, *System Identification* (1989), section 10.3 (direct identification in
    closed loop); Ljung, *System Identification*, 2nd ed., section 13.5.

    Example
    -------
    >>> import numpy as np
    >>> import flightid as fid
    >>> time_s = np.arange(3000) * 0.02
    >>> sweep = fid.Record.from_arrays(time_s, inputs={"tau_phi": 0.1 * np.sin(0.1 * time_s**2)})
    >>> model = fid.load_model("rate_first_order")
    >>> flown = fid.simulate(model, sweep, units={"p": "rad/s"})
    >>> instrument_fit(fid.identify(model, flown)) is None                      # nothing injected
    True
    """
    records = [each.measured for each in fit.records]
    if fit.responses or fit.method not in DIRECT or not _injected(fit, records):
        return None
    loop = fit.evidence.check(LOOP)
    if loop is None or loop.light is Light.GREEN:
        return None
    told: dict[str, Any] = dict(fit.provenance.get("told", {}))  # type: ignore[call-overload]
    options = {name: told[name] for name in KEPT if name in told}
    try:
        response = estimate_response(
            records, inputs=fit.model.inputs, outputs=fit.model.outputs, estimator="instrument"
        )
        made = identify(fit.structure, response, **options)
    except FlightidError:
        return None
    if made.covariance is None or made.evidence.light is Light.RED:
        return None
    method = fit.method.replace("_", " ")
    reason = f"{method}, which feedback of noise biases ({loop.what})"
    return InstrumentFit(made, f"the response to what was injected in place of {reason}")


def _injected(fit: Fit, records: list[Record]) -> bool:
    """Whether a linear model's records hold an excitation for each of its inputs."""
    if not records or not isinstance(fit.structure, StateSpaceModel | TransferFunctionModel):
        return False
    return min(len(each.excitations) for each in records) >= len(fit.model.inputs)
