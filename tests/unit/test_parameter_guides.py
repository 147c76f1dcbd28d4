"""Guides to parameters speak of model and band: where an interval is narrow they are a note."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import flightid as fid
from flightid.conventions import Light
from flightid.evidence.evidence import GUIDELINES
from flightid.evidence.gather import OF_PARAMETERS, FitFacts, gather_evidence
from flightid.findings import Finding
from flightid.identification.fit_findings import DETERMINED, judge_correlation, judge_parameters
from flightid.identification.rival_holds import OtherHold
from flightid.identification.told_hold import widened
from flightid.uncertainty.estimate import Estimate
from tests.strangers import holds

HALF_WIDTH = 1.96


def _parameter(name: str, stderr: float | None) -> Estimate:
    return Estimate(
        name, 2.0, "s", stderr, insensitivity_percent=21.0, cramer_rao_percent=30.0, status="free"
    )


def _guidelines(*findings: Finding) -> tuple[Light, str]:
    facts = FitFacts((), ("u",), ("y",), (), findings, "gradient", {})
    check = gather_evidence(facts).check(GUIDELINES)
    assert check is not None
    return check.light, check.what


@pytest.mark.parametrize(
    ("share", "light"),
    [(0.046, Light.GREEN), (0.99 * DETERMINED, Light.GREEN), (1.01 * DETERMINED, Light.AMBER)],
)
def test_a_narrow_interval_outweighs_the_guides(share: float, light: Light) -> None:
    p = _parameter("tau", share * 2.0 / HALF_WIDTH)
    (found,) = judge_parameters({"tau": p})
    assert found.light is light
    assert bool(found.action) is (light is Light.AMBER)
    high = np.array([[1.0, 0.99], [0.99, 1.0]])
    (pair,) = judge_correlation(("tau", "T"), high, {"tau": p, "T": _parameter("T", 0.01)})
    assert pair.light is light
    assert "correlated by +0.990, above the guide of 0.98" in pair.message
    seen, what = _guidelines(found, pair)
    assert seen is light
    assert "insensitivity 21 % is above the guide of 10 %" in what


def test_without_an_interval_the_guides_stand() -> None:
    bare = {"tau": _parameter("tau", None)}
    assert [each.light for each in judge_parameters(bare)] == [Light.AMBER]
    assert _guidelines() == (Light.GREEN, "every guideline is met")


def test_what_is_said_of_parameters_is_of_the_intervals_that_are_shown() -> None:
    """A hold in doubt makes bars longer after the verdicts: these tell the longer ones."""
    fit = fid.identify(holds.model(), holds.flight(0, "steps", told=True), method="equation_error")
    guided = {
        name: replace(each, insensitivity_percent=21.0) for name, each in fit.parameters.items()
    }
    tight = np.full_like(fit.correlation, 0.99)
    said = (*judge_parameters(guided), *judge_correlation(fit.names, tight, guided))
    assert {each.light for each in said} == {Light.GREEN}
    fit = replace(fit, parameters=guided, correlation=tight, findings=(*fit.findings, *said))
    shift = tuple(0.5 * abs(fit.parameters[name].value) for name in fit.names)
    wide = widened(fit, [OtherHold("zero", "tau", 9.0, None, shift)])
    assert np.all(np.sqrt(np.diag(wide.covariance)) >= shift)
    now = [each for each in wide.findings if each.code in OF_PARAMETERS]
    assert len(now) == len(said)
    assert {each.light for each in now} == {Light.AMBER}
    assert not any("is known to" in each.message for each in now)
