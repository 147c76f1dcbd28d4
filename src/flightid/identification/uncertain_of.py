"""A fit, a model or a measured response with what is known of its errors."""

from __future__ import annotations

from copy import copy
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from flightid.errors import OptionError
from flightid.evidence import Evidence
from flightid.findings import Finding
from flightid.identification.fit import Fit, uncertain_model
from flightid.models import Model, PolynomialModel
from flightid.responses import FrequencyResponse
from flightid.uncertainty.shown_bands import shown_words
from flightid.uncertainty.uncertain import Uncertain

Array = NDArray[np.float64]
NO_COVARIANCE = "the model is given as numbers, without a covariance"


def uncertain_of(
    source: object, output: str | None = None, input: str | None = None
) -> Uncertain[Any]:
    """The uncertainty of a fit or a measured response, ready to be carried on.

    Parameters
    ----------
    source : Fit, FrequencyResponse, or a model or system
        A model from the file of a fit has that fit's covariance. A model without fit has none:
        what is computed from it has no interval. Of a polynomial model its own is taken.
    output, input : str, optional
        Pair of a response; left out, it must have one output.

    Returns
    -------
    Uncertain
        Of a model of the same kind, or of a `FrequencyResponse` (real and imaginary parts at all
        its frequencies).

    Raises
    ------
    OptionError
        A response of several outputs without a choice.

    Assumes
    -------
    Parameters at a bound or fixed are known exactly, so that intervals leave them out. A response
    with random errors alone has errors that do not hang together across frequencies.

    Example
    -------
    >>> import flightid as fid
    >>> truth = fid.load_model("rate_first_order").with_values({"Lp": -5.0, "Ltphi": 150.0})
    >>> omega = np.geomspace(0.5, 20.0, 30)
    >>> data = fid.FrequencyResponse.from_values(
    ...     omega, truth.frequency_response(omega), inputs=truth.inputs, outputs=truth.outputs,
    ...     units=truth.units, random_error=np.full((1, 1, 30), 0.02))
    >>> uncertain = uncertain_of(fid.identify(truth, data))
    >>> uncertain
    Uncertain(3 numbers, covariance known)
    >>> pole = uncertain.carried(lambda model: model.parameters["Lp"].value)
    >>> bool(0.01 < pole.stderr[0] < 1.0)
    True
    """
    if isinstance(source, Uncertain):
        return source
    found, examined = _of_numbers(source, output, input), evidence_behind(source)
    if examined is None:
        return found
    return replace(
        found,
        findings=source_findings(source),
        valid_rad_s=examined.band_rad_s,
        by_response_rad_s=examined.by_response_rad_s,
    )


def source_findings(source: object) -> tuple[Finding, ...]:
    """The light of the fit that something is computed from: no result is greener than its source.

    Parameters
    ----------
    source : object
        Fit, model from a fit's file, or what is `Uncertain` because they are; of anything else
        nothing is known.
    """
    if isinstance(source, Uncertain):
        return source.findings
    examined = evidence_behind(source)
    return () if examined is None else (_rests_on(examined),)


def evidence_behind(source: object) -> Evidence | None:
    """Evidence of a fit, or of the one that a model's file keeps; None where there is none."""
    examined = getattr(source, "evidence", None)
    known = getattr(source, "estimated", None)
    if examined is None and known is not None and known.evidence:
        examined = Evidence.from_dict(known.evidence)
    return examined if isinstance(examined, Evidence) else None


def _rests_on(examined: Evidence) -> Finding:
    """The light of the fit that something is computed from, and where it holds."""
    verdict, band = examined.verdict, examined.band_rad_s
    where = "nothing tells in which band it holds"
    if band is not None:
        where = shown_words(examined.by_response_rad_s, band)
    text = f"rests on a fit that is {verdict.light}: {verdict.message}; {where}"
    return Finding("source-evidence", verdict.light, text, verdict.action)


def _of_numbers(source: object, output: str | None, input: str | None) -> Uncertain[Any]:
    if isinstance(source, Fit):
        return source.uncertain()
    known = getattr(source, "estimated", None)
    if isinstance(source, Model) and known is not None:
        return uncertain_model(source, known.names, known.covariance, known.withheld)
    if isinstance(source, PolynomialModel) and source.covariance is not None:
        return uncertain_model(source, source.names, source.covariance)
    if isinstance(source, FrequencyResponse):
        return _of_response(source, output, input)
    return Uncertain.exact(source, NO_COVARIANCE)


def _of_response(
    response: FrequencyResponse, output: str | None, input: str | None
) -> Uncertain[FrequencyResponse]:
    chosen = response.select(
        outputs=None if output is None else [output], inputs=None if input is None else [input]
    )
    if len(chosen.outputs) > 1:
        raise OptionError(
            "a response of several outputs needs a choice",
            found=", ".join(chosen.outputs),
            needed="output=…",
        )
    values = chosen.response[0]
    shape = values.shape

    def make(numbers: Array) -> FrequencyResponse:
        real, imaginary = numbers.reshape(2, *shape)
        # Draws and steps of one response: what else it holds was looked at when it was made.
        made = copy(chosen)
        object.__setattr__(made, "response", (real + 1j * imaginary)[None])
        return made

    centre = np.concatenate([values.real.ravel(), values.imag.ravel()])
    covariance, reason = _errors(chosen)
    return Uncertain(centre, covariance, make, None, reason)


def _errors(chosen: FrequencyResponse) -> tuple[Array | None, str]:
    if chosen.errors is not None:
        return chosen.covariance_at(chosen.omega_rad_s)[0], ""
    error = chosen.random_error[0]
    if not (np.all(np.isfinite(error)) and np.any(error > 0.0)):
        return None, "the errors of the response are not known"
    # Magnitude and phase in rad have the same relative error, so both parts of H have it.
    spread = (np.abs(chosen.response[0]) * error).ravel()
    return np.diag(np.tile(spread, 2) ** 2), "random errors alone, none across frequencies"
