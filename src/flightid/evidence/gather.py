"""Evidence of a fit from what exists when it is made: its data, its findings and its end."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from flightid.conventions import Light
from flightid.evidence.data_checks import (
    loop_check,
    loop_of_records,
    loop_of_responses,
    not_turned_round,
    power_of_records,
    sample_checks,
    time_checks,
)
from flightid.evidence.evidence import (
    ALWAYS,
    BAND,
    GUIDELINES,
    HOLD,
    INSPECTION,
    LOOP,
    RESIDUALS,
    SETTLED,
    SIGNS,
    SWEEP,
    Check,
    Evidence,
)
from flightid.evidence.explained import ExplainedRun, by_free_runs, unless_hidden
from flightid.evidence.parameter_checks import declared_signs
from flightid.evidence.part_checks import agreement_check, beside_disturbances, beside_loop
from flightid.evidence.spans import Span, judge_coherence, judge_span
from flightid.findings import Finding, worst
from flightid.frozen import dataclass
from flightid.inspection import Inspection
from flightid.inspection.axes import axes_of
from flightid.inspection.carried import is_swept
from flightid.models.narx.structure import STOPS
from flightid.record import Record
from flightid.record.history import is_of_log
from flightid.record.hold import Loop
from flightid.responses import FrequencyResponse
from flightid.uncertainty.agreement import Agreement
from flightid.uncertainty.feedback_result import FeedbackTest, declared_loop
from flightid.uncertainty.unseen_scatter import UnseenScatter

LEADS = "residuals-lead-input"
"""Of a residual that goes with inputs to come, beyond chance: feedback, or dynamics missing."""
CONVERGED = frozenset({"gradient", "step", "cost", "zero", "bounds"})
MORE_STEPS = "raise maximum_iterations, use more starts, or simplify the model"
STRAIGHT = frozenset({"", "regression", "instruments", "kernel", "subspace"})
"""Ends of methods that search nothing: linear equations solve them."""
# Which check a finding of a fit belongs to; all others are guidelines.
INSENSITIVE, CRAMER_RAO, CORRELATED = "insensitive", "cramer-rao", "correlated"
OF_PARAMETERS = (INSENSITIVE, CRAMER_RAO, CORRELATED)
"""Codes of guides to parameters: they speak of model and band, and know nothing of the noise."""
MINIMUM_DOUBTED = "minimum-doubted"
"""Of a search whose minimum leaves so much that a lower one may lie elsewhere."""
ON_A_WORD = "hold-told"
"""A hold that estimates rest on and that the data neither bear out nor contradict."""
WINDOWS_SHORT = "windows-short"
"""Of a response whose windows a mode outlasts: its leakage is corrected, its coherence is lost."""
WINDOWS_LENGTHENED = "windows-lengthened"
"""Of a response whose windows come from the damping that a first fit found."""
NOISE_KNOWN = "noise-taken-for-known"
"""Of a response that does not tell from how much noise its errors are."""
LIMITS = (ON_A_WORD, WINDOWS_SHORT, WINDOWS_LENGTHENED, NOISE_KNOWN)
PROCESS_NOISE = "process-noise"
"""Of residuals that hold noise on the states."""
OVERFIT = "overfit"
"""An order that may be one too high: intervals hold what it costs."""
BELONGS = {
    "estimator-bias": SETTLED,
    WINDOWS_SHORT: SETTLED,
    WINDOWS_LENGTHENED: SETTLED,
    "estimator-bias-not-corrected": SETTLED,
    "not-converged": SETTLED,
    "not-refined": SETTLED,
    "several-minima": SETTLED,
    MINIMUM_DOUBTED: SETTLED,
    "local-minima": SETTLED,
    "stability-enforced": SETTLED,
    "root-at-circle": SETTLED,
    "predictor-at-circle": SETTLED,
    "input-not-excited": BAND,
    "residuals-coloured": RESIDUALS,
    "residuals-unequal": RESIDUALS,
    "output-unexplained": RESIDUALS,
    PROCESS_NOISE: RESIDUALS,
    "errors-not-white": RESIDUALS,
    "errors-in-doubt": RESIDUALS,
    "inputs-in-errors": RESIDUALS,
    "excitation-refutes": RESIDUALS,
    "loop-biases": LOOP,
    "by-excitation": LOOP,
    "nothing-told": BAND,
}


@dataclass(frozen=True, eq=False)
class FitFacts:
    """What a fit hands over.

    Attributes
    ----------
    data : sequence of FrequencyResponse or Record
        What was fitted.
    inputs, outputs : tuple of str
        Channels of the model.
    spans : sequence of Span
        Band and mean coherence of each fitted response; empty for records alone.
    findings : sequence of Finding
        Of the fit.
    termination : str
        Why the iteration ended; empty where nothing was iterated.
    signs : mapping of str to (sign, value, interval or None, status)
        Parameters whose bounds declare a sign.
    loop : {"open", "closed"} or None
        The caller's word.
    agreement : Agreement or None
        Of parts of the data, where they were compared.
    values : ndarray or None
        Estimates, in its order.
    at_once : tuple of str
        Inputs that a sampled model answers within the same sample.
    free_runs : sequence of ExplainedRun
        Of equations through the records that they were fitted to, where the fit made such.
    unseen : UnseenScatter or None
        What records that agree cannot exclude; None where coefficients have no scale of their own.
    """

    data: Sequence[FrequencyResponse | Record]
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    spans: Sequence[Span]
    findings: Sequence[Finding]
    termination: str
    signs: Mapping[str, tuple[int, float, tuple[float, float] | None, str]]
    loop: Loop | None = None
    agreement: Agreement | None = None
    values: NDArray[np.float64] | None = None
    at_once: tuple[str, ...] = ()
    free_runs: Sequence[ExplainedRun] = ()
    unseen: UnseenScatter | None = None


def gather_evidence(made: FitFacts) -> Evidence:
    """Examine a fit as far as its own data and end allow.

    Parameters
    ----------
    made : FitFacts
    """
    responses = [each for each in made.data if isinstance(each, FrequencyResponse)]
    records = [each for each in made.data if isinstance(each, Record)]
    checks: list[Check] = time_checks(records)
    checks += sample_checks(made.data, {*made.inputs, *made.outputs})
    if made.spans:
        checks += [judge_span(made.spans), judge_coherence(made.spans)]
    elif records:
        seen = power_of_records(tuple(records), made.inputs, made.outputs)
        checks += by_free_runs(seen, made.outputs, made.free_runs)
    declared = None if made.loop is None else loop_check(declared_loop(made.loop))
    if _is_by_excitation(made.termination, records) and made.loop != "open":
        declared = loop_check(FeedbackTest("closed", "instrument"))
    loop = declared or (loop_of_responses(responses) if responses else None)
    if loop is None and records:
        loop = loop_of_records(tuple(records), made.inputs, made.outputs)
    if loop is not None:
        checks.append(not_turned_round(unless_hidden(loop, made.free_runs), made.at_once))
    if made.agreement is not None:
        check = beside_loop(agreement_check(made.agreement, made.values, made.unseen), loop)
        disturbed = any(each.code == PROCESS_NOISE for each in made.findings)
        checks.append(beside_disturbances(check) if disturbed else check)
    if made.signs:
        checks.append(declared_signs(made.signs))
    checks = _with_findings(checks, made)
    return Evidence(tuple(checks), _required(made, responses, records))


def _is_by_excitation(termination: str, records: Sequence[Record]) -> bool:
    """Whether instruments were made of what was injected: a closed loop does not bias those."""
    return termination == "instruments" and bool(records) and all(r.excitations for r in records)


def _required(
    made: FitFacts, responses: Sequence[FrequencyResponse], records: Sequence[Record]
) -> tuple[str, ...]:
    histories = [*(each.history for each in responses), *(each.history for each in records)]
    signs = (SIGNS,) if made.signs else ()
    return (*((INSPECTION,) if is_of_log(histories) else ()), *ALWAYS, *signs)


def _with_findings(checks: list[Check], made: FitFacts) -> list[Check]:
    """The checks with the fit's findings among them, the worst word of each name first."""
    groups: dict[str, list[Finding]] = {SETTLED: [], GUIDELINES: []}
    for finding in made.findings:
        code = finding.code
        name = HOLD if code.startswith("hold-") else BELONGS.get(code, GUIDELINES)
        groups.setdefault(name, []).append(finding)
    found = {check.name: check for check in checks}
    for name, findings in groups.items():
        said = _of_findings(name, findings, made.termination)
        if said is not None:
            found[name] = worse(found.get(name), said)
    return list(found.values())


def _of_findings(name: str, findings: Sequence[Finding], termination: str) -> Check | None:
    """The check of a name, with what these data cannot tell beside it."""
    words = "; ".join(each.message for each in findings if each.code in LIMITS)
    check = _judged(name, [each for each in findings if each.code not in LIMITS], termination)
    if not words:
        return check
    return replace(check or Check(name, Light.GREEN, words), limit=words[:1].upper() + words[1:])


def _judged(name: str, findings: Sequence[Finding], termination: str) -> Check | None:
    light = worst(tuple(findings))
    if findings and light is not Light.GREEN:
        first = next(finding for finding in findings if finding.light is light)
        return Check(name, light, first.message, first.action)
    if name == SETTLED:
        return _ended(findings, termination)
    if name == GUIDELINES:
        met = "every guideline is met"
        # A guide that is missed by what is well known, or known to do no harm, all the same.
        missed = (each.message for each in findings if each.code in (*OF_PARAMETERS, OVERFIT))
        return Check(name, Light.GREEN, next(missed, met))
    return Check(name, Light.GREEN, findings[0].message) if findings else None


def _ended(findings: Sequence[Finding], termination: str) -> Check | None:
    corrected = "".join(f"; {finding.message}" for finding in findings)
    if termination in CONVERGED:
        return Check(SETTLED, Light.GREEN, f"the search ended at a minimum{corrected}")
    if termination in STRAIGHT:
        return Check(SETTLED, Light.GREEN, f"solved without a search{corrected}")
    if termination in STOPS:
        return Check(SETTLED, Light.GREEN, f"terms were chosen until {termination!r} said enough")
    return Check(SETTLED, Light.AMBER, f"the search ended by {termination!r}", MORE_STEPS)


def worse(one: Check | None, other: Check) -> Check:
    """The one of two checks with the worse light; the first where they are alike."""
    if one is None:
        return other
    pair = (one.finding, other.finding)
    return one if worst(pair) is one.light else other


def inspection_check(inspection: Inspection, channels: Iterable[str]) -> Check:
    """The verdict on the log that the data come from, as far as the fitted axes go."""
    findings = inspection.findings_on(channels)
    light = worst(findings)
    reasons = [finding for finding in findings if finding.light is light]
    if light is Light.GREEN or not reasons:
        return Check(INSPECTION, light, f"{inspection.name} can support identification")
    return Check(INSPECTION, light, reasons[0].message, reasons[0].action)


def sweep_check(inspection: Inspection, channels: Iterable[str]) -> tuple[Check, ...]:
    """That axes of a fit were not swept, so that gains are not made of it; none where they were.

    A model may be tried of plain flying, and is judged by what it predicts; its gains would be
    promised by a log that carries none.
    """
    wanted = set(channels)
    known = axes_of(inspection.vehicle).items()
    fitted = [axis for axis, own in known if own.command in wanted and own.rate in wanted]
    still = [axis for axis in fitted if not is_swept(inspection, axis)]
    if not still:
        return ()
    told = (f.action for f in inspection.findings if f.code == "no-model" and f.action)
    said = f"nothing was injected about {' and '.join(still)}, and no sweep was flown"
    action = next(told, f"sweep it: flightid plan {inspection.name}")
    return (Check(SWEEP, Light.UNKNOWN, f"{said}: no gains are made of this model", action),)


def residual_check(findings: Iterable[Finding]) -> Check:
    """The verdict of residual tests."""
    found = tuple(findings)
    light = worst(found)
    first = next((finding for finding in found if finding.light is light), None)
    if first is None:
        return Check(RESIDUALS, Light.UNKNOWN, "no residual test could be made")
    return Check(RESIDUALS, light, first.message, first.action)


def loop_of_residuals(feedback: FeedbackTest, findings: Iterable[Finding]) -> Check | None:
    """What residual tests know of the loop; None where it was declared or nothing speaks of one.

    A residual that comes before an input makes the loop unknown where no test calls it closed.

    Example
    -------
    >>> loop_of_residuals(FeedbackTest("closed", "test", 1e-9, "da", 0.2), ()).light.value
    'amber'
    >>> loop_of_residuals(FeedbackTest("open", "declared"), ()) is None
    True
    """
    if feedback.source in ("declared", "repeats"):
        return None
    if feedback.is_closed:
        return loop_check(feedback)
    leads = next((each for each in findings if each.code == LEADS), None)
    if leads is None:
        return None
    what = f"whether a loop is closed cannot be told: {leads.message}"
    return Check(LOOP, Light.UNKNOWN, what, leads.action)
