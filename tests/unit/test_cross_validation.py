"""Cross-validation: the numbers, what is stated beside them, and when it says no."""

from __future__ import annotations

import numpy as np
import pytest

import flightid as fid
from flightid.errors import DataError, OptionError
from flightid.plot.cross_validation import cross_runs
from flightid.validation import cross_validate
from tests.closeness import assert_close

TRUTH = fid.PolynomialModel("y", ("u",), 0.1, a=[1, -1.5, 0.7], b=[[1.0, 0.5]])


def fly(seed: int, *, offset: float = 0.0, curve: float = 0.0, name: str = "run") -> fid.Record:
    rng = np.random.default_rng(seed)
    u = rng.uniform(-1, 1, 400)
    record = fid.Record.from_arrays(
        np.arange(400) / 10, inputs={"u": u}, outputs={"y": np.zeros(400)}, name=name
    )
    y = TRUTH.simulate(record.replace({"u": u + curve * u**2}))
    return record.replace({"y": y + offset + 0.05 * rng.standard_normal(400)})


def linear_fit() -> fid.Fit:
    return fid.identify(fid.PolynomialModel.armax("u", "y", na=2, nb=2, nc=2), fly(0))


def test_numbers_are_those_of_the_prediction() -> None:
    fit, record = linear_fit(), fly(1)
    run = cross_validate(fit, record).of("run")
    made = fid.predict(fit.model, record)
    assert_close(run.predicted, made.predicted["y"], rtol=1e-15, why="the same prediction")
    measured, predicted = made.scored("y")
    error, about = measured - predicted, measured
    expected = 100 * (1 - np.linalg.norm(error) / np.linalg.norm(about))
    assert_close(run.fit_percent, expected, rtol=1e-12, why="definition")
    assert_close(run.mse, np.mean(error**2), rtol=1e-12, why="definition")
    rms = np.sqrt(np.mean(error**2))
    size = np.sqrt(np.mean(about**2)) + np.sqrt(np.mean(predicted**2))
    assert_close(run.theil, rms / size, rtol=1e-12, why="definition about the mean")


def test_horizon_and_initial_state_stand_beside_every_number() -> None:
    found = cross_validate(linear_fit(), [fly(1, name="a"), fly(2, name="b")])
    table = found.summary()
    starts = {
        "free run": "an initial state solved for over the first 4 s",
        "1 ahead": "the measured past",
    }
    assert [row[:4] for row in table.rows] == [
        (name, "model", horizon, start) for name in ("a", "b") for horizon, start in starts.items()
    ]
    assert [finding.light.value for finding in found.findings] == ["green", "green"]
    assert "worst free-run fit" in repr(found)
    assert found.to_dict()["schema"] == "flightid.cross_validation/1"
    assert "<table" in found._repr_html_()
    assert [trace.name for trace in cross_runs(found.runs[:1]).data][:3] == [
        "input",
        "measured",
        "model, free run",
    ]


def test_a_wrong_model_is_red() -> None:
    record = fly(1)
    found = cross_validate(linear_fit(), record.replace({"y": np.roll(record["y"], 60)}))
    assert [finding.light.value for finding in found.findings] == ["red"]


def test_a_narx_model_runs_beside_the_linear_model_of_its_lags() -> None:
    model = fid.NarxStructure("y", ("u",), 2, 2, kernel=None, degree=2, stop="bic")
    fit = fid.identify(model, fly(0, curve=0.8))
    found = cross_validate(fit, fly(1, curve=0.8))
    one, linear = found.of("run"), found.of("run", model="linear, same lags")
    assert one.rms < 0.7 * linear.rms
    assert one.initial_state == "2 measured samples"
    assert one.start == 2
    left = one.residual_record()
    assert left.n_samples == 398
    assert_close(left["y"], np.subtract(*one.scored), rtol=1e-15, why="measured minus predicted")
    # On a linear vehicle the same terms, chosen on few samples, have nothing to win.
    few = fid.identify(
        fid.NarxStructure("y", ("u",), 2, 2, width=0.5, stop="terms", maximum_terms=40),
        fly(0).segment(0.0, 10.0),
    )
    codes = [finding.code for finding in cross_validate(few, fly(3)).findings]
    assert "loses-to-linear" in codes


def test_a_run_that_is_held_is_red() -> None:
    fit = fid.identify(
        fid.NarxStructure("y", ("u",), 2, 2, kernel=None, degree=3, stop="terms", maximum_terms=25),
        fly(0).segment(0.0, 5.0),
    )
    record = fly(1)
    found = cross_validate(fit, record.replace({"u": 40.0 * record["u"]}))
    assert "free-run-unstable" in [finding.code for finding in found.findings]


def test_what_cannot_be_validated_is_refused() -> None:
    with pytest.raises(OptionError, match="nothing to validate on"):
        cross_validate(linear_fit(), [])
    record = fly(1)
    with pytest.raises(DataError, match="output 'y' of record 'run' does not change"):
        cross_validate(linear_fit(), record.replace({"y": np.ones(400)}))
    with pytest.raises(KeyError, match="elsewhere"):
        cross_validate(linear_fit(), record).of("elsewhere")
