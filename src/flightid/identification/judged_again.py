"""Verdicts on parameters of a fit whose bars have been made longer since they were given."""

from __future__ import annotations

from dataclasses import replace

from flightid.evidence.gather import OF_PARAMETERS
from flightid.identification.fit import Fit
from flightid.identification.fit_findings import judge_correlation, judge_parameters


def parameters_judged_again(fit: Fit) -> Fit:
    """The fit whose verdicts on parameters tell the intervals that it has now, and rest on them.

    Guides of sensitivity and correlation know no bars: the same ones are missed as before. Whether
    an interval excuses that, and how long it is, are said anew.

    Parameters
    ----------
    fit : Fit
    """
    places = [at for at, each in enumerate(fit.findings) if each.code in OF_PARAMETERS]
    if not places:
        return fit
    again = [
        *judge_parameters(fit.parameters),
        *judge_correlation(fit.names, fit.correlation, fit.parameters),
    ]
    said = {each.code for each in fit.findings}
    others = [each for each in fit.findings if each.code not in OF_PARAMETERS]
    now = [each for each in again if each.code in OF_PARAMETERS and each.code in said]
    return replace(fit, findings=(*others[: places[0]], *now, *others[places[0] :]))
