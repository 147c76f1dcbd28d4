"""Guides to parameters speak of model and band: where an interval is narrow they are a note."""

from __future__ import annotations

import numpy as np
import pytest

from flightid.conventions import Light
from flightid.evidence.evidence import GUIDELINES
from flightid.evidence.gather import FitFacts, gather_evidence
from flightid.findings import Finding
from flightid.identification.fit_findings import DETERMINED, judge_correlation, judge_parameters
from flightid.uncertainty.estimate import Estimate

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
