"""What a study examines of a fit beyond the fit itself: the log, residual tests, predictions."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from flightid.evidence import Check, inspection_check, residual_check
from flightid.evidence.evidence import RESIDUALS
from flightid.evidence.gather import worse
from flightid.findings import Finding
from flightid.identification import Fit
from flightid.inspection import Inspection


def examined(fit: Fit, inspection: Inspection | None, found: Sequence[Finding]) -> Fit:
    """The fit with what the study knows besides, so that every page shows its one light.

    Parameters
    ----------
    fit : Fit
    inspection : Inspection or None
        Of the log that the data come from.
    found : sequence of Finding
        Of residual tests and of predictions of records that the fit has not seen.

    Returns
    -------
    Fit
    """
    checks: list[Check] = []
    if inspection is not None:
        checks.append(inspection_check(inspection))
    if found:
        checks.append(worse(fit.evidence.check(RESIDUALS), residual_check(found)))
    return replace(fit, evidence=fit.evidence.with_checks(checks))
