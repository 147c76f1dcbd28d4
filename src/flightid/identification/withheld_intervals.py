"""A fit whose intervals are not shown, since they would not hold what they say."""

from __future__ import annotations

from dataclasses import replace

from flightid.evidence.gather import NOISE_KNOWN, OF_PARAMETERS
from flightid.identification.fit import Fit
from flightid.identification.fit_findings import (
    UNKNOWN,
    judge_correlation,
    judge_parameters,
)
from flightid.models import PolynomialModel

_OF_INTERVALS = {
    "residuals-coloured",
    "residuals-unequal",
    "intervals-by-output",
    "intervals-approximate",
    NOISE_KNOWN,
    "at-bound",
    *OF_PARAMETERS,
}
"""Findings on intervals, and those on parameters, which are judged again without."""


def without_intervals(fit: Fit, reason: str) -> Fit:
    """The fit with no error bars, each with the reason.

    Parameters
    ----------
    fit : Fit
    reason : str
        Why there are none; that of a parameter which had none before stays.

    Returns
    -------
    Fit
        Without covariance, so that nothing computed from it has intervals either.
    """
    bare = {
        name: replace(each, stderr=None, ends=None, reason=each.reason or reason)
        for name, each in fit.parameters.items()
    }
    findings = (
        *(each for each in fit.findings if each.code not in _OF_INTERVALS),
        *judge_parameters(bare),
        *(judge_correlation(fit.names, fit.correlation, bare) if fit.details is None else ()),
    )
    model = fit.model
    if isinstance(model, PolynomialModel):
        model = replace(model, covariance=None)
    return replace(
        fit,
        model=model,
        details=fit.details and fit.details.without_intervals(reason),
        parameters=bare,
        covariance=None,
        intervals_from=UNKNOWN,
        findings=findings,
        agreement=fit.agreement and fit.agreement.without_bars(),
    )
