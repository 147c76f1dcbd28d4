"""One verb predicts with every kind of model, and is told nothing of the record it is judged on."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.signal import lfilter

import flightid as fid
from flightid.errors import DataError, ModelError, OptionError, UnknownNameError
from tests.closeness import assert_close

STEP_S = 0.1


def _lag_record(n: int = 400, *, level: float = 0.0, start: float = 0.0) -> fid.Record:
    """y(t) = 0.9 y(t-1) + 0.5 u(t-1) about a level, by SciPy, from y(0) = start."""
    u = np.random.default_rng(5).standard_normal(n)
    forced = lfilter([0.0, 0.5], [1.0, -0.9], u)
    y = forced + start * 0.9 ** np.arange(n)
    return fid.Record.from_arrays(
        np.arange(n) * STEP_S, inputs={"u": u + level}, outputs={"y": y + 10.0 * level}
    )


def _polynomial(**options: object) -> fid.PolynomialModel:
    return fid.PolynomialModel(("u",), "y", STEP_S, a=[1, -0.9], b=[[0.5]], **options)


def _innovations(**options: object) -> fid.InnovationsModel:
    return fid.InnovationsModel(
        ("u",), ("y",), STEP_S, [[0.9]], [[0.5]], [[1.0]], k=[[0.9]], **options
    )


SAMPLED = [_polynomial, _innovations]


@pytest.mark.parametrize("make", SAMPLED)
def test_offsets_come_from_the_model_and_not_from_the_record(make: type) -> None:
    record = _lag_record(level=2.0)
    about = make(operating_point={"u": 2.0, "y": 20.0})
    assert fid.predict(about, record, initial_state="zero").fit_percent["y"] > 99.999
    # The mean of the record would hide that this model was trained elsewhere.
    elsewhere = make(operating_point={"u": 2.0, "y": 17.0})
    made = fid.predict(elsewhere, record, initial_state="zero")
    assert_close(made.residual("y")[50:], np.full(350, 3.0), atol=1e-9, why="the offset is seen")
    trimmed = record.replace({}, trim={"u": 2.0, "y": 20.0})
    assert fid.predict(elsewhere, trimmed, initial_state="trim").fit_percent["y"] > 99.999


@pytest.mark.parametrize("make", SAMPLED)
def test_the_start_is_told_by_the_first_stretch_alone(make: type) -> None:
    record = _lag_record(start=3.0)
    made = fid.predict(make(), record, settle_s=2.0)
    assert (made.start, made.fit_percent["y"] > 99.999) == (20, True)
    assert "first 2 s" in made.words
    # What happens after the stretch does not reach the prediction.
    spoilt = record["y"].copy()
    spoilt[20:] += 100.0
    later = fid.predict(make(), record.replace({"y": spoilt}), settle_s=2.0)
    assert_close(later.predicted["y"], made.predicted["y"], rtol=1e-12, why="nothing else is told")
    assert fid.predict(make(), record).start == 40
    measured = fid.predict(make(), record, initial_state="measured")
    assert (measured.start, measured.fit_percent["y"] > 99.999) == (1, True)
    assert fid.predict(make(), record, initial_state="zero").start == 0


@pytest.mark.parametrize("make", SAMPLED)
def test_steps_ahead_come_from_the_measured_past(make: type) -> None:
    """Both models are y(t) = 0.9 y(t-1) + 0.5 u(t-1) + e(t): the last sample tells the next."""
    record = _lag_record(start=1.0)
    y, u = record["y"], record["u"]
    one = fid.predict(make(), record, 1)
    assert_close(one.predicted["y"][1:], 0.9 * y[:-1] + 0.5 * u[:-1], atol=1e-9, why="ARX")
    assert one.words == "1 ahead from the measured past"


def test_a_bias_of_a_sampled_model_is_told_by_the_stretch() -> None:
    record = _lag_record()
    shifted = record.replace({"y": record["y"] + 4.0})
    made = fid.predict(_polynomial(), shifted, output_bias=True, settle_s=5.0)
    assert_close(made.shifts.output_bias, [4.0], rtol=1e-9, why="no noise")
    assert made.fit_percent["y"] > 99.999


def test_a_sampled_linear_system_runs_as_a_recursion() -> None:
    """A discrete system was integrated as if it were continuous."""
    system = fid.LinearSystem(
        [[0.9]], [[0.5]], [[1.0]], [[0.0]], ("u",), ("y",), [2 * STEP_S], sample_time_s=STEP_S
    )
    record = _lag_record()
    late = record.replace({"y": np.concatenate([np.zeros(2), record["y"][:-2]])})
    assert fid.predict(system, late, initial_state="zero").fit_percent["y"] > 99.999


def test_given_and_solved_states_of_equations() -> None:
    spring = fid.LinearSystem(
        [[0.0, 1.0], [-4.0, -0.4]],
        [[0.0], [1.0]],
        [[1.0, 0.0]],
        [[0.0]],
        ("u",),
        ("x",),
        states=("x", "v"),
    )
    time_s = np.arange(600) * 0.02
    flown = fid.Record.from_arrays(time_s, inputs={"u": np.sin(time_s)})
    rest = fid.simulate(spring, flown)
    root = np.sqrt(4.0 - 0.04)
    swing = np.exp(-0.2 * time_s) * np.sin(root * time_s) / root  # from x = 0, v = 1
    moved = rest.replace({"x": rest["x"] + 0.7 * swing})
    given = fid.predict(spring, moved, initial_state={"v": 0.7})
    assert_close(given.predicted["x"], moved["x"], atol=1e-9, why="exact")
    solved = fid.predict(spring, moved, initial_state={"v": "estimate"}, settle_s=3.0)
    assert_close(solved.shifts.initial_state, [0.0, 0.7], atol=1e-9, why="no noise")
    assert solved.start == 150
    whole = fid.predict(spring, moved, initial_state="estimate")
    assert (whole.start, whole.fit_percent["x"] > 99.999) == (0, True)


def test_several_records_give_several_predictions() -> None:
    made = fid.predict(_polynomial(), [_lag_record(), _lag_record(300)])
    assert [each.measured.n_samples for each in made] == [400, 300]
    assert made[0].to_dict()["schema"] == "flightid.prediction/1"
    assert "not scored" in made[0].summary().notes[0]


def test_kinds_are_verified_side_by_side_on_the_same_samples() -> None:
    record = _lag_record(start=0.5)
    grey = fid.LinearSystem([[np.log(0.9) / STEP_S]], [[0.5]], [[1.0]], [[0.0]], ("u",), ("y",))
    beside = fid.verify([_polynomial(), _innovations(), grey], record, names=["ARX", "inn", "ode"])
    starts = {each.predictions[0].start for each in beside.verifications.values()}
    assert starts == {40}
    assert beside.verifications["ARX"].theil["y"] < 1e-9 < beside.verifications["ode"].theil["y"]


@pytest.mark.parametrize(
    ("error", "message", "options"),
    [
        (OptionError, "horizon is too small", {"horizon": 0}),
        (OptionError, "initial_state is not known", {"initial_state": "somewhere"}),
        (OptionError, "no state biases", {"state_bias": True}),
        (OptionError, "no names", {"initial_state": {"x": 1.0}}),
        (OptionError, "leaves nothing of the record", {"settle_s": 40.0}),
        (OptionError, "settle_s is too small", {"settle_s": -1.0}),
        (OptionError, "takes no bias off", {"horizon": 2, "output_bias": True}),
        (UnknownNameError, "no such output", {"outputs": ["z"]}),
    ],
)
def test_refusals_of_a_sampled_model(
    error: type[Exception], message: str, options: dict[str, object]
) -> None:
    with pytest.raises(error, match=message):
        fid.predict(_polynomial(), _lag_record(), **options)


def test_refusals_of_models_without_noise() -> None:
    lag = fid.LinearSystem([[-1.0]], [[1.0]], [[1.0]], [[0.0]], ("u",), ("y",))
    with pytest.raises(OptionError, match="no noise model"):
        fid.predict(lag, _lag_record(), 3)
    with pytest.raises(UnknownNameError, match="no such state"):
        fid.predict(lag, _lag_record(), initial_state={"q": 1.0})
    with pytest.raises(ModelError, match="cannot be simulated"):
        fid.predict("a text", _lag_record())
    still = _lag_record().replace({"y": np.ones(400)})
    with pytest.raises(DataError, match="does not change"):
        fid.verify(_polynomial(), still)


def test_the_published_dryer_split(shared_data: Path) -> None:
    """ARX(2,2,3) of samples 1-300, from rest over the whole record: published, see `data/`."""
    (record,) = fid.read_records(
        shared_data / "records" / "dryer.csv", inputs=["u"], outputs=["y"], sample_time_s=0.08
    )
    fit = fid.identify(
        fid.PolynomialModel.arx("u", "y", na=2, nb=2, nk=3, offsets="mean_as_trim"),
        record.segment(-1.0, 299.5 * 0.08),
    )
    for last, start, published in ((900, 800, 78.57), (1000, 300, 82.28)):
        until = record.segment(-1.0, (last - 0.5) * 0.08)
        made = fid.predict(fit, until, initial_state="zero", settle_s=start * 0.08)
        assert made.start == start
        assert_close(made.fit_percent["y"], published, atol=0.005, why="published to 0.01 %")
