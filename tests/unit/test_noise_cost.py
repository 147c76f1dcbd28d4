"""Costs beside what random errors alone explain."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pytest
from numpy.typing import NDArray

import flightid as fid
from flightid.conventions import Light
from flightid.findings import Finding
from flightid.identification.fit_findings import NoiseCost, judge_cost
from flightid.identification.frequency_domain import search
from flightid.identification.multistart import draw_starts


def _found(average: float, noise: NoiseCost | None) -> Finding:
    return judge_cost({"p/a": average}, average, None if noise is None else {"p/a": noise})[0]


def test_a_cost_that_noise_explains_is_green_and_one_that_it_does_not_is_not() -> None:
    assert _found(140.0, NoiseCost(120.0, 20.0)).light is Light.GREEN
    assert "120 on average, and as much in 16 %" in _found(140.0, NoiseCost(120.0, 20.0)).message
    assert _found(140.0, NoiseCost(20.0, 5.0)).light is Light.RED
    assert _found(42.0, NoiseCost(5.0, 2.0)).light is Light.AMBER
    assert "random errors explain 5" in _found(42.0, NoiseCost(5.0, 2.0)).message
    assert _found(10.0, NoiseCost(4.0, 1.5)).light is Light.GREEN
    assert _found(10.0, NoiseCost(0.1, 0.01)).light is Light.AMBER  # its bars are not shown
    assert _found(42.0, NoiseCost(0.1, 0.01)).light is Light.RED
    assert _found(42.0, None).light is Light.GREEN


def test_a_single_response_is_judged_beside_its_own_noise() -> None:
    noise = {"p/a": NoiseCost(170.0, 40.0), "q/a": NoiseCost(10.0, 2.0)}
    codes = [each.code for each in judge_cost({"p/a": 180.0, "q/a": 10.0}, 95.0, noise)]
    assert codes == ["cost"]
    said = judge_cost({"p/a": 10.0, "q/a": 180.0}, 95.0, noise)
    assert [each.message for each in said if each.code == "cost-response"] == ["q/a: cost 180"]


def test_a_structure_that_misses_far_more_than_noise_has_no_intervals() -> None:
    truth = fid.load_model("rate_first_order").with_values({"Lp": -5.0, "Ltphi": 150.0})
    omega = np.geomspace(0.5, 20.0, 40)
    exact = truth.frequency_response(omega)

    def fitted(mode: float) -> fid.Fit:
        errors = 0.02 * np.random.default_rng(1).standard_normal((2, *exact.shape))
        data = fid.FrequencyResponse.from_values(
            omega,
            exact
            * (1.0 + mode / (1.0 + 0.4j * omega / 8.0 - (omega / 8.0) ** 2))
            * (1.0 + errors[0] + 1j * errors[1]),
            inputs=truth.inputs,
            outputs=truth.outputs,
            units=truth.units,
            random_error=np.full((1, 1, 40), 0.02),
        )
        return fid.identify(truth, data, correct_bias=False)

    assert fitted(0.0).parameters["Lp"].interval95 is not None
    bare = fitted(0.5)
    assert bare.parameters["Ltphi"].interval95 is None
    assert "misses far more" in bare.parameters["Ltphi"].reason
    assert bare.evidence.light is Light.RED


def test_costs_of_independent_errors_have_the_mean_that_is_foretold() -> None:
    random = np.random.default_rng(0)
    truth = fid.load_model("rate_first_order").with_values({"Lp": -5.0, "Ltphi": 150.0})
    omega = np.geomspace(0.5, 20.0, 40)
    exact = truth.frequency_response(omega)
    costs = []
    for _ in range(40):
        errors = 0.05 * random.standard_normal((2, *exact.shape))
        data = fid.FrequencyResponse.from_values(
            omega,
            exact * (1.0 + errors[0] + 1j * errors[1]),
            inputs=truth.inputs,
            outputs=truth.outputs,
            units=truth.units,
            random_error=np.full((1, 1, 40), 0.05),
        )
        fit = fid.identify(truth, data, correct_bias=False)
        costs.append(fit.average_cost)
        assert fit.findings[0].code != "cost" or "random errors" in fit.findings[0].message
    # Twenty points of equal weight: (20 / ln 10 · 0.05)² dB² and (0.05 rad)² with W_p = 0.01745.
    weight = (1.58 * (1.0 - np.exp(-1.0))) ** 2
    expected = 20.0 * weight * ((20.0 / np.log(10.0) * 0.05) ** 2 + 0.01745 * np.rad2deg(0.05) ** 2)
    assert 0.85 * expected < np.mean(costs) < 1.05 * expected


@pytest.mark.parametrize("mode", [0.0, 0.5])
def test_starts_around_a_fit_are_tried_whatever_noise_explains(
    mode: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    drawn: list[int] = []

    def counted(free: Sequence[fid.Parameter], starts: int, seed: int) -> NDArray[np.float64]:
        drawn.append(starts)
        return draw_starts(free, starts, seed)

    monkeypatch.setattr(search, "draw_starts", counted)
    truth = fid.load_model("rate_first_order").with_values({"Lp": -5.0, "Ltphi": 150.0})
    omega = np.geomspace(0.5, 20.0, 40)
    errors = 0.05 * np.random.default_rng(1).standard_normal((2, 1, 1, 40))
    missing = 1.0 + mode / (1.0 + 0.4j * omega / 8.0 - (omega / 8.0) ** 2)
    data = fid.FrequencyResponse.from_values(
        omega,
        truth.frequency_response(omega) * missing * np.exp(errors[0] + 1j * errors[1]),
        inputs=truth.inputs,
        outputs=truth.outputs,
        units=truth.units,
        random_error=np.full((1, 1, 40), 0.05),
    )
    fit = fid.identify(truth, data, correct_bias=False)
    assert fit.average_cost > search.LEAVES
    assert drawn == [1, search.NEARBY]


def test_large_problems_give_hopeless_starts_up_by_some_of_their_points(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    model = fid.load_model("rate_first_order").with_values({"Lp": -5.0, "Ltphi": 150.0})
    omega = np.geomspace(0.5, 20.0, 40)
    errors = 0.03 * np.random.default_rng(1).standard_normal((2, 1, 1, 40))
    data = fid.FrequencyResponse.from_values(
        omega,
        model.frequency_response(omega) * np.exp(errors[0] + 1j * errors[1]),
        inputs=model.inputs,
        outputs=model.outputs,
        units=model.units,
        random_error=np.full((1, 1, 40), 0.03),
    )
    own = [150.0, -5.0, 0.02]
    near = np.array([own, [151.0, -5.1, 0.02], [1.0, -5.0, 0.02], [160.0, -4.0, 0.022]])
    monkeypatch.setattr(search, "draw_starts", lambda free, starts, seed: near[:starts])
    followed: list[tuple[int, int, int]] = []
    follow = search._Descent.follow

    def told(self: search._Descent, begin: NDArray[np.float64], *steps: int, **how: bool) -> object:
        followed.append((len(begin), steps[0], len(self.selected[0].places)))
        return follow(self, begin, *steps, **how)

    monkeypatch.setattr(search._Descent, "follow", told)
    monkeypatch.setattr(search, "LEAVES", 0.0)
    costs = []
    for large in (np.inf, 0.0):
        monkeypatch.setattr(search, "LARGE", large)
        costs.append(fid.identify(model, data, n_omega=40, maximum_iterations=60).cost)
    first, early = (1, 60, 40), search.EARLY_ITERATIONS
    plain = [first, (3, early, 40), (2, 60, 40)]
    some = [first, (2, search.FIRST_STEPS, 14), (2, early, 40), (2, 60, 40)]
    assert followed == plain + some
    assert costs[0] == costs[1]
