"""What residuals of a free run say against its intervals: inputs still in them, or nothing told."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from flightid.conventions import Light
from flightid.evidence.gather import MINIMUM_DOUBTED, PROCESS_NOISE
from flightid.findings import Finding
from flightid.identification.fit import Fit
from flightid.identification.fit_findings import STARTS_FIRST, judge_missed
from flightid.identification.innovation_tests import INPUTS_IN_ERRORS, ROUNDING, InnovationTests
from flightid.identification.withheld_intervals import without_intervals
from flightid.uncertainty.foretold import chance_share, likelihood_gain

MISSING = (
    "add the lag, delay or state that the model lacks, check how inputs are held, or look for "
    "feedback"
)
LEAST_GAIN = 6.0
"""Logarithm of a likelihood, beyond that of chance, that inputs must bring to a fit."""
CONTRADICTED = "hold-contradicted"
DOUBTED = (CONTRADICTED, "hold-unknown")
OUTPUT_ERROR = "output_error"
NOTHING = "what inputs explain of the outputs is within chance: nothing of the vehicle is told"

BEGUN = "dynamics are missing, or a delayed input was another before its record began"
"""Cause of models with delays, which hold the first sample of an input for all that was before."""
LATER = "; where an input is not at rest at the beginning, cut off as much as its delay"
EXACT = "residuals are at rounding, so no noise is there that bars could tell"


def with_residuals_judged(fit: Fit) -> Fit:
    """The fit without intervals where its residuals refute them; as it is elsewhere.

    Parameters
    ----------
    fit : Fit
        Of a model with equations. Black boxes, whose errors are white or not, have judged theirs.

    Assumes
    -------
    Bars of a model that lacks dynamics hold nothing, however small the part of the outputs that is
    missed: noise of that size averages out over the record, a misfit does not. Where another hold
    is in doubt, it may be what inputs foretell: its bars reach that.

    Reference
    ---------
    Ljung, *System Identification*, 2nd ed., section 16.6.
    """
    if fit.missed and fit.covariance is not None:
        judged = judge_missed(fit.findings, fit.average_cost, fit.missed)
        return without_intervals(replace(fit, findings=tuple(judged)), fit.missed)
    if fit.details is not None or not fit.records or fit.residual_horizon != "free_run":
        return fit
    if not fit.responses and _gain(fit) < least_gain(len(fit.names)):
        return _withheld(fit, NOTHING, *nothing_told(NOTHING))
    worst = next((each for each in fit.findings if _is_unexplained(each)), None)
    if worst is not None:
        return without_intervals(fit, worst.message) if fit.covariance is not None else fit
    ratios = [float(np.sqrt(cost / 100.0)) for cost in fit.costs.values()]
    # What rounding leaves follows the inputs too.
    seen = [each for each in fit.input_correlations if ratios[each.output] > ROUNDING]
    tests = InnovationTests(None, None).fitted(seen, ratios)
    tests = tests.beside(fit.agreement)
    if tests.is_independent:
        return fit
    is_late = bool(getattr(fit.model, "delays", None))
    if is_late:
        tests = replace(tests, cause=BEGUN)
    (said,) = tests.findings(biased=False, action=MISSING + (LATER if is_late else ""))
    return _withheld(fit, said.message, said)


def _is_foretold(found: Finding) -> bool:
    """Whether inputs foretell errors, as they are held or as they might be."""
    asked = found.code in (INPUTS_IN_ERRORS, CONTRADICTED)
    return asked and found.light in (Light.AMBER, Light.RED)


def _is_unexplained(found: Finding) -> bool:
    """Whether most of what moves an output is no part of the model: its bars hold nothing."""
    return found.code == "output-unexplained" and found.light is Light.RED


def with_minimum_doubted(fit: Fit) -> Fit:
    """The fit with the word that its minimum may not be the lowest, where one start was made.

    Output error that stopped in a local minimum leaves what a wrong structure or another hold would
    leave, and is settled. Inputs in its errors, or another hold that they ask, tell none of these
    from the others: starts are tried before the model is changed. Noise on the states explains the
    same without.

    Parameters
    ----------
    fit : Fit
    """
    options = fit.provenance.get("options")
    starts = options.get("starts", 1) if isinstance(options, Mapping) else 1
    codes = {each.code for each in fit.findings}
    poor = [
        each
        for each in fit.findings
        if (
            each.code in (INPUTS_IN_ERRORS, CONTRADICTED) and each.light in (Light.AMBER, Light.RED)
        )
        or _is_unexplained(each)
    ]
    if fit.method != OUTPUT_ERROR or starts != 1 or not poor:
        return fit
    if codes & {MINIMUM_DOUBTED, PROCESS_NOISE}:
        return fit
    said = "one start was made, and a local minimum would leave what this one does"
    doubt = Finding(MINIMUM_DOUBTED, Light.AMBER, said, STARTS_FIRST)
    return replace(fit, findings=(*fit.findings, doubt))


def least_gain(n_parameters: int) -> float:
    """What inputs must bring, of a likelihood's logarithm, to tell so many parameters."""
    return LEAST_GAIN + 2.0 * n_parameters


def nothing_told(reason: str) -> list[Finding]:
    """The finding that goes with the reason `NOTHING`; none with any other."""
    action = "excite the vehicle more, or fly longer"
    return [Finding("nothing-told", Light.RED, NOTHING, action)] if reason == NOTHING else []


def exact_fit(reason: str) -> list[Finding]:
    """The finding that goes with the reason `EXACT`; none with any other."""
    action = "fit a record with the noise of its sensor: a simulation without noise has no errors"
    return [Finding("exact-fit", Light.AMBER, EXACT, action)] if reason == EXACT else []


def in_doubt(findings: tuple[Finding, ...]) -> bool:
    """Whether how inputs are held is in doubt."""
    return any(each.code in DOUBTED and each.light is Light.AMBER for each in findings)


def _withheld(fit: Fit, reason: str, said: Finding) -> Fit:
    bare = without_intervals(fit, reason) if fit.covariance is not None else fit
    return replace(bare, findings=(*bare.findings, said))


def _gain(fit: Fit) -> float:
    """What the model brings over constants."""
    total = 0.0
    for name in fit.costs:
        left = [each.residual(name) for each in fit.records]
        about = [each.measured[name] - np.mean(each.measured[name]) for each in fit.records]
        gain = likelihood_gain(about, [row - np.mean(row) for row in left], chance_share)
        total += max(gain, 0.0)
    return total
