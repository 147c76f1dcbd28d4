"""The same structure by way of the injected excitation, where a loop biases a fit."""

from __future__ import annotations

from typing import Any

from flightid.conventions import Light
from flightid.errors import FlightidError
from flightid.evidence.evidence import LOOP, Check
from flightid.frozen import dataclass
from flightid.identification.fit import Fit
from flightid.identification.identify import identify
from flightid.models import StateSpaceModel, TransferFunctionModel
from flightid.record import Record
from flightid.responses import estimate_response
from flightid.uncertainty.feedback_result import FeedbackTest

DIRECT = ("output_error", "equation_error", "fourier_regression", "fourier_output_error")
"""Methods without a model of the noise that a loop feeds back."""
OF_RESPONSES = ("frequency_domain", "joint")
"""Methods that have none where a response goes straight from inputs to outputs."""
WHITENED = str(FeedbackTest("unknown", "noise model"))
"""What the evidence says of the loop of a prewhitened response, which no loop biases."""
KEPT = ("starts", "seed", "maximum_iterations", "hold")
"""Options that mean the same to a fit of a response, whatever the method was."""


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
    those inputs, or a response straight from them, takes them for the vehicle's answer, and is
    biased however long the records are. What was injected does not know the noise: a response by
    way of it, and what is fitted to that, is consistent, and the error bound of the fit is then
    measured by way of it too.

    Parameters
    ----------
    fit : Fit
        Of records or responses, by a method without a model of the noise.

    Returns
    -------
    InstrumentFit or None
        None where the evidence of the fit says that the loop was open, the records lack an
        excitation for each input, the new fit cannot be made, or it is red or without errors; of a
        prewhitened response, which no loop biases, where its fit is neither red nor without errors.

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
    records = _injected(fit)
    if not records:
        return None
    loop = fit.evidence.check(LOOP)
    if loop is None or not _needs_it(fit, loop):
        return None
    told: dict[str, Any] = dict(fit.provenance.get("told", {}))  # type: ignore[call-overload]
    kept = (*told,) if fit.method == OF_RESPONSES[0] else KEPT
    options = {name: told[name] for name in kept if name in told}
    try:
        response = estimate_response(
            records, inputs=fit.model.inputs, outputs=fit.model.outputs, estimator="instrument"
        )
        made = identify(fit.structure, response, **options)
    except FlightidError:
        return None
    if made.covariance is None or made.evidence.light is Light.RED:
        return None
    if loop.what == WHITENED:
        why = f"a prewhitened one, whose fit fails: {fit.evidence.verdict.message}"
        return InstrumentFit(made, f"the response to what was injected in place of {why}")
    way = "the direct response" if fit.method == OF_RESPONSES[0] else fit.method.replace("_", " ")
    reason = f"{way}, which feedback of noise biases ({loop.what})"
    return InstrumentFit(made, f"the response to what was injected in place of {reason}")


def _needs_it(fit: Fit, loop: Check) -> bool:
    """Whether a loop may bias the fit; of one by a model of its noise, whether it fails."""
    if loop.what == WHITENED:
        return fit.covariance is None or fit.evidence.light is Light.RED
    return loop.light is not Light.GREEN


def _injected(fit: Fit) -> list[Record]:
    """Records of a linear model, behind its responses too, that hold an excitation for each input.

    None of a fit whose method, or whose responses, keep the loop's noise out by themselves.
    """
    if not isinstance(fit.structure, StateSpaceModel | TransferFunctionModel):
        return []
    direct = fit.method in OF_RESPONSES and bool(fit.excited)
    if not direct and (fit.responses or fit.method not in DIRECT):
        return []
    records = [*fit.excited, *(each.measured for each in fit.records)]
    least = min((len(each.excitations) for each in records), default=0)
    return records if least >= len(fit.model.inputs) else []
