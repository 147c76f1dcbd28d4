"""Responses and records in one fit: recovery, narrower intervals, what it says and refuses."""

from __future__ import annotations

from dataclasses import dataclass
from types import SimpleNamespace

import numpy as np
import pytest

import flightid as fid
from flightid.errors import DataError, FitError, OptionError
from flightid.identification.joint import fit as joint
from flightid.identification.output_error.search import searched
from flightid.identification.records.options import RecordOptions
from flightid.identification.records.setup import prepare_records
from tests.closeness import assert_close
from tests.joint_flights import BAND, flight, lag, swept
from tests.strangers import joint_fits

FAST = {"band_rad_s": BAND, "correct_bias": False}


def _given(
    model: fid.TransferFunctionModel, error: float, seed: int | None = None
) -> fid.FrequencyResponse:
    """The model's own response, with what its errors are said to be, and with a draw of them."""
    omega = np.geomspace(*BAND, 40)
    response = model.frequency_response(omega)
    if seed is not None:
        drawn = np.random.default_rng(seed).standard_normal((2, *response.shape))
        response = response * (1.0 + error * (drawn[0] + 1j * drawn[1]))
    return fid.FrequencyResponse.from_values(
        omega, response, inputs=["tau_phi"], outputs=["p"],
        units={"p": "rad/s"}, random_error=np.full(40, error),
    )  # fmt: skip


def test_data_without_noise_give_the_parameters_back() -> None:
    truth = lag()
    start = truth.with_values({"Lp": -3.0, "Ltphi": 90.0})
    fit = fid.identify(start, (_given(truth, 0.01), flight(truth, 0, noise=0.0)))
    for name, wanted in (("Lp", -5.0), ("Ltphi", 150.0)):
        assert_close(fit.parameters[name].value, wanted, rtol=1e-7, why="no noise")
    assert [each.name for each in fit.responses] == ["p/tau_phi"]
    assert len(fit.records) == 1
    assert set(fit.costs) == {"p/tau_phi", "p"}
    assert fit.intervals_from == "random error and coloured residuals"
    assert "1 response, 1 record" in repr(fit)
    assert fit.to_dict()["provenance"]["method"] == "joint"


def test_it_is_the_weighted_mean_of_both_fits() -> None:
    """Near the minimum both costs are parabolas: information adds, estimates are weighted by it."""
    truth = lag()
    response, record = _given(truth, 0.01, seed=0), flight(truth, 1, noise=0.1)
    one = fid.identify(truth, response, cost="likelihood", **FAST)
    other = fid.identify(truth, record)
    both = fid.identify(truth, (response, [record]), **FAST)
    assert one.covariance is not None
    assert other.covariance is not None
    assert both.covariance is not None
    weights = [np.linalg.inv(each.covariance) for each in (one, other)]
    joint = np.linalg.inv(weights[0] + weights[1])
    values = [np.array([each.parameters[n].value for n in both.names]) for each in (one, other)]
    mean = joint @ (weights[0] @ values[0] + weights[1] @ values[1])
    found = np.array([both.parameters[name].value for name in both.names])
    errors = np.sqrt(np.diag(both.covariance))
    assert np.all(np.abs(found - mean) < 0.1 * errors)
    assert_close(errors, np.sqrt(np.diag(joint)), rtol=0.05, why="weights of a finite record")
    for name in both.names:
        alone = [each.parameters[name].stderr for each in (one, other)]
        stderr = both.parameters[name].stderr
        assert stderr is not None
        assert all(stderr < each for each in alone if each is not None)


def test_the_bias_of_the_estimate_is_taken_out() -> None:
    truth = lag()
    data = (swept(truth, 0, noise=1e-6), flight(truth, 1, noise=1e-3))
    errors = {}
    for corrected in (True, False):
        fit = fid.identify(truth, data, band_rad_s=BAND, correct_bias=corrected)
        errors[corrected] = abs(fit.parameters["Lp"].value / -5.0 - 1.0)
        assert fit.provenance["estimator_bias"]["applied"] is corrected
    assert errors[True] < 0.1 * errors[False]


def test_the_same_flight_on_both_sides_is_found() -> None:
    truth = lag()
    record = flight(truth, 0)
    response = fid.estimate_response(record, band_rad_s=BAND, n_omega=30)
    codes = {f.code for f in fid.identify(truth, (response, record), **FAST).findings}
    assert "joint-data-twice" in codes
    codes = {f.code for f in fid.identify(truth, (response, flight(truth, 1)), **FAST).findings}
    assert not codes & {"joint-data-twice", "joint-data-unknown"}
    codes = {f.code for f in fid.identify(truth, (_given(truth, 0.01), record)).findings}
    assert "joint-data-unknown" in codes


def test_what_it_refuses() -> None:
    truth = lag()
    record = flight(truth, 0)
    known = _given(truth, 0.01)
    with pytest.raises(DataError, match="one frequency response"):
        fid.identify(truth, (known, known, record))  # type: ignore[call-overload]
    with pytest.raises(FitError, match="needs the errors"):
        fid.identify(truth, (_given(truth, 0.0), record))
    with pytest.raises(OptionError, match="no such option"):
        fid.identify(truth, (known, record), cost="likelihood")  # type: ignore[call-overload]


@pytest.mark.parametrize("name", ["short period, short windows", "accelerometer, short windows"])
def test_windows_shorter_than_the_motion_settle_at_a_minimum(name: str) -> None:
    """Rounds of fit and correction cycled here in 60 of 60 and left no intervals."""
    craft = joint_fits.VEHICLES[name]
    fit = joint_fits.fly_and_fit(1, name=name)
    told = fit.provenance["estimator_bias"]
    assert (told["applied"], told["converged"]) == (True, True)
    for key, value in craft.truth.items():
        known = fit.parameters[key]
        assert abs(known.value - value) < 3.5 * (known.stderr or 0.0)


def test_the_fit_is_a_minimum_of_what_the_estimator_makes_of_the_model() -> None:
    craft = joint_fits.VEHICLES["lightly damped, 25 s"]
    flown, beside = joint_fits.flights(0, craft)
    response = joint_fits.response_of(craft, flown)
    fit = fid.identify(craft.model(), (response, beside))
    value = fit.parameters["Za"].value
    for share in (0.98, 1.02):
        fixed = fit.model.with_fixed(Za=share * value)
        assert fid.identify(fixed, (response, beside)).objective > fit.objective


def test_what_written_residuals_raise_reaches_the_caller() -> None:
    """And where they have no value the search shortens its steps."""
    record = flight(lag(), 0)
    model = lag().with_values({"Lp": -3.0, "Ltphi": 90.0})
    options = RecordOptions()
    prepared = prepare_records(model, [record], options)
    goal = np.array([100.0, -4.0, 0.03])

    def residuals(x: np.ndarray) -> np.ndarray:
        return 1e6 * (x - goal) if x[0] < 105.0 else np.full(3, np.nan)

    def broken(x: np.ndarray) -> np.ndarray:
        raise ZeroDivisionError(x.shape)

    def jacobian(x: np.ndarray) -> np.ndarray:
        return 5e5 * np.eye(len(x))  # steps go twice as far as they should

    fitted = searched(model, prepared, options, written=(residuals, jacobian, 3)).fitted
    found = [fitted.parameters[name].value for name in ("Ltphi", "Lp", "tau")]
    assert_close(np.array(found, dtype=float), goal, rtol=1e-6, why="they outweigh the record")
    with pytest.raises(ZeroDivisionError, match="3"):
        searched(model, prepared, options, written=(residuals, broken, 3))


@dataclass(frozen=True)
class _Response:
    """What a search with the estimator inside is asked of: its cost is 10 at the plain fit."""

    model: object = None
    selected: tuple[object, ...] = ()

    @property
    def correction(self) -> object:
        """Of errors that the response was not measured with."""
        return SimpleNamespace(data=SimpleNamespace(errors=None))

    def residuals(self, _: object) -> np.ndarray:
        return np.array([3.0, 1.0])

    def at(self, x: float) -> float:
        return x


@pytest.mark.parametrize(
    ("costs", "best", "kept"),
    [
        ((5.0,), 5.0, True),  # It did not rise: no further start.
        ((9.0, 9.004, 12.0), 9.0, True),  # Another start meets it: nothing tells of a lower one.
        ((9.0, 7.0, 11.0), 7.0, False),  # A lower one that still rose, and none meets it.
        ((9.0, 5.2, 11.0), 5.2, True),  # One that costs no more than without.
    ],
)
def test_a_joint_cost_that_rose_is_searched_again_as_that_of_a_response(
    monkeypatch: pytest.MonkeyPatch, costs: tuple[float, ...], best: float, kept: bool
) -> None:
    """Negative log-likelihood 5 before, a response's cost of 10: from 5.5 on it rose by 10 %.

    Refused by the rise alone, right minima were: a cost that rose tells no wrong one.
    """
    left = iter(costs)

    def searched(*_: object) -> object:
        return SimpleNamespace(cost=next(left), step=0.0, misfit=9.0)

    monkeypatch.setattr(joint, "search_inside", searched)
    monkeypatch.setattr(joint, "further_starts", lambda *_: [1.0] * (len(costs) - 1))
    monkeypatch.setattr(joint, "curves_of", lambda *_: [])
    free = SimpleNamespace(parameters=SimpleNamespace(free=()))
    found = SimpleNamespace(fitted=free, groups=[[SimpleNamespace(cost=5.0)]])
    ends = joint._ends_inside(found, SimpleNamespace(model=free), None, _Response())  # type: ignore[arg-type]
    assert ends[0].cost == best
    assert not [*left], "each start is searched"
    reason = joint._why_worse(found, ends, _Response())  # type: ignore[arg-type]
    assert (reason == "") is kept
    assert kept or reason.endswith("no further start meets: there may be lower ones")
