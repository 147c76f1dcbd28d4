"""A wrong derivative is told in gusts by what inputs ask; a right model in gusts stays."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.linalg import expm

import flightid as fid
from flightid.identification.filter_error.parameter_scores import ParameterScores, parameter_scores
from flightid.identification.regression.options import FilterErrorOptions
from flightid.models import Output, Parameter, Parameters
from flightid.uncertainty.estimate import Estimate
from flightid.validation.verification.parameter_findings import CODE, refuted_findings
from flightid.validation.verification.pieces import GROWTH
from flightid.validation.verification.refuted_parameters import QuestionedRuns, RefutedParameter
from tests.strangers.gusts import TRUTH, flight, model

STEP_S = 0.02


def _said(which: fid.StateSpaceModel | fid.Fit, record: fid.Record) -> dict[str, tuple[str, str]]:
    found = fid.verify(which, record).findings
    return {each.code: (each.light.value, each.message) for each in found}


def _named(message: str, parameter: str) -> float:
    return float(message.split(f"{parameter} = ")[1].split(" ", maxsplit=1)[0])


@pytest.mark.parametrize("seed", [0, 1, 2])
@pytest.mark.parametrize("wrong", [None, "Mq", "Md", "Mw"])
def test_a_derivative_off_by_30_percent_is_red_in_gusts_and_named(
    wrong: str | None, seed: int
) -> None:
    """Dryden's gust of 2 m/s leaves most of the motion unexplained: all had been amber, or most."""
    values = {} if wrong is None else {wrong: 1.3 * TRUTH[wrong]}
    said = _said(model(1.0).with_values(values), flight(seed, 2.0, 1.0, 30.0))
    assert said["verification-theil"][0] != "green"
    if wrong is None:
        assert "red" not in {light for light, _ in said.values()}
        assert CODE not in said
    else:
        light, message = said[CODE]
        assert light == "red"
        assert "beside any gust" in message
        if f"as another {wrong} would" not in message:
            assert _named(message, wrong) == pytest.approx(TRUTH[wrong], rel=0.02)


def test_a_little_wrong_in_calm_air_is_amber() -> None:
    """Within Theil's guide a prediction is of use: what is wrong in it is said, not refused."""
    record = flight(3, 0.0, 1.0, 30.0)
    light, message = _said(model(1.0).with_values({"Mq": 1.3 * TRUTH["Mq"]}), record)[CODE]
    assert light == "amber"
    assert _named(message, "Mq") == pytest.approx(TRUTH["Mq"], rel=0.02)
    assert CODE not in _said(model(1.0).with_values({"Mq": 1.05 * TRUTH["Mq"]}), record)


def test_a_derivative_a_quarter_off_in_calm_air_is_amber_though_little_moves() -> None:
    """It explains 98 % of the motion and was green: a model is asked for derivatives too."""
    record, wrong = flight(23, 0.0, 1.0, 30.0), model(1.0).with_values({"Mq": TRUTH["Mq"] / 1.3})
    light, message = _said(wrong, record)[CODE]
    assert light == "amber"
    assert _named(message, "Mq") == pytest.approx(TRUTH["Mq"], rel=0.02)
    small = model(1.0).with_values({"Mq": TRUTH["Mq"] / 1.09})
    assert CODE not in _said(small, record)
    asked = Estimate("Mq", -2.0, "1/s", 0.01)
    off = RefutedParameter(asked, -1.54, 1e-9, "q", share=0.016, off=0.2, is_enough=True)
    assert [each.light.value for each in refuted_findings(off, (), hold_known=True)] == ["amber"]
    assert not refuted_findings(off, (), hold_known=False), "a hold in doubt moves it by as much"
    assert not QuestionedRuns(off).is_refuted, "gusts may excuse what else there is"


@pytest.mark.parametrize("seed", [20033, 20083, 20183])
def test_a_derivative_of_little_motion_is_amber_where_light_gusts_leave_it_known(seed: int) -> None:
    """A third off and 1 % of the motion: inputs surely ask it (p = 1e-17), and it was green."""
    record = flight(seed, 0.5, 1.0, 30.0)
    light, message = _said(model(1.0).with_values({"Zd": TRUTH["Zd"] / 1.3}), record)[CODE]
    assert light == "amber"
    assert _named(message, "Zd") == pytest.approx(TRUTH["Zd"], rel=0.06)
    assert CODE not in _said(model(1.0), record)


def test_accounts_are_compared_beside_the_errors_of_the_fit() -> None:
    """A second account that meets the records by chance of the fit's errors is no better one."""
    same = np.eye(2)
    chance = ParameterScores(("a", "b"), np.ones(2), np.array([0.0, 6.0]), same, same, 50.0)
    assert chance.misfit_beside() == 50.0
    assert chance.misfit_beside(np.diag([0.0, 100.0])) == pytest.approx(50.0 - 36.0 * 100 / 101)
    assert chance.misfit_beside(np.diag([100.0, 0.0])) == pytest.approx(50.0)


def test_errors_of_a_model_s_other_parameters_are_in_what_is_asked_of_one() -> None:
    """What gusts leave open is one factor of all derivatives: ±.04 stood there, where ±.7 is."""
    same = np.array([[4.0, -2.0], [-2.0, 1.0]])
    scores = ParameterScores(("a", "b"), np.ones(2), np.zeros(2), same + 1e-3 * np.eye(2), same)
    known = 25.0 * np.outer([1.0, 2.0], [1.0, 2.0])
    moves = scores.alone(known)[1]
    assert moves[0] == pytest.approx(0.5, rel=1e-2), "no record sees this error of the model"
    assert scores.value_errors(known)[0] == pytest.approx(np.hypot(0.5, 0.5 * 5.0 * 2.0), rel=1e-2)


def test_no_interval_where_a_fit_does_not_know_its_own_errors() -> None:
    """Its other parameters count as right then: in gusts 5 of 6 misses were of such fits."""
    fit = fid.identify(model(1.0), flight(33, 0.0, 1.0, 20.0), method="output_error")
    other = flight(43, 0.0, 1.0, 30.0, {**TRUTH, "Md": 1.3 * TRUTH["Md"]})
    assert "Md = -18." in _said(fit, other)[CODE][1]
    assert "Md about -18." in _said(replace(fit, covariance=None), other)[CODE][1]


def _doublet(hold: str | None) -> tuple[fid.StateSpaceModel, fid.Record]:
    """A short period by SciPy, its elevator stepped between samples, its noise white."""
    a, b = np.array([[-1.4, 1.0], [-6.2, -2.1]]), np.array([[0.0], [-11.0]])
    both = expm(np.block([[a, b], [np.zeros((1, 3))]]) * STEP_S)
    u = np.repeat([0.0, 0.06, -0.06, 0.0], [50, 50, 50, 450])
    states = np.zeros((len(u), 2))
    for k, each in enumerate(u[:-1]):
        states[k + 1] = both[:2, :2] @ states[k] + both[:2, 2] * each
    noisy = states + [0.002, 0.004] * np.random.default_rng(0).standard_normal(states.shape)
    units = {"elevator": "rad", "alpha": "rad", "q": "rad/s"}
    record = fid.Record.from_arrays(
        STEP_S * np.arange(len(u)), inputs={"elevator": u},
        outputs={"alpha": noisy[:, 0], "q": noisy[:, 1]}, units=units, hold=hold,
    )  # fmt: skip
    return _short_period(-0.7 * 6.2), record


def _short_period(of_alpha: float) -> fid.StateSpaceModel:
    values = {"Za": -1.4, "Ma": of_alpha, "Mq": -2.1, "Me": -11.0}
    units = {"Za": "1/s", "Ma": "1/s^2", "Mq": "1/s", "Me": "1/s^2"}
    return fid.StateSpaceModel(
        states={"alpha": "rad", "q": "rad/s"},
        input_units={"elevator": "rad"},
        measurements={"alpha": Output("alpha", "rad"), "q": Output("q", "rad/s")},
        equations={"alpha'": "Za*alpha + q", "q'": "Ma*alpha + Mq*q + Me*elevator"},
        parameters=Parameters([Parameter(name, values[name], units[name]) for name in values]),
    )


def test_no_interval_where_nobody_says_how_inputs_move_between_samples() -> None:
    """Steps taken as lines moved what is asked by more than its noise: 0 of 10 intervals held."""
    told = _said(*_doublet("zero"))[CODE][1]
    low, high = told.split("(")[2].split(")")[0].split(" to ")
    assert float(low) <= -6.2 <= float(high)
    untold = _said(*_doublet(None))[CODE][1]
    assert "Ma about -" in untold
    assert " to -" not in untold


def test_scores_of_a_right_model_are_of_unit_variance() -> None:
    """And a control derivative off by 5 % shows, on the side of the truth."""
    options = FilterErrorOptions(input_bias=True, output_bias=True, hold="first")
    shown = []
    for seed in range(6):
        record = flight(seed, 2.0, 1.0, 30.0)
        right = model(1.0)
        scores = parameter_scores(right, [record], [fid.predict(right, record).predicted], options)
        assert scores is not None
        moves, stderr = scores.alone()
        shown.append(moves / stderr)
    assert 0.5 < np.std(shown) < 1.5
    near = right.with_values({"Md": 1.05 * TRUTH["Md"]})
    scores = parameter_scores(near, [record], [fid.predict(near, record).predicted], options)
    assert scores is not None
    place = scores.names.index("Md")
    move, stderr = (float(each[place]) for each in scores.alone())
    assert move > 8.0 * stderr


def _hover(seed: int, gust: float) -> fid.Record:
    """A roll axis that grows by itself over a minute, in a loop and in gusts of a second."""
    random, n = np.random.default_rng(seed), 3000
    a = np.array([[-3.0, 0.4, -0.2], [1.0, 0.0, 0.0], [0.0, 9.81, -0.1]])
    b = np.array([[20.0], [0.0], [0.0]])
    whole = expm(np.block([[a, b, a[:, 2:]], [np.zeros((2, 5))]]) * STEP_S)
    steps = 0.05 * np.repeat(random.choice([-1.0, 0.0, 1.0], n // 35 + 1), 35)[:n]
    x, u, y, wind = np.zeros(3), np.zeros(n), np.zeros((3, n)), gust * random.standard_normal()
    for k in range(n):
        y[:, k] = x + random.standard_normal(3) * [0.003, 0.002, 0.02]
        u[k] = steps[k] - (0.1 * y[0, k - 1] + 0.3 * y[1, k - 1] if k else 0.0)
        x = whole[:3, :3] @ x + whole[:3, 3] * u[k] + whole[:3, 4] * wind
        wind = 0.98 * wind + gust * 0.2 * random.standard_normal()
    return fid.Record.from_arrays(
        np.arange(n) * STEP_S,
        inputs={"da": u},
        outputs=dict(zip(("p", "phi", "v"), y, strict=True)),
        units={"da": "rad", "p": "rad/s", "phi": "rad", "v": "m/s"},
        hold="zero",
    )


def _roll(**values: float) -> fid.StateSpaceModel:
    own = {"Lp": -3.0, "Lphi": 0.4, "Lv": -0.2, "Lda": 20.0, "Yv": -0.1, "g": 9.81} | values
    units = {"Lp": "1/s", "Lphi": "1/s^2", "Lv": "rad/s/m", "Lda": "1/s^2", "Yv": "1/s"}
    return fid.StateSpaceModel(
        states={"p": "rad/s", "phi": "rad", "v": "m/s"},
        input_units={"da": "rad"},
        measurements={
            "p": fid.Output("p", "rad/s"),
            "phi": fid.Output("phi", "rad"),
            "v": fid.Output("v", "m/s"),
        },
        equations={
            "p'": "Lp*p + Lphi*phi + Lv*v + Lda*da",
            "phi'": "p",
            "v'": "g*phi + Yv*v",
        },
        parameters=fid.Parameters(
            [
                fid.Parameter(name, own[name], units.get(name, "m/s^2"), free=name != "g")
                for name in own
            ]
        ),
    )


@pytest.mark.parametrize("seed", [0, 1])
def test_a_right_model_that_grows_is_not_red_for_gusts(seed: int) -> None:
    """Pieces of its record are poorly predicted too, and had been red for that."""
    record = _hover(seed, 3.0)
    said = _said(_roll(), record)
    light, message = said[GROWTH]
    assert light == "amber"
    assert "gusts alone could make it" in message
    assert "red" not in {each for each, _ in said.values()}
    wrong = _said(_roll(Lda=28.0), record)
    assert wrong[GROWTH][0] == wrong[CODE][0] == "red"
    assert "Lda" in wrong[CODE][1]


def test_what_cannot_be_asked_is_not() -> None:
    """No free parameter, or no noise at all: nothing is said of either."""
    record = flight(0, 2.0, 1.0, 30.0)
    wrong = model(1.0).with_values({"Md": 1.3 * TRUTH["Md"]})
    held = wrong.with_fixed(**{each.name: each.value for each in wrong.parameters.free})
    assert CODE not in _said(held, record)
    moved = fid.Record.from_arrays(
        record.time_s, inputs={"de": record["de"]}, units={"de": "rad"}, hold="first"
    )
    assert CODE not in _said(wrong, fid.simulate(model(1.0), moved))
