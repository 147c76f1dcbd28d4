"""Gains of one axis: results, refusals, and what is said where nothing can be had."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

import flightid as fid
from flightid.control.autopilots import axis_loop, axis_loop_of
from flightid.control.tuning.axis_tuning import Setting, noise_limit
from flightid.control.tuning.controller_paths import ControllerPaths
from flightid.control.tuning.evidence import _towards_errors
from flightid.control.tuning.gain_search import _report
from flightid.control.tuning.gain_steps import AT_LIMIT, TunedGain
from flightid.control.tuning.loop_problem import LoopProblem, highest_crossover
from flightid.control.tuning.order_statistics import content_of_worst, least_share
from flightid.control.tuning.requirements import TuningRequirements
from flightid.control.tuning.tune_pid import naming_filters, noise_density
from flightid.conventions import Light
from flightid.errors import DataError, ModelError, OptionError, UnknownNameError
from flightid.evidence import Check, Evidence
from flightid.evidence.spans import Span, judge_span
from flightid.findings import Finding
from flightid.identification.fit_findings import NoiseCost, why_misfit
from flightid.identification.frequency_domain.misfit import MisfitForm, why_missed
from flightid.vehicles import fly, write_ardupilot_log
from tests.closeness import assert_close

FLOWN = axis_loop("arducopter", "roll", loop_rate_hz=400.0).with_gains(
    ATC_RAT_RLL_P=0.08, ATC_RAT_RLL_I=0.08, ATC_RAT_RLL_D=0.002
)
NEED = TuningRequirements(noise_growth=4.0)
BAND = (0.5, 90.0)


def _fit(coherence: np.ndarray | None = None, **values: float) -> fid.Fit:
    known = {"Ltphi": 140.0, "Lp": -3.4, "T_m": 0.045, "tau": 0.012} | values
    model = fid.load_model("rate_motor_lag", axis="roll").with_values(known)
    omega = np.geomspace(0.5, 90.0, 40)
    data = fid.FrequencyResponse.from_values(
        omega,
        model.frequency_response(omega),
        inputs=model.inputs,
        outputs=model.outputs,
        units=model.units,
        random_error=np.full((1, 1, 40), 0.03),
        coherence=None if coherence is None else coherence[None, None],
    )
    return fid.identify(model, data, correct_bias=False, minimum_coherence=None)


@pytest.fixture(scope="module")
def fit() -> fid.Fit:
    return _fit()


@pytest.fixture(scope="module", params=[20, pytest.param(60, marks=pytest.mark.nightly)])
def draws(request: pytest.FixtureRequest) -> int:
    return int(request.param)


@pytest.fixture(scope="module")
def design(fit: fid.Fit, draws: int) -> fid.PidDesign:
    return fid.tune_pid(fit, gains=FLOWN, requirements=NEED, draws=draws)


def test_gains_meet_every_requirement_for_fresh_plants(design: fid.PidDesign, draws: int) -> None:
    assert design.exists
    assert design.n_plants == draws + 1
    assert design.share_met > 0.85
    paths = design.problem.paths
    assert isinstance(paths, ControllerPaths)
    judged = design.problem.judge(paths.gains_of(design.loop)[None])
    # A mode above the band may take phase: what is asked of them holds inside it, and is promised
    # of no loop.
    for loop in ("rate loop", "whole loop"):
        assert design.worst_case(loop, "phase margin").worst is None
        assert judged.metrics[loop].phase_margin_deg.min() > 44.0
        assert judged.metrics[loop].sensitivity_peak.max() < 2.04
    assert judged.metrics["angle loop"].phase_margin_deg.min() > 59.0
    assert (design.worst_case("rate loop", "crossover").worst or 99.0) < 30.5
    assert design.binding


def test_worst_lies_beyond_nominal_and_the_flown_gains_stand_beside(design: fid.PidDesign) -> None:
    for each in design.worst_cases:
        if None in (each.nominal, each.worst, each.estimate.interval95):
            continue
        low, high = each.estimate.interval95 or (0.0, 0.0)
        assert low <= high
        assert each.worst is not None
        assert min(low, each.worst) <= (each.nominal or 0.0) <= max(high, each.worst)
    crossover = design.worst_case("rate loop", "crossover")
    assert crossover.flown is not None
    assert crossover.nominal is not None
    assert crossover.nominal > 1.2 * crossover.flown
    # An upper limit: its worst plant is the one that crosses highest.
    assert crossover.required.startswith("≤")
    assert crossover.worst is not None
    assert crossover.worst > crossover.nominal
    assert crossover.flown_worst is None or crossover.flown_worst > crossover.flown


def test_steps_never_exceed_the_limit_and_end_at_the_new_gains(design: fid.PidDesign) -> None:
    before = {change.name: change.flown for change in design.changes}
    for stage in design.stages:
        assert stage.stable
        for name, value in stage.gains.items():
            assert 1 / 2.002 <= value / before[name] <= 2.002
        before = dict(stage.gains)
    assert before == design.gains


def test_responses_settle_at_the_set_point(design: fid.PidDesign) -> None:
    step = design.response("rate step")
    assert_close(step.estimate[-1], 1.0, atol=0.05, why="one second after a step of the rate")
    assert np.all(step.low <= step.estimate)
    assert np.all(step.estimate <= step.high)
    hit = design.response("disturbance to angle")
    assert abs(hit.estimate[-1]) < 0.3 * np.abs(hit.estimate).max()
    assert hit.flown is not None
    assert np.abs(hit.estimate).max() < np.abs(hit.flown).max()


def test_the_result_shows_itself(design: fid.PidDesign) -> None:
    assert repr(design).startswith("PidDesign(roll: ATC_RAT_RLL_P")
    rest = tuple(each for each in design.worst_cases if each.name != "phase margin")
    assert repr(dataclasses.replace(design, worst_cases=rest)).endswith(
        "; no phase margin promised)"
    )
    assert design.to_dict()["schema"] == "flightid.pid_design/1"
    assert "Binding: " in str(design.summary())
    assert "95 % confidence" in str(design.worst_case_table())
    assert len(design.stage_table().rows) == len(design.stages)
    assert "<table>" in design._repr_html_()
    with pytest.raises(UnknownNameError, match="no such number"):
        design.worst_case("rate loop", "luck")
    with pytest.raises(UnknownNameError, match="no such response"):
        design.response("luck")


def test_a_target_is_reached_with_all_the_margin_there_is(fit: fid.Fit) -> None:
    need = dataclasses.replace(NEED, crossover_rad_s=12.0)
    design = fid.tune_pid(fit, gains=FLOWN, requirements=need, draws=5, angle_loop=False)
    crossover = design.worst_case("rate loop", "crossover")
    assert design.exists
    assert_close(crossover.worst or 0.0, 12.0, rtol=0.02, why="no more bandwidth than asked for")
    paths = design.problem.paths
    assert isinstance(paths, ControllerPaths)
    judged = design.problem.judge(paths.gains_of(design.loop)[None])
    assert judged.metrics["rate loop"].phase_margin_deg.min() > 60.0


@pytest.mark.nightly  # test_tuning_axes.py holds that none are written, in every run
def test_hopeless_plants_have_no_gains_and_it_is_said_why() -> None:
    slow = _fit(tau=0.2)
    need = dataclasses.replace(NEED, crossover_rad_s=15.0)
    design = fid.tune_pid(slow, gains=FLOWN, requirements=need, draws=5)
    assert not design.exists
    assert design.findings[0].light is Light.RED
    assert design.findings[0].code == "no-gains"
    assert "rate loop: crossover of the target" in design.findings[0].message
    assert design.loop is design.flown
    assert "no gains" in repr(design)
    assert "Cannot be met together" in str(design.summary())
    assert design.stages == ()


def test_what_flew_must_be_stable_in_the_model() -> None:
    wild = _fit(Ltphi=3000.0)
    design = fid.tune_pid(wild, gains=FLOWN, requirements=NEED, draws=5, angle_loop=False)
    assert any(f.code == "flown-unstable" and f.light is Light.RED for f in design.findings)


def test_models_without_errors_are_refused_or_taken_as_they_are(fit: fid.Fit) -> None:
    with pytest.raises(DataError, match="whose errors are not known"):
        fid.tune_pid(fit.model, gains=FLOWN)
    with pytest.raises(DataError, match="without an identified band"):
        fid.tune_pid(fit.model, gains=FLOWN, requirements=NEED, nominal=True)
    design = fid.tune_pid(fit.model, gains=FLOWN, requirements=NEED, nominal=True, band_rad_s=BAND)
    assert "no-uncertainty" in {finding.code for finding in design.findings}
    assert design.content == 0.0
    assert "errors are not known" in str(design.worst_case_table())


def test_what_took_the_errors_says_how_to_have_them() -> None:
    took = Finding("root-at-circle", Light.AMBER, "a root of C: no intervals", "lower the order")
    source = SimpleNamespace(findings=(Finding("seen", Light.GREEN, "16 starts"), took))
    assert _towards_errors(source, "a root of C") == "lower the order"
    assert _towards_errors(source, "given alone").startswith("fit a measured response")
    for why in (
        why_misfit(50.0, {"p/a": NoiseCost(0.2, 0.04)}),
        why_missed([MisfitForm("p", 26.0, 1e-30)]),
    ):
        assert _towards_errors(source, why).startswith("add the dynamics that the model lacks")


PLAIN = {"controller": fid.ControllerOptions(controller="p", loop_rate_hz=400.0), "draws": 5}


def test_a_crossover_of_a_plain_loop_where_little_was_measured_is_red() -> None:
    omega = np.geomspace(0.5, 90.0, 40)
    low = (omega > 8.0) & (omega < 40.0)
    design = fid.tune_controller(_fit(coherence=np.where(low, 0.3, 0.95)), **PLAIN)
    (found,) = [each for each in design.findings if each.code == "coherence-at-crossover"]
    assert found.light is Light.RED
    assert "coherence is 0.3" in found.message


def test_a_model_that_its_data_contradict_promises_a_plain_loop_less(fit: fid.Fit) -> None:
    errors, gaps = fit.model_errors["p/tau_phi"], []
    for bound in (0.02, 0.3, 0.8):
        doubted = dataclasses.replace(fit)
        own = dataclasses.replace(errors, bound=bound + 0.0 * errors.bound)
        doubted.__dict__["model_errors"] = {"p/tau_phi": own}
        if bound > 0.5:
            with pytest.raises(DataError, match="nowhere shown to hold"):
                fid.tune_controller(doubted, **PLAIN)
            continue
        design = fid.tune_controller(doubted, **PLAIN)
        # A mode above the band may take what is promised: the plants' own margins are asked.
        paths = design.problem.paths
        assert isinstance(paths, ControllerPaths)
        judged = design.problem.judge(paths.gains_of(design.loop)[None])
        margins = judged.metrics["loop"].phase_margin_deg[0]
        gaps.append(margins[0] - margins.min())
    # An error of 0.3 turns the loop by up to arcsin 0.3 = 17.5 degrees, of 0.02 by 1.1.
    assert 12.0 < gaps[1] - gaps[0] < 20.0


@pytest.mark.nightly
def test_a_crossover_where_little_was_measured_is_red() -> None:
    omega = np.geomspace(0.5, 90.0, 40)
    options = {"gains": FLOWN, "requirements": NEED, "draws": 5, "angle_loop": False}
    found = {}
    for name, dip in {"at the crossover": (8.0, 40.0), "elsewhere": (0.5, 2.0)}.items():
        low = (omega > dip[0]) & (omega < dip[1])
        design = fid.tune_pid(_fit(coherence=np.where(low, 0.3, 0.95)), **options)
        assert design.exists
        found[name] = [f for f in design.findings if f.code == "coherence-at-crossover"]
    assert found["elsewhere"] == []
    (first,) = found["at the crossover"]
    assert first.light is Light.RED
    assert first.message.startswith("rate loop: coherence is 0.3")
    assert "about the new crossover" in first.message


def test_a_log_tells_the_gains_that_flew(fit: fid.Fit, tmp_path: Path) -> None:
    log = fid.read_log(write_ardupilot_log(fly(duration_s=2.0), tmp_path / "sim.BIN"))
    options = {"requirements": NEED, "nominal": True, "angle_loop": False, "band_rad_s": BAND}
    design = fid.tune_pid(fit.model, gains=log, **options)
    expected = axis_loop_of(log, "roll")
    assert design.flown.gains == expected.gains
    assert design.flown.loop_rate_hz == expected.loop_rate_hz
    both = fid.tune({"roll": fit.model}, gains=log, **options)
    assert both["roll"].gains == design.gains


def test_red_evidence_is_refused(fit: fid.Fit) -> None:
    class Bad:
        findings = (Finding("theil", Light.RED, "misses"),)

    with pytest.raises(DataError, match="the verification is red"):
        fid.tune_pid(fit, gains=FLOWN, verification=Bad())
    red = dataclasses.replace(fit, findings=(Finding("cost", Light.RED, "cost 900"),))
    with pytest.raises(DataError, match="the fit is red"):
        fid.tune_pid(red, gains=FLOWN)
    # Sticks of 0.03 and 0.07 Hz on a pendulum of 0.6 Hz: 74 deg promised, 4.4 dB of the 6 left.
    narrow = dataclasses.replace(fit)
    seen = judge_span([Span("p/tau_phi", (1.0, 2.0), 0.9)])
    narrow.__dict__["evidence"] = Evidence((seen,), ())
    with pytest.raises(DataError, match="too narrow a band for gains"):
        fid.tune_pid(narrow, gains=FLOWN)
    # Slow and quick sticks, prewhitened: gains stood beside “no axis carries a model”.
    flying = dataclasses.replace(fit)
    swept = Check("sweep", Light.UNKNOWN, "nothing was injected about roll: no gains", "sweep it")
    flying.__dict__["evidence"] = Evidence((swept,), ())
    with pytest.raises(DataError, match=r"carries no gains.*injected about roll; needed.*sweep it"):
        fid.tune_pid(flying, gains=FLOWN)


def test_what_the_model_leaves_unexplained_is_refused_or_stands_in_the_result(
    fit: fid.Fit, tmp_path: Path
) -> None:
    loose = dataclasses.replace(fit, responses=(), costs={"p": 25.0})
    options = {"gains": FLOWN, "requirements": NEED, "draws": 5, "band_rad_s": BAND}
    with pytest.raises(DataError, match="too much of the data is left unexplained"):
        fid.tune_pid(loose, **options)
    design = fid.tune_pid(loose, **options, accept_red=True, angle_loop=False)
    assert [f.code for f in design.findings if f.light is Light.RED] == ["accepted-red"]
    with pytest.raises(DataError, match="a finding on the gains is red"):
        design.write(tmp_path / "roll.param")
    assert not list(tmp_path.iterdir())
    path, *_ = design.write(tmp_path / "roll.param", accept_red=True)
    assert "# RED, accepted by the user: " in path.read_text()


@pytest.mark.nightly
def test_a_structure_that_its_data_contradict_lowers_what_is_promised(fit: fid.Fit) -> None:
    errors = fit.model_errors["p/tau_phi"]
    assert_close(errors.bound.max(), 0.06, atol=0.03, why="two deviations of random errors of 3 %")
    wrong = dataclasses.replace(fit)
    wrong.__dict__["model_errors"] = {
        "p/tau_phi": dataclasses.replace(errors, bound=0.3 + 0.0 * errors.bound)
    }
    options = {"gains": FLOWN, "requirements": NEED, "draws": 24, "angle_loop": False}
    right, doubted = (fid.tune_pid(each, **options) for each in (fit, wrong))
    pairs = [each.worst_case("rate loop", "phase margin") for each in (right, doubted)]
    gap = [(each.nominal or 0.0) - (each.worst or 0.0) for each in pairs]
    # An error of 0.3 turns the loop by up to arcsin 0.3 = 17.5 degrees.
    assert 12.0 < gap[1] - gap[0] < 22.0
    nowhere = dataclasses.replace(fit)
    nowhere.__dict__["model_errors"] = {
        "p/tau_phi": dataclasses.replace(errors, bound=0.8 + 0.0 * errors.bound)
    }
    with pytest.raises(DataError, match="nowhere shown to hold"):
        fid.tune_pid(nowhere, **options)


def test_gains_that_all_stand_at_limits_are_red(fit: fid.Fit) -> None:
    need = TuningRequirements(noise_growth=None, band_factor=None)
    strong = fid.LinearSystem([[-3.0]], [[0.9]], [[1.0]], [[0.0]], ("tau_phi",), ("p",), [0.004])
    design = fid.tune_pid(strong, gains=FLOWN, nominal=True, requirements=need, angle_loop=False)
    assert "gains-at-limits" in {f.code for f in design.findings if f.light is Light.RED}


def test_a_reversed_command_is_refused_unless_it_is_said() -> None:
    system = fid.LinearSystem([[-3.0]], [[-140.0]], [[1.0]], [[0.0]], ("tau_phi",), ("p",), [0.03])
    with pytest.raises(ModelError, match="answers a positive command with a negative rate"):
        fid.tune_pid(system, gains=FLOWN, nominal=True, band_rad_s=BAND)
    design = fid.tune_pid(
        system, gains=FLOWN, nominal=True, sign=-1, requirements=NEED, band_rad_s=BAND
    )
    assert design.exists
    with pytest.raises(OptionError, match="sign is not known"):
        fid.tune_pid(system, gains=FLOWN, nominal=True, sign=2, band_rad_s=BAND)


def test_discrete_models_need_the_samples_of_the_loop() -> None:
    system = fid.LinearSystem(
        [[0.9]], [[1.0]], [[1.0]], [[0.0]], ("tau_phi",), ("p",), sample_time_s=0.01
    )
    with pytest.raises(ModelError, match="samples are not those of the loop"):
        fid.tune_pid(system, gains=FLOWN, nominal=True, band_rad_s=BAND)


@pytest.mark.nightly
def test_noise_bounds_the_gains(fit: fid.Fit) -> None:
    options = {"gains": FLOWN, "draws": 8, "angle_loop": False}
    free = fid.tune_pid(fit, requirements=dataclasses.replace(NEED, noise_growth=None), **options)
    quiet = fid.tune_pid(
        fit, requirements=TuningRequirements(output_noise_rms=0.002), gyro_noise=0.01, **options
    )
    assert quiet.exists
    assert "output noise" in quiet.binding
    assert (quiet.worst_case("output", "noise, rms").worst or 1.0) <= 0.00201
    assert quiet.gains["ATC_RAT_RLL_D"] < free.gains["ATC_RAT_RLL_D"]
    for bad in (-1.0, ([1.0, 2.0], [1.0])):
        with pytest.raises(OptionError, match="gyro_noise"):
            fid.tune_pid(fit, gyro_noise=bad, **options)


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"objective": "luck"}, "objective is not known"),
        ({"phase_margin_deg": -1.0}, "phase_margin_deg is too small"),
        ({"phase_margin_deg": 95.0}, "phase_margin_deg is too large"),
        ({"step_limit": 1.0}, "step_limit is too small"),
    ],
)
def test_requirements_without_meaning_are_refused(changes: dict, said: str) -> None:
    with pytest.raises(OptionError, match=said):
        TuningRequirements(**changes)


@pytest.mark.parametrize(
    ("growth", "allowed", "stable", "flown", "limit"),
    [
        (2.0, None, True, 1.0, 0.06), (None, None, True, 1.0, 0.1), (2.0, None, False, 1.0, 0.1),
        (2.0, None, True, 0.0, 0.1), (None, 0.02, True, 1.0, 0.03), (2.0, 0.02, False, 1.0, 0.02),
        (2.0, 0.05, True, 1.0, 0.05),
    ],
)  # fmt: skip
def test_noise_is_held_to_the_least_of_what_is_asked_flown_and_allowed(
    growth: float | None, allowed: float | None, *, stable: bool, flown: float, limit: float
) -> None:
    need = TuningRequirements(noise_growth=growth, output_noise_rms=0.1)
    judged = SimpleNamespace(stable=np.array([[stable]]), noise=np.array([[0.03]]))
    problem = cast("LoopProblem", SimpleNamespace(judge=lambda *_: judged))
    setting = cast("Setting", SimpleNamespace(requirements=need, noise=(), noise_allowed=allowed))
    assert noise_limit(setting, problem, np.array([flown])) == limit


def test_a_gain_at_its_range_is_said_to_bind() -> None:
    judged = SimpleNamespace(names=("margin",), slack=np.array([[[0.5, 0.4]]]))
    problem = cast(
        "LoopProblem",
        SimpleNamespace(
            judge=lambda _: judged, kinds=("P", "D"), low=np.full(2, 0.01), high=np.ones(2),
            integral_ratio=1.0,
        ),
    )  # fmt: skip
    said = [(0.5, 0.5), (0.01, 0.5), (0.5, 0.01), (1.0, 0.5), (0.5, 1.0)]
    assert [_report(problem, np.array(gains)).binding for gains in said] == [
        (), ("range of P",), (), ("range of P",), ("range of D",),
    ]  # fmt: skip


@pytest.mark.parametrize(
    ("exists", "axis", "named"), [(1, "roll", 1), (0, "roll", 0), (1, "yaw", 0)]
)
def test_filters_are_named_by_a_design_that_was_tuned_with_them(
    exists: int, axis: str, named: int
) -> None:
    @dataclasses.dataclass(frozen=True)
    class Design:
        exists: bool
        axis: str
        filters: tuple[str, ...] = ()

    made: Any = SimpleNamespace(loops={"roll": None}, changes_of=lambda axis: (axis,))
    design: Any = Design(exists, axis)
    assert naming_filters(design, made).filters == ("roll",) * named
    assert naming_filters(design, None) is design


def test_a_late_output_turns_both_paths_by_its_delay() -> None:
    omega = np.array([1.0, 30.0, 200.0])
    late = dataclasses.replace(FLOWN, computation_delay_s=0.002)
    here, after = (ControllerPaths(loop, "filtered", False) for loop in (FLOWN, late))
    turned = np.exp(-0.002j * omega)
    for path in (ControllerPaths.feedback, ControllerPaths.forward):
        assert_close(path(after, omega), path(here, omega) * turned, rtol=1e-12, why="exact")


def test_noise_behind_a_gain_is_its_rms_over_the_band() -> None:
    omega = np.linspace(0.0, 50.0, 101)
    problem = cast("LoopProblem", SimpleNamespace(noise_psd=np.full(101, 0.2)))
    rms = float(LoopProblem._noise(problem, omega, np.full(101, 3.0)))
    assert_close(
        rms, np.sqrt(9.0 * 0.2 * 50.0 / (2.0 * np.pi)), rtol=1e-12, why="one-sided, per Hz"
    )
    problem = cast("LoopProblem", SimpleNamespace(noise_psd=None))
    rms = float(LoopProblem._noise(problem, omega, omega))
    assert_close(rms, 50.0 / np.sqrt(3.0), rtol=1e-4, why="a ramp's rms")


def test_a_gain_stands_at_its_limit_within_a_thousandth_of_the_range() -> None:
    near = AT_LIMIT * 0.5
    places = {0.1: True, 0.1 + 0.9 * near: True, 0.1 + 1.1 * near: False, 0.3: False,
              0.5 - 1.1 * near: False, 0.5 - 0.9 * near: True, 0.5: True}  # fmt: skip
    made = {new: TunedGain("P", "1", 0.2, new, 0.1, 0.5).at_limit for new in places}
    assert made == places


def test_an_integral_flown_without_p_asks_for_no_more_than_usual() -> None:
    names = FLOWN.names
    usual = [FLOWN.ranges[names[role]].default for role in "pi"]
    ratios = []
    for flown in ({"p": 0.0, "i": 0.3}, {"p": 0.2, "i": 0.0}, {"p": 0.1, "i": 0.9}):
        loop = FLOWN.with_gains({names[role]: value for role, value in flown.items()})
        ratios.append(ControllerPaths(loop, "filtered", False).integral_ratio(2.0))
    assert ratios == [2.0 * usual[1] / usual[0], 2.0 * usual[1] / usual[0], 9.0]
    # Without a default of both there is no usual ratio.
    for lacking in "pi":
        known = {k: each for k, each in FLOWN.ranges.items() if k != names[lacking]}
        bare = SimpleNamespace(
            ranges=known, names=names, values=FLOWN.values, unit_of=FLOWN.unit_of
        )
        paths = ControllerPaths(cast("Any", bare), "filtered", False)
        assert paths.integral_ratio(2.0) == np.inf


def test_the_largest_sensitivity_is_the_smaller_of_both_that_are_asked() -> None:
    asked = TuningRequirements(sensitivity_peak=1.5, disturbance_peak_db=20.0 * np.log10(1.2))
    assert_close(asked.peak, 1.2, rtol=1e-12, why="dB")
    assert dataclasses.replace(asked, disturbance_peak_db=6.0).peak == 1.5
    assert dataclasses.replace(asked, disturbance_peak_db=None).peak == 1.5


def test_white_gyro_noise_has_its_variance_up_to_half_the_rate() -> None:
    found = noise_density(0.1, 0.0025)
    assert found is not None
    variance = np.trapezoid(found[1], found[0] / (2.0 * np.pi))
    assert_close(variance, 0.1**2, rtol=1e-12, why="0 to 200 Hz")
    for given in (0.0, -0.1, np.inf):
        with pytest.raises(OptionError, match="gyro_noise has no meaning"):
            noise_density(given, 0.0025)


@pytest.mark.parametrize("confidence", [0.0, 1.0, np.nan])
def test_a_statement_about_content_needs_a_confidence_between_none_and_all(
    confidence: float,
) -> None:
    with pytest.raises(OptionError, match="no statement about content"):
        content_of_worst(10, confidence)


def test_the_highest_crossing_counts_for_the_band() -> None:
    omega = np.geomspace(0.1, 100.0, 2000)
    s = 1j * omega
    twice = 5.0 / s + 3.0 * s / (s**2 + s + 400.0) * 10.0  # falls through one, and again at 20…40
    found = highest_crossover(omega, np.array([twice, 2.0 / s, 0.01 / s]))
    assert found[0] > 30.0
    assert_close(found[1], 2.0, rtol=1e-9, why="an integrator, straight in its logarithm")
    assert np.isnan(found[2])
    (above,) = highest_crossover(np.array([1.0, 2.0, 4.0]), np.array([[2.0, 1.5, 1.2]]) + 0j)
    assert_close(above, 4.0, rtol=1e-12, why="above one to the end: no line is drawn beyond it")


def test_a_preset_moves_what_is_left_as_usual() -> None:
    gentle = TuningRequirements(preset="gentle", gain_margin_db=7.0)
    assert (gentle.phase_margin_deg, gentle.gain_margin_db) == (60.0, 7.0)
    assert TuningRequirements(preset="balanced") == TuningRequirements()
    factors = [TuningRequirements(preset=p).integral_factor for p in ("gentle", "balanced", "firm")]
    assert factors == sorted(factors)
    # Another preset takes the whole place of the one before, and nothing that was asked for.
    firm = gentle.changed(preset="firm")
    assert (firm.phase_margin_deg, firm.gain_margin_db, firm.noise_growth) == (45.0, 7.0, 3.0)
    with pytest.raises(OptionError, match="preset is not known"):
        TuningRequirements(preset="brave")


@pytest.mark.nightly
def test_the_integral_keeps_the_ratio_of_the_autopilot(fit: fid.Fit) -> None:
    options = {"gains": FLOWN, "draws": 8, "angle_loop": False}
    ratios = []
    for factor in (1.0, 3.0, None):
        need = dataclasses.replace(NEED, integral_factor=factor)
        design = fid.tune_pid(fit, requirements=need, **options)
        ratios.append(design.gains["ATC_RAT_RLL_I"] / design.gains["ATC_RAT_RLL_P"])
    # ArduCopter's defaults have I = P.
    assert_close(ratios[0], 1.0, rtol=1e-3, why="four digits of a gain")
    assert_close(ratios[1], 3.0, rtol=1e-3, why="four digits of a gain")
    assert ratios[2] > 3.5


def test_statements_about_content() -> None:
    assert_close(content_of_worst(59) ** 59, 0.05, rtol=1e-12, why="Wilks")
    assert_close(least_share(59, 59), content_of_worst(59), rtol=1e-9, why="all of them good")
    assert least_share(0, 10) == 0.0
    with pytest.raises(OptionError, match="counts do not fit"):
        least_share(3, 2)
    with pytest.raises(OptionError, match="no statement about content"):
        content_of_worst(0)
