"""The gate: what checks make of a light, what a fit examines, and that nothing absent is green."""

from __future__ import annotations

import math
import pickle
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import flightid as fid
from flightid.conventions import Light
from flightid.errors import OptionError
from flightid.evidence import Check, Evidence, inspection_check, residual_check
from flightid.evidence.evidence import ALWAYS, NAMES
from flightid.evidence.explained import FEWEST, ExplainedRun, _powers, explained_spans
from flightid.evidence.gather import LIMITS, _of_findings
from flightid.evidence.parameter_checks import declared_signs
from flightid.evidence.spans import Span, judge_coherence, judge_span, spans_of
from flightid.findings import Finding, worst
from tests.closeness import assert_close


def _all_green() -> Evidence:
    return Evidence(tuple(Check(name, Light.GREEN, "fine") for name in ALWAYS))


def test_green_needs_every_required_check() -> None:
    assert _all_green().light is Light.GREEN
    for name in ALWAYS:
        left = tuple(check for check in _all_green().checks if check.name != name)
        evidence = Evidence(left)
        assert (evidence.light, evidence.missing) == (Light.AMBER, (name,))
        assert evidence.reason is not None
        assert "not examined" in evidence.reason.message
    assert Evidence().light is Light.AMBER
    assert Evidence((), ()).light is Light.AMBER


@pytest.mark.parametrize(
    ("light", "whole"), [("red", "red"), ("amber", "amber"), ("unknown", "amber")]
)
def test_one_worse_check_is_the_light_of_all(light: str, whole: str) -> None:
    evidence = _all_green().with_checks([Check("residuals", Light(light), "bad", "do this")])
    assert evidence.light == whole
    assert evidence.reason is not None
    assert (evidence.reason.message, evidence.reason.action) == ("bad", "do this")


def test_what_was_examined_gives_the_reason_before_what_was_not() -> None:
    evidence = Evidence((Check("loop", Light.AMBER, "closed"),))
    assert evidence.reason is not None
    assert evidence.reason.message == "closed"


def test_a_check_replaces_that_of_its_name_and_may_be_required() -> None:
    evidence = _all_green().with_checks(
        [Check("loop", Light.RED, "closed")], required=["residuals"]
    )
    assert len(evidence.checks) == len(ALWAYS)
    assert (evidence.light, evidence.missing) == (Light.RED, ("residuals",))
    with pytest.raises(OptionError, match="no such check"):
        Evidence((), ("weather",))
    with pytest.raises(OptionError, match="no such check"):
        Check("weather", Light.GREEN, "fine")


def test_views_hold_everything() -> None:
    evidence = Evidence((Check("loop", Light.GREEN, "open"),), ("loop", "inspection"))
    assert Evidence.from_dict(evidence.to_dict()) == evidence
    text = evidence.summary().to_text()
    assert "not examined" in text
    assert "inspect_log" in text
    assert [finding.code for finding in evidence.findings] == [
        "evidence-inspection",
        "evidence-loop",
    ]
    assert repr(evidence) == "Evidence(amber, 1 checks, not examined: inspection)"
    assert set(ALWAYS) < set(NAMES)


def test_coherence_counts_the_gaps_of_a_band_and_its_text_names_them() -> None:
    omega = np.geomspace(1.0, 16.0, 9)
    coherence = np.array([0.1, 0.9, 0.9, 0.1, 0.1, 0.1, 0.1, 0.9, 0.1])
    (span,) = spans_of(
        fid.FrequencyResponse.from_values(
            omega, np.ones(9), inputs=["a"], outputs=["y"], coherence=coherence[None, None]
        )
    )
    assert judge_coherence([span]).light == "amber"
    assert str(span) == "y 1.41 to 2 and 11.3 rad/s"
    assert "y 1.41 to 2 and 11.3 rad/s: too narrow" in judge_span([span]).what


def test_a_broken_band_counts_the_decades_without_its_gaps() -> None:
    parts = ((1.0, 2.0), (3.0, 4.0), (5.0, 6.0))
    three = Span("y", (1.0, 100.0), 0.9, 0.5, parts)
    assert str(three) == "y 1 to 2 and 3 to 4 and 5 to 6 rad/s"
    assert_close(three.ratio, math.sqrt(10.0), rtol=1e-12, why="half a decade")
    four = Span("y", (1.0, 100.0), 0.9, 0.5, (*parts, (7.0, 100.0)))
    assert str(four) == "y 1 to 100 rad/s in 4 pieces, together 3.16 to 1"


@pytest.mark.parametrize(("ratio", "light"), [(20.0, "green"), (4.0, "amber"), (2.0, "amber")])
def test_a_narrow_band_is_not_green(ratio: float, light: str) -> None:
    assert judge_span([Span("p/tau", (1.0, ratio), 0.9)]).light == light
    assert judge_span([Span("p/tau", None, 0.1), Span("q/tau", (1.0, 30.0), 0.9)]).light == "amber"


@pytest.mark.parametrize(
    ("sign", "value", "interval", "light"),
    [
        (1, 2.0, (1.0, 3.0), "green"),
        (1, 2.0, (-1.0, 5.0), "amber"),
        (-1, -2.0, (-5.0, 0.5), "amber"),
        (-1, -2.0, (-5.0, 0.0), "amber"),
        (-1, 0.0, None, "amber"),
    ],
)
def test_a_sign_that_the_data_do_not_tell_is_doubted(
    sign: int, value: float, interval: tuple[float, float] | None, light: str
) -> None:
    assert declared_signs({"L": (sign, value, interval, "free")}).light == light


def test_residual_tests_and_inspections_become_checks() -> None:
    bad = Finding("residuals-not-white", Light.RED, "fails", "raise the order")
    assert residual_check([bad]).light is Light.RED
    assert residual_check([]).light is Light.UNKNOWN

    class Inspected:
        name = "log.bin"
        verdict = Light.AMBER
        findings = (Finding("narrow", Light.AMBER, "too narrow", "fly a sweep"),)

        def findings_on(self, channels: tuple[str, ...]) -> tuple[Finding, ...]:
            assert channels == ("tau_phi", "p")
            return self.findings

    check = inspection_check(Inspected(), ("tau_phi", "p"))  # type: ignore[arg-type]
    assert (check.light, check.what) == (Light.AMBER, "too narrow")


def test_a_loop_declared_to_the_fit_is_its_evidence() -> None:
    u = np.random.default_rng(0).standard_normal(400)
    record = fid.Record.from_arrays(
        np.arange(400) / 10, inputs={"u": u}, outputs={"y": np.convolve(u, [0.0, 1.0, 0.5])[:400]}
    )
    asked = fid.PolynomialModel.arx(("u",), "y", na=1, nb=2)
    for loop, light in (("open", "green"), ("closed", "amber")):
        fit = fid.identify(asked, record, loop=loop)
        assert not isinstance(vars(fit)["evidence"], Evidence), "gathered once it is asked for"
        assert pickle.loads(pickle.dumps(fit)).evidence == fit.evidence
        assert vars(fit)["evidence"] is fit.evidence
        check = fit.evidence.check("loop")
        assert check is not None
        assert (check.what, check.light) == (f"loop {loop}, as declared", light)
    with pytest.raises(OptionError, match="loop is not known"):
        fid.identify(asked, record, loop="half")


def test_nothing_that_is_computed_from_a_fit_is_greener_than_it(tmp_path: Path) -> None:
    omega = np.geomspace(0.5, 20.0, 30)
    truth = fid.load_model("rate_motor_lag").with_values({"Lp": -5.0})
    data = fid.FrequencyResponse.from_values(
        omega, truth.frequency_response(omega), inputs=truth.inputs, outputs=truth.outputs,
        units=truth.units, random_error=np.full((1, 1, 30), 0.02))  # fmt: skip
    fit = fid.identify(truth, data)
    bad = Check("residuals", Light.RED, "the residuals are not white", "raise the order")
    fit = replace(fit, evidence=fit.evidence.with_checks([bad]))
    assert fit.evidence.band_rad_s == (0.5, 20.0)
    stored = fid.load_model(fid.write_model(fit, tmp_path / "fit.toml"))
    control, rate = truth.inputs[0], truth.outputs[0]
    for source in (fit, stored):
        closed = fid.close_loop(source, {control: {rate: 0.05}}, draws=0)
        made = [closed, fid.margins(source), fid.modes(source)]
        if source is fit:  # a file of it is the same source to the others
            made += [
                closed.margins()[control],
                fid.disk_margin(source),
                fid.handling_qualities(source, axes={}),
                fid.lower_order(source, kind="roll"),
            ]
        for result in made:
            assert worst(result.findings) is Light.RED, result
            said = [f.message for f in result.findings if f.code == "source-evidence"]
            assert len(said) == 1, result
            assert "not white" in said[0]
            assert "holds from 0.5 to 20 rad/s" in said[0]
    beyond = fid.margins(fit, controller=10.0)
    assert "crossover-outside-band" in {finding.code for finding in beyond.findings}


def test_a_closed_loop_is_the_reason_before_the_tests_that_it_spoils() -> None:
    loop = Check("loop", Light.AMBER, "loop closed", "use an instrument")
    tests = Check("residuals", Light.RED, "they are not white", "raise the order")
    verdict = _all_green().with_checks([loop, tests]).verdict
    assert (verdict.light, verdict.action) == (Light.RED, "use an instrument")
    assert verdict.message == "loop closed; they are not white"


def test_the_headline_begins_with_what_is_predicted_of_unseen_data() -> None:
    seen = Check("prediction", Light.GREEN, "predicts 84 % of y")
    coloured = Check("residuals", Light.AMBER, "errors are not white", "raise the order")
    both = _all_green().with_checks([coloured, seen]).verdict
    assert (both.light, both.message) == (Light.AMBER, "predicts 84 % of y; errors are not white")
    assert _all_green().with_checks([seen]).verdict.message.startswith("predicts 84 % of y; every")
    poor = Check("prediction", Light.RED, "predicts y no better than a constant", "add terms")
    assert _all_green().with_checks([poor]).verdict.message == poor.what


def test_what_data_cannot_tell_stands_beside_what_they_say() -> None:
    code = min(LIMITS)
    unseen = Finding(code, Light.AMBER, "no data tell of drift", "")
    bad = Finding("residuals-not-white", Light.RED, "fails", "raise the order")
    alone = _of_findings("residuals", [unseen], "")
    both = _of_findings("residuals", [unseen, bad], "")
    assert alone is not None
    assert (alone.light, alone.limit) == (Light.GREEN, "No data tell of drift")
    assert both is not None
    assert (both.light, both.what, both.limit) == (Light.RED, "fails", "No data tell of drift")


def test_a_tone_that_is_explained_stands_in_the_bin_of_its_frequency() -> None:
    edges, step = np.array([1.0, 2.0, 4.0, 8.0, 16.0]), 0.02
    time_s = step * np.arange(4000)
    for place, omega in enumerate((1.4, 2.8, 5.6, 11.2)):
        tone = np.sin(omega * time_s)[None]
        said, left = _powers(ExplainedRun(tone, 0.5 * tone, step), edges)[:, 0]
        assert int(np.argmax(said)) == int(np.argmax(left)) == place
        assert_close(said[place], said.sum(), rtol=1e-6, why="a Hann window")


def test_a_record_of_fewer_than_64_samples_is_not_looked_at() -> None:
    tone = np.sin(0.5 * np.arange(64.0))[None]
    assert FEWEST == 64
    assert explained_spans(["y"], [ExplainedRun(tone[:, :-1], tone[:, :-1], 0.02)])[0] == []
    assert len(explained_spans(["y"], [ExplainedRun(tone, tone, 0.02)])[0]) == 1
