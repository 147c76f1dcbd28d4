"""Verdicts on a model from the correlation tests of its residuals."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

from flightid.conventions import Light
from flightid.evidence.gather import LEADS
from flightid.findings import GRAVITY, Finding
from flightid.uncertainty.foretold import NEGLIGIBLE_PERCENT, is_material
from flightid.uncertainty.residual_correlation import LEVEL
from flightid.validation.residuals.correlation_result import CorrelationTest, Kind, Verdict
from flightid.validation.residuals.obstacles import VOID

_CODES = {
    Kind.WHITENESS: "residuals-not-white",
    Kind.INDEPENDENCE: "residuals-follow-input",
    Kind.EVEN: "residuals-follow-input-squared",
    Kind.EVEN_SQUARED: "residual-power-follows-input",
    Kind.BILINEAR: "residuals-follow-product",
    Kind.CROSS: "residuals-follow-other-output",
}
_ACTIONS = {
    Kind.WHITENESS: "raise the order of the noise model, or of the whole model",
    Kind.INDEPENDENCE: "dynamics from this input are missing: check its delay and order",
    Kind.EVEN: "an even nonlinearity is missing: add terms such as u²",
    Kind.EVEN_SQUARED: "terms in this input are missing, linear or not: see which other test fails",
    Kind.BILINEAR: "products of noise and input are missing: add bilinear terms",
    Kind.CROSS: "the outputs share noise or dynamics: give the other output as an input, or fit a "
    "state space with both",
}
_OF_PRODUCTS = frozenset({Kind.EVEN, Kind.EVEN_SQUARED, Kind.BILINEAR})
"""What a wrong linear model fails too: the square of one given input follows the input itself."""
_LINEAR_FIRST = (
    "mend the linear part first: {} fails too, and what that leaves of one given input follows its "
    "square and products as well, so that no nonlinearity is shown yet"
)
_BEFORE = (
    "the residual comes before the input, as feedback makes it: declare loop='closed' where a "
    "controller moved the input; else dynamics from it are missing"
)


def residual_findings(tests: tuple[CorrelationTest, ...]) -> tuple[Finding, ...]:
    """Findings of failures: red where neither chance nor a small size excuses them.

    Notes where chance does it, of as many tests as were made, or where the part that is missed
    lies below `NEGLIGIBLE_PERCENT` of an output that is known; amber below `MATERIAL_PERCENT`.
    Beside a linear test that fails those of squares and products show no nonlinearity. The worst
    comes first: by light, then by the part of the output that is missed, then by chance.

    Example
    -------
    >>> residual_findings(())[0].code
    'residuals-not-testable'
    """
    made = [test for test in tests if test.counts and test.verdict is not Verdict.NOT_TESTABLE]
    failures = [(test, _failure(test, len(made))) for test in made if test.verdict is Verdict.FAIL]
    failures.sort(key=lambda each: _rank(*each))
    failed = [test for test, _ in failures]
    found = _linear_first(failed, [said for _, said in failures])
    if made and not failed:
        found.append(
            Finding(
                "residuals-pass", Light.GREEN, f"all {len(made)} residual tests that count pass"
            )
        )
    missed = dict.fromkeys(
        test.reason
        for test in tests
        if test.counts
        and test.verdict is Verdict.NOT_TESTABLE
        and not (made and test.reason == VOID)
    )
    for reason in missed:
        names = ", ".join(test.name for test in tests if test.counts and test.reason == reason)
        found.append(
            Finding("residuals-not-testable", Light.UNKNOWN, f"not testable: {names}: {reason}")
        )
    if not tests:
        found.append(Finding("residuals-not-testable", Light.UNKNOWN, "there are no tests"))
    return tuple(found)


def _rank(test: CorrelationTest, said: Finding) -> tuple[int, float, float]:
    """Place of a failure among all: no order of channels decides which of them a check tells."""
    return GRAVITY.index(said.light), -(test.worth_percent or 0.0), test.p_value or 0.0


def _linear_first(failed: Sequence[CorrelationTest], found: Sequence[Finding]) -> list[Finding]:
    """Findings whose actions ask for no nonlinear term while the linear part is wrong."""
    pairs = list(zip(failed, found, strict=True))
    linear = [
        test.name
        for test, said in pairs
        if test.kind is Kind.INDEPENDENCE and said.light is not Light.GREEN
    ]
    if not linear:
        return list(found)
    action = _LINEAR_FIRST.format("; ".join(linear))
    return [
        replace(said, action=action) if test.kind in _OF_PRODUCTS and said.action else said
        for test, said in pairs
    ]


def _failure(test: CorrelationTest, n_tests: int) -> Finding:
    p_value = test.p_value or 0.0
    sure, leads = p_value * n_tests < 1.0 - LEVEL, _leads(test)
    worth = test.worth_percent
    parts = [f"{test.name} fails: p = {p_value:.2g}", *_limits_missed(test)]
    message = ", ".join(parts)
    if not sure:
        message += f"; among {n_tests} tests chance alone may do that"
    elif worth is not None:
        message += f"; worth {worth:.2g} % of {test.output}"
    action = _BEFORE if leads else _ACTIONS[test.kind]
    light = Light.RED if is_material(worth) else Light.AMBER
    if not sure or (worth is not None and worth < NEGLIGIBLE_PERCENT):
        light, action = Light.GREEN, ""
    return Finding(LEADS if leads and sure else _CODES[test.kind], light, message, action)


def _limits_missed(test: CorrelationTest) -> Iterator[str]:
    outside, allowed = test.exceedances, test.exceedance_limit
    if outside is not None and allowed is not None and outside > allowed:
        yield f"{outside} lags outside where {allowed} are allowed"
    largest, band = test.largest, test.simultaneous_band
    if largest is not None and band is not None and abs(largest) > band:
        yield f"largest {largest:.3f}, beyond {band:.3f}"


def _leads(test: CorrelationTest) -> bool:
    """Whether the largest judged correlation is with a later input."""
    judged = [
        (abs(value), lag)
        for value, lag, used in zip(test.values, test.lags, test.judged, strict=True)
        if used
    ]
    return test.kind is Kind.INDEPENDENCE and max(judged)[1] < 0
