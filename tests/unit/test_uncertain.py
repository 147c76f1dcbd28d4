"""Uncertainty carried from fits and responses to what is computed from them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import flightid as fid
from flightid import errors
from flightid.identification.fit import uncertain_model
from flightid.identification.uncertain_of import uncertain_of
from flightid.uncertainty.estimate import Estimate, estimate_table
from flightid.uncertainty.uncertain import Uncertain
from tests.closeness import assert_close

COVARIANCE = np.array([[0.04, 0.01], [0.01, 0.09]])


def _pair() -> Uncertain[np.ndarray]:
    return Uncertain(np.array([2.0, 3.0]), COVARIANCE, lambda numbers: numbers)


def test_linear_functions_are_exact() -> None:
    found = _pair().carried(lambda x: [x[0] - 2.0 * x[1], x[0] * 5.0])
    gains = np.array([[1.0, -2.0], [5.0, 0.0]])
    assert found.covariance is not None
    assert_close(found.covariance, gains @ COVARIANCE @ gains.T, rtol=1e-12, why="linear")
    assert found.interval() is not None
    half = 1.959964 * np.sqrt(gains[1] @ COVARIANCE @ gains[1])
    assert_close(found.interval()[1], [10.0 - half, 10.0 + half], rtol=1e-6, why="normal")


def test_quadratic_functions_keep_the_slope() -> None:
    found = _pair().carried(lambda x: x[1] ** 2)
    assert found.stderr is not None
    assert_close(found.stderr[0], 6.0 * 0.3, rtol=1e-12, why="central differences of a square")


def test_a_number_that_jumps_has_the_spread_of_its_draws() -> None:
    both = Uncertain(np.array([0.0, 0.0]), np.diag([0.01, 0.01]), lambda numbers: numbers)
    # No single direction reaches the jump by one standard deviation; one draw of ten does.
    found = both.carried(lambda x: [x.sum() + 5.0 * (x.sum() > 0.18), x.sum()])
    assert found.stderr is not None
    assert 0.5 < found.stderr[0] < 3.0
    assert_close(found.stderr[1], np.sqrt(0.02), rtol=1e-9, why="a straight number keeps its own")


def test_a_number_that_many_draws_lose_is_not_determined() -> None:
    both = Uncertain(np.array([0.0, 0.0]), np.diag([0.01, 0.01]), lambda numbers: numbers)
    found = both.carried(lambda x: [np.nan if x.sum() > 0.18 else x.sum()])
    assert found.number(0, "crossing").interval95 is None


def test_steps_stay_inside_the_bounds() -> None:
    """A delay known to twice its size still has its error, and no step makes it negative."""
    seen = []
    low, high = np.array([1.95, -np.inf]), np.array([9.0, np.inf])
    tight = Uncertain(np.array([2.0, 3.0]), COVARIANCE, lambda x: x, (low, high))
    found = tight.carried(lambda x: [seen.append(x[0]) or x[0] + x[1], x[0]])
    assert min(seen) >= 1.95
    assert found.covariance is not None
    assert_close(found.covariance[0, 0], 0.15, rtol=1e-7, why="0.04 + 2·0.01 + 0.09")
    assert_close(found.covariance[1, 1], 0.04, rtol=1e-7, why="linear")
    ends = np.array(list(tight.steps(2.0)))
    assert ends[..., 0].min() == 1.95
    truth = fid.load_model("rate_first_order").with_values({"tau": 0.001})
    omega = np.geomspace(0.5, 20.0, 30)
    data = fid.FrequencyResponse.from_values(
        omega,
        truth.frequency_response(omega),
        inputs=truth.inputs,
        outputs=truth.outputs,
        units=truth.units,
        random_error=np.full((1, 1, 30), 0.1),
    )
    uncertain = uncertain_of(fid.identify(truth, data))
    late = uncertain.carried(lambda model: model.parameters["tau"].value)
    assert late.stderr is not None
    assert late.stderr[0] > 0.001


def test_draws_have_the_covariance_and_keep_the_bounds() -> None:
    drawn = np.array(_pair().draws(4000, seed=3))
    assert_close(np.cov(drawn.T), COVARIANCE, rtol=0.1, atol=0.003, why="4000 draws")
    assert np.array_equal(np.array(_pair().draws(5, seed=3)), drawn[:5])
    low, high = np.array([1.9, -np.inf]), np.array([2.1, np.inf])
    tight = Uncertain(np.array([2.0, 3.0]), COVARIANCE, lambda x: x, (low, high))
    inside = np.array(tight.draws(300))[:, 0]
    assert inside.min() >= 1.9
    assert inside.max() <= 2.1
    never = Uncertain(np.zeros(1), np.eye(1), lambda x: x, (np.full(1, 99.0), np.full(1, 99.0)))
    assert never.draws(1)[0] == 99.0


def test_no_draw_or_step_of_a_black_box_leaves_what_searches_hold_stable() -> None:
    """A pole beside its zero is hardly known, but had it grown the fit would have seen it."""
    model = fid.PolynomialModel(("u",), "y", 0.1, b=[[1.0, 0.9]], f=[[1.0, 0.91]])
    spread = np.diag([1e-4, 1e-4, 0.1])
    plain = uncertain_model(model, tuple(model.parameters), spread)
    wild = replace(plain, allowed=None)
    sizes = [[abs(each.f[0][1]) for each in some.draws(150)] for some in (plain, wild)]
    assert max(sizes[0]) < 1.0 < max(sizes[1])
    ends = [abs(each.f[0][1]) for pair in plain.steps(2.0) for each in pair]
    assert max(ends) < 1.0 < max(abs(e.f[0][1]) for pair in wild.steps(2.0) for e in pair)
    # One that is unstable itself may be so.
    growing = fid.PolynomialModel(("u",), "y", 0.1, b=[[1.0]], f=[[1.0, -1.05]])
    assert uncertain_model(growing, ("b1", "f1"), np.eye(2)).allowed is None


def test_what_is_not_known_says_why() -> None:
    uncertain = uncertain_of(fid.load_model("rate_first_order"))
    assert not uncertain.known
    assert uncertain.draws(3) == []
    found = uncertain.carried(lambda model: [1.0, np.nan])
    assert found.interval() is None
    assert "without a covariance" in found.number(0, "gain").reason
    assert found.number(1, "gain", missing="no crossing") == Estimate(
        "gain", None, "1", None, "no crossing"
    )
    fades = _pair().carried(lambda x: x[0] if x[0] > 1.9 else np.nan)
    assert "within its uncertainty" in fades.number(0, "margin").reason
    table = estimate_table("t", [found.number(0, "gain"), fades.number(0, "margin", "dB")])
    assert any("margin: not determined everywhere" in note for note in table.notes)


def test_then_carries_on() -> None:
    made = _pair().then(lambda x: float(x.sum()))
    assert made.value == 5.0
    assert made.carried(lambda value: value).stderr == pytest.approx([np.sqrt(0.15)])


def test_what_is_kept_is_made_once_and_says_the_same() -> None:
    made: list[float] = []

    def squared(numbers: np.ndarray) -> np.ndarray:
        made.append(float(numbers[0]))
        return numbers**2

    plain = Uncertain(np.array([3.0, 4.0]), np.diag([0.01, 0.04]), squared)
    wanted, once = plain.carried(np.sum), len(made)
    kept = plain.kept()
    for _ in range(2):
        found = kept.then(np.sum).carried(np.asarray)
        assert found.numbers.tobytes() == wanted.numbers.tobytes()
        assert found.covariance.tobytes() == wanted.covariance.tobytes()
    assert len(made) == 2 * once


def test_fits_of_every_kind_have_a_covariance() -> None:
    u = np.random.default_rng(0).standard_normal(600)
    truth = fid.PolynomialModel(("u",), "y", 0.1, a=[1, -1.5, 0.7], b=[[1.0, 0.5]])
    record = fid.Record.from_arrays(
        np.arange(600) / 10, inputs={"u": u}, outputs={"y": np.zeros(600)}
    )
    noise = 0.1 * np.random.default_rng(1).standard_normal(600)
    record = record.replace({"y": truth.simulate(record) + noise})
    polynomial = fid.identify(fid.PolynomialModel.oe("u", "y", nb=2, nf=2), record)
    found = uncertain_of(polynomial).carried(lambda model: model.gains()["y/u"])
    gain = polynomial.details.gains["y/u"]
    assert found.stderr is not None
    assert_close(found.stderr[0], gain.stderr, rtol=0.02, why="the fit's own delta method")
    subspace = fid.identify(fid.InnovationsModel.subspace("u", "y", 2), record)
    found = uncertain_of(subspace).carried(lambda model: model.gains()["y/u"])
    assert found.stderr is not None
    assert_close(
        found.stderr[0], subspace.details.gains["y/u"].stderr, rtol=0.02, why="delta method"
    )


def test_a_response_moves_in_both_parts() -> None:
    omega = np.geomspace(1.0, 10.0, 5)
    values = 1.0 / (1j * omega + 3.0)
    given = fid.FrequencyResponse.from_values(
        omega, values, inputs=["u"], outputs=["y"], random_error=np.full((1, 1, 5), 0.1)
    )
    found = uncertain_of(given, "y", "u").carried(lambda r: np.abs(r.response[0, 0]))
    assert found.stderr is not None
    assert_close(found.stderr, 0.1 * np.abs(values), rtol=0.01, why="relative error")
    bare = fid.FrequencyResponse.from_values(omega, values, inputs=["u"], outputs=["y"])
    assert "not known" in uncertain_of(bare).reason
    two = fid.FrequencyResponse.from_values(
        omega, np.stack([values, values])[:, None], inputs=["u"], outputs=["y", "z"]
    )
    with pytest.raises(errors.OptionError, match="several outputs"):
        uncertain_of(two)
    with pytest.raises(errors.OptionError, match="number of draws"):
        _pair().draws(0)
