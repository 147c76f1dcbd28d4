"""Where no record knows its hold: what is said, and how it colours the light."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import flightid as fid
from flightid.conventions import Light
from flightid.identification import hold_likelihood
from flightid.identification.hold_likelihood import HeldOutputs, held_outputs
from flightid.identification.hold_slopes import FormedSlopes, SummedSlopes
from flightid.identification.hold_steps import (
    products_of,
    some_columns,
    squares_of_steps,
    steps_of,
    weighed,
)
from flightid.identification.hold_test import judged
from flightid.identification.output_error.distinct import run_with_slopes
from flightid.identification.records.options import RecordOptions
from flightid.identification.records.setup import prepare_records
from flightid.identification.rival_holds import OtherHold
from flightid.identification.told_hold import _on_samples
from flightid.models import load_model
from flightid.record import Step
from flightid.record.history import FLOWN, FROM_LOG
from tests.closeness import assert_close
from tests.strangers import holds

NIGHTLY = pytest.mark.nightly
IN_EVERY_RUN = ["steps", *(pytest.param(each, marks=NIGHTLY) for each in ("straight", "smooth"))]


def _fit(shape: str, *, told: bool, method: str = "output_error") -> fid.Fit:
    return fid.identify(holds.model(), holds.flight(0, shape, told=told), method=method)


@pytest.mark.parametrize(
    ("shape", "light", "code"),
    [
        ("steps", "amber", "hold-unknown"),
        ("held", "amber", "hold-unknown"),
        ("straight", "green", "hold-supported"),
        ("smooth", "amber", "hold-contradicted"),
    ],
)
def test_an_unknown_hold_is_never_silent(shape: str, light: str, code: str) -> None:
    fit = _fit(shape, told=False)
    check = fit.evidence.check("input hold")
    assert check is not None
    assert str(check.light) == light
    assert code in [each.code for each in fit.findings]
    others = fit.provenance["other_holds"]
    assert isinstance(others, dict)
    assert others["zero"]["parameter"] == "tau"


@pytest.mark.parametrize("shape", ["steps", "straight"])
def test_a_hold_that_is_true_is_not_talked_about(shape: str) -> None:
    assert _fit(shape, told=True).evidence.check("input hold") is None


def test_estimates_that_rest_on_a_word_say_so() -> None:
    evidence = _fit("smooth", told=True).evidence
    assert str(evidence.light) == "green"
    said = next(line for line in evidence.lines if "the data cannot tell: were they steps" in line)
    assert "Inputs are smooth between samples as the records say" in said
    assert "tau would be 140 standard errors away" in said


def _said_on_a_word(fit: fid.Fit) -> list[fid.Finding]:
    return [each for each in fit.findings if each.code == "hold-unproven"]


@pytest.mark.parametrize("told", ["zero", "first"])
def test_a_word_that_nothing_bears_out_is_amber_in_bars_of_its_own(
    told: holds.Hold, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Smooth samples of steps: right and wrong words look alike, so neither is green."""
    monkeypatch.setattr(holds, "NOISE", 0.1)
    fit = fid.identify(holds.model(), holds.flight(0, "smooth steps", told=told))
    (said,) = _said_on_a_word(fit)
    assert str(said.light) == str(fit.evidence.light) == "amber"
    tau = fit.parameters["tau"]
    assert (tau.stderr or 1.0) < 1.2e-3
    # What the other word makes of the delay is said as an amount, and reaches its truth.
    away = 0.025 if told == "zero" else -0.025
    assert f"{'0.025 s larger' if told == 'zero' else '0.025 s smaller'}" in said.message
    truth = holds.TRUTH["tau"] - (0.0 if told == "zero" else away)
    assert abs((tau.value or 0.0) - truth) < 4.0 * (tau.stderr or 0.0)
    other = fit.provenance["other_holds"]["first" if told == "zero" else "zero"]
    assert_close(other["shift"]["tau"], away, atol=1.5e-3, why="half a sample")


def test_a_wrong_word_is_never_green_beside_a_miss() -> None:
    for seed in range(20, 24):
        fit = fid.identify(holds.model(), holds.flight(seed, "smooth", told="zero"))
        assert str(fit.evidence.light) == "amber"


def test_standing_samples_told_as_lines_are_doubted_until_data_outweigh_them() -> None:
    """Their delay was 130 standard errors off and green: by chance lines fitted better by 2.1."""
    fit = fid.identify(holds.model(), holds.flight(5002, "steps", told="first"))
    other = fit.provenance["other_holds"]["zero"]
    assert -6.0 < other["gain"] < -2.0
    assert str(fit.evidence.light) == "amber"
    low, high = fit.parameters["tau"].interval95
    assert low < holds.TRUTH["tau"] < high


@pytest.mark.parametrize(
    ("gain", "expected", "moved", "out"),
    [
        (-2.7, 1.0, 9.0, True), (-2.6, 1.0, 9.0, False), (-1.4, 0.05, 9.0, False),
        (-2.0, 1.0, 1.2, True), (-1.5, 1.0, 1.2, False),
    ],
)  # fmt: skip
def test_a_rival_is_ruled_out_where_one_flight_in_200_looks_so(
    gain: float, expected: float, moved: float, *, out: bool
) -> None:
    """One in 50 where it lies within the intervals."""
    assert OtherHold("zero", "tau", moved, gain, expected=expected).is_ruled_out is out


def test_rows_of_an_autopilot_keep_their_word_and_lines_that_data_bear_out_are_green(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(holds, "NOISE", 0.1)
    for done in (Step(FLOWN), Step(FROM_LOG)):
        record = holds.flight(0, "smooth steps", told="first").replace(step=done)
        fit = fid.identify(holds.model(), record)
        assert fit.parameters["tau"].interval95[0] > holds.TRUTH["tau"]
        assert not _said_on_a_word(fit)
    # Lines told as lines, which the data bear out.
    sure = fid.identify(holds.model(), holds.flight(0, "smooth lines", told="first"))
    assert str(sure.evidence.light) == "green"
    assert (sure.parameters["tau"].stderr or 1.0) < 1.5e-3


@pytest.mark.parametrize("told", ["zero", None])
def test_two_levels_bear_out_steps_unless_the_data_say_lines(told: holds.Hold | None) -> None:
    """A relay of 20 Hz; the lines are SciPy's, as exact as the steps."""
    lights = []
    for shape in ("straight", "held"):
        with pytest.MonkeyPatch.context() as patched:
            patched.setattr(holds, "held", _relay)
            record = holds.flight(2, shape, told=told or False)
        fit = fid.identify(holds.model(), record)
        lights.append(str(fit.evidence.light))
        low, high = fit.parameters["tau"].interval95
        assert low < holds.TRUTH["tau"] < high
    assert lights == ["amber", "green"]


def test_standing_samples_bear_out_steps_unless_data_that_have_a_say_lean_to_lines(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Lines and steps through the same levels of half a second, both told as steps."""
    monkeypatch.setattr(holds, "NOISE", 0.1)
    monkeypatch.setattr(holds, "held", holds.steps)
    doubted: list[fid.Finding] = []
    lights, missed = [], 0
    for seed in range(900, 912):
        wrong = fid.identify(holds.model(), holds.flight(seed, "straight", told="zero"))
        lights.append(str(wrong.evidence.light))
        right = fid.identify(holds.model(), holds.flight(seed, "held", told="zero"))
        doubted.extend(_said_on_a_word(right))
        low, high = wrong.parameters["tau"].interval95 or (0.0, 0.0)
        missed += lights[-1] == "green" and not low < holds.TRUTH["tau"] < high
    # Of wrong words 4 were green before, each beside a delay that missed.
    assert missed <= 2
    assert lights.count("amber") >= 6
    assert len(doubted) <= 1


@pytest.mark.parametrize(("gain", "light"), [(0.5, Light.GREEN), (1.3, Light.AMBER)])
def test_word_and_samples_together_are_doubted_no_sooner_than_a_word(
    gain: float, light: Light
) -> None:
    """Steps that stood in the samples were amber in 8 of 40 right flights, as 1 of 6 was asked."""
    finding, reached = _on_samples(
        [OtherHold("first", "tau", 3.0, gain, expected=0.6)], "as was declared"
    )
    assert finding is not None
    assert finding.light is light
    assert len(reached) == (light is Light.GREEN)


def _relay(random: np.random.Generator, n: int) -> np.ndarray:
    return 0.05 * np.sign(np.cumprod(np.where(random.random(n) < 0.15, -1.0, 1.0)))


@pytest.mark.parametrize(
    ("gain", "expected", "doubts"),
    [(1.6, 0.1, True), (1.4, 1.5, False), (0.5, 8.0, True), (-0.1, 8.0, False)],
)
def test_a_word_is_doubted_the_sooner_the_more_data_could_tell(
    gain: float, expected: float, doubts: bool
) -> None:
    assert OtherHold("zero", "tau", 9.0, gain, expected=expected).doubts is doubts


@pytest.mark.parametrize(
    ("shape", "told", "needed"),
    [
        ("steps", "first", "stands still and jumps every 10 samples"),
        ("straight", "zero", "inputs are straight lines between samples, not steps as the records"),
        ("smooth", "zero", "inputs are smooth between samples, not steps as the records say"),
    ],
)
def test_a_hold_that_is_told_wrong_is_amber_and_bars_reach_the_truth(
    shape: str, told: holds.Hold, needed: str
) -> None:
    fit = fid.identify(holds.model(), holds.flight(0, shape, told=told))
    check = fit.evidence.check("input hold")
    assert check is not None
    assert str(check.light) == "amber"
    assert needed in check.finding.message
    low, high = fit.parameters["tau"].interval95
    assert low < holds.TRUTH["tau"] < high


def test_bars_reach_what_the_method_itself_makes_of_another_hold() -> None:
    record = holds.flight(2, "smooth", told="zero")
    fit, true = (
        fid.identify(holds.model(), record, method="equation_error", **given)
        for given in ({}, {"hold": "band_limited"})
    )
    assert str(fit.evidence.light) == "amber"
    for name in fit.names:
        assert fit.parameters[name].stderr is not None
        moved = abs(fit.parameters[name].value - true.parameters[name].value)
        assert moved <= fit.parameters[name].stderr


def test_a_response_fit_moves_under_another_hold_as_it_is_told_to() -> None:
    """Least squares on the same samples in time would move by the other sign in Ma."""
    response = fid.estimate_response(holds.flight(7000, "straight", told="zero"))
    fit, true = (
        fid.identify(holds.model(), response, **given) for given in ({}, {"hold": "first"})
    )
    told = fit.provenance["other_holds"]["first"]["shift"]
    names = [name for name in fit.names if name != "tau"]  # which every method moves alike
    errors = np.array([true.parameters[name].stderr for name in names])
    moved = np.array([true.parameters[n].value - fit.parameters[n].value for n in names]) / errors
    left = moved - np.array([told[name] for name in names]) / errors
    # Weights stay those of the fit, so that not all of it is foretold.
    assert np.linalg.norm(left) < 0.5 * np.linalg.norm(moved)


@pytest.mark.parametrize("shape", IN_EVERY_RUN)
def test_a_response_tells_what_its_records_know_of_a_wrong_hold(shape: str) -> None:
    lights = []
    for told in (True, holds.WRONG[shape]):
        response = fid.estimate_response(holds.flight(1, shape, told=told))
        lights.append(fid.identify(holds.model(), response).evidence.check("input hold"))
    assert lights[0] is None
    assert lights[1] is not None
    assert str(lights[1].light) == "amber"


def test_likelihood_under_another_hold_is_what_a_fit_under_it_finds(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    record = holds.flight(0, "straight", told=False)
    fit, other = (fid.identify(holds.model(), record, hold=hold) for hold in ("zero", "first"))
    sloped = list[bool]()
    for name in ("residuals_of", "begun_with_slopes"):
        run = getattr(hold_likelihood, name)

        def counted(*given: Any, run: Any = run, with_slopes: bool = name[0] == "b") -> Any:
            sloped.append(with_slopes)
            return run(*given)

        monkeypatch.setattr(hold_likelihood, name, counted)
    here, there = held_outputs(fit.model, [record], {}, ["zero", "first"])
    # Slopes stay where the first step leads nowhere; half a sample is 140 standard errors, which
    # both begin without: the delay of the other is moved by it.
    assert sloped == [True, False, True, False]
    # The fit itself is where least squares on its records lead, so it is not made again.
    as_fitted, spread = HeldOutputs.of(fit), [fit.parameters[n].stderr or 0.0 for n in fit.names]
    assert np.all(np.abs(as_fitted.values - here.values) < 1e-2 * np.array(spread))
    assert_close(here.gain_over(as_fitted), 0.0, atol=1e-2, why="what a search leaves")
    wanted = np.array([other.parameters[name].value for name in fit.names])
    assert_close(there.values, wanted, rtol=1e-3, why="two steps from half a sample away")
    ratios = [other.costs[name] / fit.costs[name] for name in fit.costs]
    assert there.gain_over(here) > 0.0
    assert max(ratios) < 1.0


def test_steps_beside_a_fit_begin_at_its_own_numbers_of_each_record(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    records = [holds.flight(seed, "steps", told="zero") for seed in (0, 1)]
    for place, record in enumerate(records):
        moved = {name: record[name] + 0.01 * (place + 1) for name in ("alpha", "q")}
        records[place] = record.replace(moved)
    fit = fid.identify(holds.model(), records, output_bias=True)
    run, begun = hold_likelihood.begun_with_slopes, list[Any]()

    def seen(*given: Any) -> Any:
        begun.append(given[3])
        return run(*given)

    monkeypatch.setattr(hold_likelihood, "begun_with_slopes", seen)
    given = {"output_bias": True}
    (here,) = held_outputs(fit.model, records, given, ["zero"], beside=fit)
    for record, own in zip(fit.records, begun[:2], strict=True):
        known = [record.bias[name].value for name in fit.model.outputs]
        assert_close(own.bias, known, rtol=1e-12, why="the fit's own biases")
        assert np.all(np.abs(own.bias) > 0.0)
    # From its own minimum no step of a fit leads far: outputs weigh by their size in the first.
    spread = np.array([fit.parameters[name].stderr for name in fit.names])
    assert np.all(np.abs(here.values - HeldOutputs.of(fit).values) < 0.1 * spread)


def test_lines_of_a_simulator_may_be_staircases() -> None:
    record = fid.simulate(
        holds.model().with_values(holds.TRUTH),
        holds.flight(0, "steps", told=False),
        hold="first",
        noise=fid.Noise(sensor={"alpha": 1e-3, "q": 1e-3}, seed=0),
    )
    fit = fid.identify(holds.model(), record)
    assert fit.evidence.check("input hold") is None


def test_steps_are_found_by_what_they_leave() -> None:
    fit = _fit("held", told=False, method="fourier_output_error")
    said = next(each for each in fit.findings if each.code == "hold-contradicted")
    assert "hold='zero'" in said.action


def test_a_hold_that_moves_nothing_is_green() -> None:
    found = judged([OtherHold("zero", "tau", 0.1, None)], "band_limited")
    assert str(found.light) == "green"
    asked = judged([OtherHold("zero", "tau", 4.0, None)], "band_limited")
    assert str(asked.light) == "amber"
    assert "4 standard errors" in asked.message


@pytest.mark.parametrize("shape", IN_EVERY_RUN)
def test_verify_and_predict_take_the_hold_of_the_fit(shape: str, tmp_path: Path) -> None:
    fit = _fit(shape, told=True)
    unseen, known = holds.flight(1, shape, told=False), holds.flight(1, shape, told=True)
    wanted = fid.verify(fit, known)
    model = load_model(fid.write_model(fit, tmp_path / "fit.toml"))
    for source in (fit, model):
        found = fid.verify(source, unseen)
        assert found.hold == known.hold
        assert found.theil == wanted.theil
        assert not [each for each in found.findings if each.code.startswith("hold-")]
        run = fid.predict(source, unseen)
        assert np.array_equal(run.predicted["q"], fid.predict(source, known).predicted["q"])


def test_a_black_box_has_no_hold_to_forget() -> None:
    structure = fid.PolynomialModel.arx(("de",), "q", na=2, nb=2, nk=1)
    fit = fid.identify(structure, holds.flight(0, "steps", told=False))
    assert fit.evidence.check("input hold") is None


def test_a_wrong_word_beside_gusts_is_not_green() -> None:
    """Two steps from half a sample away had ended short of it: the truth was ruled out by e⁻³⁰."""
    flown = holds.flight(10, "held", told="first", gust=True)
    fit = fid.identify(holds.model(), flown, method="filter_error")
    other = fit.provenance["other_holds"]["zero"]
    assert other["gain"] > -1.0
    assert_close(other["shift"]["tau"], -0.025, atol=0.002, why="half a sample of 50 ms")
    assert str(fit.evidence.light) == "amber"


@pytest.mark.nightly
def test_bars_reach_what_an_unknown_hold_decides() -> None:
    told, untold = (
        _fit("steps", told=each, method="equation_error").parameters["tau"]
        for each in (True, False)
    )
    low, high = untold.interval95
    assert low < holds.TRUTH["tau"] < high
    assert untold.stderr > 3.0 * told.stderr


def test_a_model_that_runs_away_is_asked_nothing_of_its_hold() -> None:
    flown = holds.flight(0, "steps", told=True)
    small = {name: 1e-4 * flown[name] for name in flown.outputs}
    with pytest.raises(fid.FlightidError, match="leads away"):
        held_outputs(holds.model(), [flown.replace(small)], {}, ["zero", "first"])


def _fed_back(seed: int, n: int = 2000, step_s: float = 0.02) -> fid.Record:
    """Roll rate under an exactly held controller that feeds the gyro's noise back (Euler, 2 ms)."""
    random, fine = np.random.default_rng(seed), 10
    late, time_s = round(0.03 * fine / step_s), np.arange(n) * step_s
    sweep = 0.1 * np.sin(2.0 * np.pi * (0.2 + 1.9 * time_s / time_s[-1]) * time_s)
    rate, angle, held = 0.0, 0.0, [0.0] * (late + 1)
    rows = np.zeros((2, n))
    for k in range(n):
        seen = rate + 0.3 * random.standard_normal()
        rows[:, k] = sweep[k] - 0.15 * seen - 0.3 * angle, seen
        for _ in range(fine):
            held.append(float(rows[0, k]))
            rate += step_s / fine * (40.0 * held[-1 - late] - 3.0 * rate)
            angle += step_s / fine * rate
    return fid.Record.from_arrays(
        time_s, inputs={"u": rows[0]}, outputs={"p": rows[1]}, hold="zero",
        units={"u": "1", "p": "rad/s"},
    )  # fmt: skip


def test_a_closed_loop_does_not_speak_against_a_hold_that_is_true() -> None:
    """Smooth inputs are made of samples to come, and those know the noise by then."""
    known = [
        fid.Parameter("K", 30.0, "rad/s^2"),
        fid.Parameter("Lp", -2.0, "1/s"),
        fid.Parameter("tau", 0.02, "s", minimum=0.0),
    ]
    path = fid.TransferFunction("p", "u", "K", denominator=("s - Lp",), delay="tau")
    units = {"u": "1", "p": "rad/s"}
    model = fid.TransferFunctionModel((path,), fid.Parameters(known), units=units)
    fits = {
        loop: fid.identify(model, _fed_back(7), method="output_error", loop=loop)
        for loop in (None, "closed", "open")
    }
    said = {loop: [each.code for each in fit.findings] for loop, fit in fits.items()}
    assert "hold-contradicted" not in said[None] + said["closed"]
    assert "hold-contradicted" in said["open"]
    line = next(line for line in fits["closed"].evidence.lines if "the data cannot tell" in line)
    assert "Inputs are steps between samples as the records say" in line


def test_products_of_a_step_are_those_of_its_columns() -> None:
    random = np.random.default_rng(0)
    left, slopes = random.standard_normal((2, 700)), random.standard_normal((2, 700, 5))
    weights, formed = np.array([0.5, 3.0]), FormedSlopes(slopes, 3)
    rows = np.concatenate(list(weighed(left, formed, weights, 3)))
    found = products_of(formed.products(left), weights, 3)
    assert_close(found, rows.T @ rows, rtol=1e-12, why="rounding of two ways")
    # A step that leaves all, and one that leaves less than sums can tell.
    step = random.standard_normal(5)
    for rest in (left, slopes @ step + 1e-7 * left):
        known = slopes[:, :, :3] @ step[:3], slopes[:, :, 3:] @ step[3:], rest - slopes @ step
        squares = squares_of_steps([rest], [formed], [formed.products(rest)], [step], 3)
        wanted = np.sum(np.square(known), axis=2).T
        assert_close(squares, wanted, rtol=1e-9, why="rounding of two ways")
    some = np.concatenate(list(some_columns(left, formed, 3, [5, 0, 4])))
    taken = np.repeat(weights, 700)[:, None] * some
    assert_close(taken, rows[:, [5, 0, 4]], rtol=1e-15, why="the same numbers")


@pytest.mark.parametrize("shifted", [False, True])
def test_sums_of_a_run_are_those_of_its_derivatives(*, shifted: bool) -> None:
    record, model = holds.flight(0, "steps", told="zero"), holds.model()
    options = RecordOptions(initial_state="estimate", output_bias=True, input_bias=shifted)
    prepared = prepare_records(model, record, options)
    (own,), (_, measured, _) = prepared.own, prepared.arrays[0]
    summed = SummedSlopes(prepared, 0, own)
    formed = FormedSlopes(summed.columns(), len(model.parameters.free))
    left, products = summed.begun()
    run = run_with_slopes(model, prepared, None, 0, own, sloped=False)[0]
    assert_close(left, measured - run, atol=1e-12 * np.ptp(measured), why="rounding")
    for rest, found in ((left, products), (measured, summed.products(measured))):
        wanted = formed.products(rest)
        size = np.sqrt(np.einsum("kii->ki", wanted))
        scale = np.where(size > 0.0, size, 1.0)
        share = (found - wanted) / scale[:, :, None] / scale[:, None]
        assert_close(share, np.zeros_like(share), atol=1e-12, why="rounding of two ways")
    step = np.random.default_rng(1).standard_normal(wanted.shape[1] - 1)
    rest = formed.stepped(left, step)
    assert_close(summed.stepped(left, step), rest, atol=1e-12 * np.ptp(rest), why="two ways")


def test_own_numbers_of_one_effect_take_nothing_from_shared_parameters() -> None:
    """A start and a bias that move an output alike: the step is that of least squares on all."""
    random = np.random.default_rng(0)
    records = []
    for n in (300, 450):
        slopes = random.standard_normal((2, n, 5))
        slopes[0, :, 2:], slopes[1, :, 2:] = [1.0, 0.0, 1.0], [0.0, 1.0, 0.0]
        records.append((10.0 * random.standard_normal((2, n)), slopes))
    left, slopes = zip(*records, strict=True)
    formed = [FormedSlopes(each, 2) for each in slopes]
    products = [each.products(rest) for each, rest in zip(formed, left, strict=True)]
    found = steps_of(left, formed, products, np.array([2.0, 0.5]), 2, None)
    whole, target = np.zeros((1500, 8)), np.concatenate([each.ravel() for each in left])
    weights = np.concatenate([np.repeat([0.5, 2.0], n) for n in (300, 450)])
    for place, (first, each) in enumerate(zip((0, 600), slopes, strict=True)):
        rows = slice(first, first + each[..., 0].size)
        flat = each.reshape(-1, 5)
        whole[rows, :2], whole[rows, 2 + 3 * place : 5 + 3 * place] = flat[:, :2], flat[:, 2:]
    known = np.linalg.lstsq(whole * weights[:, None], target * weights)[0]
    for place, each in enumerate(found):
        assert_close(each[:2], known[:2], rtol=1e-9, why="rounding of two ways")
        own = known[2 + 3 * place : 5 + 3 * place]
        effect = [each[2] + each[4], each[3]]
        assert_close(effect, [own[0] + own[2], own[1]], rtol=1e-9, why="what records show")
