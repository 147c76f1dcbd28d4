"""Warnings that told nothing bad from good are notes; what they were meant for stays amber or red.

docs/evidence.md keeps how often sound and barren records lie beyond each threshold; the count is
`tests/strangers/rig_lights.py`.
"""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from flightid.conventions import Light
from flightid.evidence import residual_check
from flightid.evidence.spans import Span, judge_span
from flightid.identification.fit_findings import DETERMINED
from flightid.identification.records.findings import judge_fit
from flightid.inspection.thresholds import BAND_LEAST
from flightid.study.proposal.of_records import study_of_records
from flightid.study.proposal.stretches import RICHER
from flightid.study.structures import RUNS_ALIKE
from flightid.uncertainty.foretold import MATERIAL_PERCENT, NEGLIGIBLE_PERCENT
from flightid.uncertainty.residual_colour import WELL_TOLD, colour_findings
from flightid.validation import residual_tests
from flightid.validation.residuals.correlation_result import Kind, Verdict
from flightid.validation.residuals.findings import residual_findings
from flightid.validation.spectra.spectra import PEAK_PERCENT
from flightid.validation.verification.held_otherwise import NO_MATTER_PERCENT

TABLE = {
    "DETERMINED": 100 * DETERMINED,
    "BAND_LEAST": BAND_LEAST.value,
    "NEGLIGIBLE_PERCENT": NEGLIGIBLE_PERCENT,
    "MATERIAL_PERCENT": MATERIAL_PERCENT,
    "WELL_TOLD": WELL_TOLD,
    "PEAK_PERCENT": PEAK_PERCENT,
    "NO_MATTER_PERCENT": NO_MATTER_PERCENT,
    "RUNS_ALIKE": RUNS_ALIKE,
    "RICHER": RICHER,
}


def test_the_page_of_evidence_tells_the_thresholds_of_the_code() -> None:
    page = (Path(__file__).parents[2] / "docs" / "evidence.md").read_text()
    rows = dict(re.findall(r"^\| `([A-Z_]+)` \| ([\d.]+)", page, flags=re.MULTILINE))
    assert {name: float(value) for name, value in rows.items()} == pytest.approx(TABLE)


def test_half_a_decade_is_enough_for_what_predicts() -> None:
    for ratio, lights in (
        (2.9, ("amber", "amber")),
        (3.1, ("amber", "green")),
        (10.0, ("green",) * 2),
    ):
        span = [Span("y", (1.0, ratio), 0.9)]
        found = [judge_span(span, predicted=told).light.value for told in (False, True)]
        assert tuple(found) == lights


def test_colour_that_bars_hold_is_a_note() -> None:
    for ratio, light in ((0.99 * WELL_TOLD, Light.GREEN), (1.01 * WELL_TOLD, Light.AMBER)):
        (found,) = colour_findings(1.0, ratio)
        assert found.light is light
        assert bool(found.action) is (light is Light.AMBER)
        assert "intervals allow for it" in found.message
        (bare,) = colour_findings(1.0, ratio, has_bars=False)
        assert bare.light is light
        assert "interval" not in bare.message


@pytest.mark.parametrize(
    ("p_value", "worth", "light"),
    [
        (1e-6, 0.9 * NEGLIGIBLE_PERCENT, Light.GREEN),
        (1e-6, 1.1 * NEGLIGIBLE_PERCENT, Light.AMBER),
        (1e-6, 1.1 * MATERIAL_PERCENT, Light.RED),
        (1e-6, None, Light.RED),
        (0.03, 50.0, Light.GREEN),
    ],
)
def test_a_failure_is_worth_what_it_misses(
    p_value: float, worth: float | None, light: Light
) -> None:
    random = np.random.default_rng(1)
    u, y = random.standard_normal((2, 400))
    tests = residual_tests(y, u, horizon="one step ahead").tests
    (failing,) = (t for t in tests if t.kind is Kind.INDEPENDENCE)
    passed = [replace(t, verdict=Verdict.PASS) for t in tests if t is not failing]
    bad = replace(failing, verdict=Verdict.FAIL, counts=True, p_value=p_value, worth_percent=worth)
    found = residual_findings((bad, *passed))[0]
    assert found.light is light
    assert "fails: p = " in found.message


@pytest.mark.parametrize("order", [1, -1])
def test_the_worst_output_is_told_in_any_order(order: int) -> None:
    costs = dict([("p", 15.0), ("r", 35.0), ("ay", 38.0)][::order])
    # Of what ay leaves its own white noise makes most.
    said = judge_fit(costs, (1.0, 1.0), lambda: {"ay": 25.0})
    assert [each.message.split(":")[0] for each in said[:3]] == ["r", "p", "ay"]
    # Where no output is left more than any misfit may be, noise is not asked.
    said = judge_fit({name: 0.2 * cost for name, cost in costs.items()}, (1.0, 1.0), lambda: {}[""])
    assert [each.message.split(":")[0] for each in said[:3]] == ["ay", "r", "p"]
    random = np.random.default_rng(1)
    u, y = random.standard_normal((2, 400))
    (test,) = (
        each
        for each in residual_tests(y, u, horizon="one step ahead").tests
        if each.kind is Kind.INDEPENDENCE
    )
    # What it is worth, by how sure a failure is; a size that is not known comes last of one light.
    failures = [("p", 20.0, 1e-9), ("r", 60.0, 1e-5), ("q", None, 1e-12), ("ay", 60.0, 1e-6)]
    made = [
        replace(
            test, output=output, verdict=Verdict.FAIL, counts=True, p_value=p, worth_percent=worth
        )
        for output, worth, p in failures[::order]
    ]
    found = residual_findings(tuple(made))
    assert {each.light for each in found} == {Light.RED}
    words = residual_check(found).what
    assert words == found[0].message
    assert words.endswith("worth 60 % of ay")
    assert [each.message.rsplit(" ", 1)[1] for each in found[:3]] == ["ay", "r", "p"]


@pytest.mark.parametrize("rising", [True, False])
def test_the_fast_end_of_a_sweep_is_fitted(rising: bool, tmp_path: Path) -> None:
    time_s = np.arange(900) * 0.05
    u = np.sin(0.05 * time_s**2)[:: 1 if rising else -1]
    y = np.zeros(900)
    for k in range(1, 900):
        y[k] = 0.9 * y[k - 1] + 0.1 * u[k - 1]
    y += 0.01 * np.random.default_rng(2).standard_normal(900)
    path = tmp_path / "rig.csv"
    table = np.column_stack([time_s, u, y])
    np.savetxt(path, table, "%.6g", ",", header="time [s],u,y", comments="")
    made = study_of_records(
        [path], tmp_path, model="rate_first_order", inputs=("u",), outputs=("y",)
    )
    spans = re.findall(r"span_s = \[([\d.]+), ([\d.]+)\]", "\n".join(made.lines))
    ends = [tuple(map(float, each)) for each in spans]
    # Of a rising sweep the slow quarter verifies, of a falling one the last.
    assert (ends[0][0] > 10.0) is rising
    assert (ends[1][1] < 12.0) is rising
