"""What a study examines of a fit beyond the fit itself: the log, residual tests, predictions."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from flightid.evidence import Check, inspection_check, residual_check
from flightid.evidence.data_checks import band_checks
from flightid.evidence.evidence import RESIDUALS
from flightid.evidence.gather import worse
from flightid.findings import Finding
from flightid.identification import Fit
from flightid.inspection import Inspection
from flightid.responses import FrequencyResponse


def examined(
    fit: Fit,
    inspection: Inspection | None,
    found: Sequence[Finding],
    response: FrequencyResponse | None = None,
) -> Fit:
    """The fit with what the study knows besides, so that every page shows its one light.

    Parameters
    ----------
    fit : Fit
    inspection : Inspection or None
        Of the log that the data come from.
    found : sequence of Finding
        Of residual tests and of predictions of records that the fit has not seen.
    response : FrequencyResponse, optional
        Of the fitted channels, whose band then is that of a fit to records too.

    Returns
    -------
    Fit
    """
    checks: list[Check] = []
    if inspection is not None:
        checks.append(inspection_check(inspection))
    if response is not None and not fit.responses and _is_of(response, fit):
        outputs, inputs = tuple(fit.model.outputs), tuple(fit.model.inputs)
        checks += band_checks(response.select(outputs=outputs, inputs=inputs))
    if found:
        checks.append(worse(fit.evidence.check(RESIDUALS), residual_check(found)))
    return replace(fit, evidence=fit.evidence.with_checks(checks))


def _is_of(response: FrequencyResponse, fit: Fit) -> bool:
    """Whether a response holds all channels of a fit, and was conditioned on no other input."""
    outputs = set(fit.model.outputs) <= set(response.outputs)
    return outputs and set(fit.model.inputs) == set(response.inputs)
