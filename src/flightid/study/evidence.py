"""What a study examines of a fit beyond the fit itself: the log, residual tests, predictions."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import replace

from flightid.conventions import Light
from flightid.evidence import Check, Evidence, inspection_check, residual_check, sweep_check
from flightid.evidence.data_checks import band_checks, power_of_records, sample_checks
from flightid.evidence.evidence import GUIDELINES, LOOP, PREDICTION, RESIDUALS, SAMPLES, SETTLED
from flightid.evidence.gather import BELONGS, loop_of_residuals, worse
from flightid.findings import Finding, worst
from flightid.identification import Fit
from flightid.inspection import Inspection
from flightid.record import Record
from flightid.responses import FrequencyResponse
from flightid.study.identified import ModelResults
from flightid.study.kept_runs import agreement_of_kept
from flightid.study.stages import NOT_TESTED
from flightid.validation import Verification
from flightid.validation.verification.of_the_fit import SEEN


def examined(fit: Fit, item: ModelResults, inspection: Inspection | None) -> Fit:
    """The fit with what the study knows besides, so that every page shows its one light.

    Parameters
    ----------
    fit : Fit
    item : ModelResults
        Its responses, whose band is that of a fit to records too, residual tests, and predictions
        of records that the fit has not seen.
    inspection : Inspection or None
        Of the log that the data come from.
    """
    checks: list[Check] = []
    if inspection is not None:
        channels = (*fit.model.inputs, *fit.model.outputs)
        checks.append(inspection_check(inspection, channels))
        checks += sweep_check(inspection, channels)
    if item.tests is not None and item.tests.findings:
        residuals = residual_check(item.tests.findings)
        checks.append(worse(fit.evidence.check(RESIDUALS), residuals))
        loop = loop_of_residuals(item.tests.feedback, item.tests.findings)
        checks += [] if loop is None else [worse(fit.evidence.check(LOOP), loop)]
    for missed in item.untested:
        if missed.code != NOT_TESTED:
            continue
        check = Check(RESIDUALS, missed.light, missed.message, missed.action)
        checks.append(worse(fit.evidence.check(RESIDUALS), check))
    damage = sample_checks(item.unfitted, {*fit.model.inputs, *fit.model.outputs})
    checks += [worse(fit.evidence.check(SAMPLES), each) for each in damage]
    said = [each for run in item.verifications.values() for each in run.findings]
    seen = [each for each in said if each.code == SEEN]
    if item.on_unseen:
        checks.append(prediction_check(item.on_unseen, (*said, *item.reduction_judged)))
    elif seen:
        checks.append(Check(PREDICTION, worst(tuple(said)), seen[0].message, seen[0].action))
    checks += _bands(fit, item, checks)
    checks += _found_once(fit, checks)
    checks += agreement_of_kept(fit, item.on_unseen, checks, inspection)
    checks += _guidelines(fit.evidence, item.findings_of_choice)
    return replace(fit, evidence=fit.evidence.with_checks(checks))


def _found_once(fit: Fit, checks: Iterable[Check]) -> tuple[Check, ...]:
    """An optimum that one start alone found is good enough where it predicts unseen records."""
    settled = fit.evidence.check(SETTLED)
    doubts = {
        each.code
        for each in fit.findings
        if BELONGS.get(each.code) == SETTLED and each.light is not Light.GREEN
    }
    if settled is None or doubts != {"local-minima"} or not _predicts(checks):
        return ()
    said = f"{settled.what}; it predicts what it has not seen all the same"
    return (Check(SETTLED, Light.GREEN, said),)


def _predicts(checks: Iterable[Check]) -> bool:
    return any(each.name == PREDICTION and each.light is Light.GREEN for each in checks)


def _bands(fit: Fit, item: ModelResults, checks: Iterable[Check]) -> tuple[Check, ...]:
    """Band and coherence of a fit to records: of all that it was fitted to or predicts."""
    outputs, inputs = tuple(fit.model.outputs), tuple(fit.model.inputs)
    predicted = _predicts(checks)
    if predicted and item.training and not fit.responses:
        whole = (*item.training, *(each for each in item.unfitted if _holds(each, fit)))
        return power_of_records(whole, inputs, outputs, predicted=True)
    response = item.response
    if response is None or fit.responses or not _is_of(response, fit):
        return ()
    return band_checks(response.select(outputs=outputs, inputs=inputs), predicted=predicted)


def _holds(record: Record, fit: Fit) -> bool:
    return all(name in record for name in (*fit.model.inputs, *fit.model.outputs))


def prediction_check(runs: Mapping[str, Verification], said: Iterable[Finding]) -> Check:
    """What a fit predicts of records that it has not seen, and the worst verdict on it.

    Parameters
    ----------
    runs : mapping of str to Verification
        Free runs, by name of the records; one or more.
    said : iterable of Finding
        Verdicts on them.
    """
    found = tuple(said)
    light = worst(found)
    poor = next((each for each in found if each.light is light and each.action), None)
    return Check(PREDICTION, light, _predicted(runs), "" if poor is None else poor.action)


def _predicted(runs: Mapping[str, Verification]) -> str:
    fits = {f"{y} of “{name}”": v for name, run in runs.items() for y, v in run.fit_percent.items()}
    least, value = min(fits.items(), key=lambda pair: pair[1])
    if value <= 0.0:
        return f"predicts {least} no better than a constant would (fit {value:.3g} %, free run)"
    if len(fits) == 1:
        return f"predicts {value:.3g} % of {least}, which it has not seen (free run)"
    most = max(fits.values())
    return f"predicts {value:.3g} % ({least}) to {most:.3g} % of what it has not seen (free run)"


def _guidelines(evidence: Evidence, found: Iterable[Finding]) -> list[Check]:
    """The worst verdict on how a structure was chosen, where it is worse than the fit's own."""
    findings = tuple(found)
    if not findings:
        return []
    light = worst(findings)
    first = next(each for each in findings if each.light is light)
    return [
        worse(evidence.check(GUIDELINES), Check(GUIDELINES, light, first.message, first.action))
    ]


def _is_of(response: FrequencyResponse, fit: Fit) -> bool:
    """Whether a response holds all channels of a fit, and was conditioned on no other input."""
    outputs = set(fit.model.outputs) <= set(response.outputs)
    return outputs and set(fit.model.inputs) == set(response.inputs)
