"""Verification of models without equations: the numbers, their rivals, and when it says no."""

from __future__ import annotations

import numpy as np
import pytest

import flightid as fid
from flightid.errors import DataError, OptionError
from flightid.validation.verification.baseline import baseline_of
from tests.closeness import assert_close

TRUTH = fid.PolynomialModel(("u",), "y", 0.1, a=[1, -1.5, 0.7], b=[[1.0, 0.5]])


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


def test_numbers_are_those_of_the_prediction_after_its_first_stretch() -> None:
    fit, record = linear_fit(), fly(1)
    found, made = fid.verify(fit, record), fid.predict(fit, record)
    assert made.start == 40
    measured, predicted = record["y"][made.start :], made.predicted["y"][made.start :]
    error, about = measured - predicted, measured - measured.mean()
    expected = 100 * (1 - np.linalg.norm(error) / np.linalg.norm(about))
    assert_close(found.fit_percent["y"], expected, rtol=1e-12, why="definition")
    assert_close(found.mse["y"], np.mean(error**2), rtol=1e-12, why="definition")
    rms = np.sqrt(np.mean(error**2))
    size = np.sqrt(np.mean(about**2)) + np.sqrt(np.mean((predicted - measured.mean()) ** 2))
    assert_close(found.theil["y"], rms / size, rtol=1e-12, why="definition about the mean")


def test_a_step_ahead_is_shown_and_not_judged() -> None:
    found = fid.verify(linear_fit(), [fly(1, name="a"), fly(2, name="b")], horizon=1)
    assert found.horizon == 1
    assert found.findings == ()
    assert "1 sample ahead" in found.protocol
    assert found.rms_error["y"] < fid.verify(linear_fit(), fly(1)).rms_error["y"]


def test_a_wrong_model_and_a_moved_point_are_red() -> None:
    fit, record = linear_fit(), fly(1)
    for wrong in (record.replace({"y": np.roll(record["y"], 60)}), fly(1, offset=20.0)):
        assert "red" in [finding.light.value for finding in fid.verify(fit, wrong).findings]


def test_a_narx_model_runs_beside_the_linear_model_of_its_lags() -> None:
    asked = fid.NarxStructure(("u",), "y", 2, 2, kernel=None, degree=2, stop="bic")
    fit = fid.identify(asked, fly(0, curve=0.8))
    linear = baseline_of(fit)
    found = fid.verify([fit, linear], fly(1, curve=0.8), names=["model", "linear"])
    pair = found.contrast("y", "linear")
    assert pair.first_rms < 0.7 * pair.rival_rms
    assert pair.better == "model"
    assert found.first.predictions[0].start == 2
    assert found.first.initial_state == "2 measured samples"
    # On a linear vehicle the same terms, chosen on few samples, have nothing to win.
    few = fid.identify(
        fid.NarxStructure(("u",), "y", 2, 2, width=0.5, stop="terms", maximum_terms=40),
        fly(0).segment(0.0, 10.0),
    )
    assert "loses-to-linear" in [finding.code for finding in fid.verify(few, fly(3)).findings]


def test_a_run_that_is_held_is_red() -> None:
    fit = fid.identify(
        fid.NarxStructure(("u",), "y", 2, 2, kernel=None, degree=3, stop="terms", maximum_terms=25),
        fly(0).segment(0.0, 5.0),
    )
    record = fly(1)
    found = fid.verify(fit, record.replace({"u": 40.0 * record["u"]}))
    assert "free-run-unstable" in [finding.code for finding in found.findings]


def test_what_cannot_be_verified_is_refused() -> None:
    with pytest.raises(OptionError, match="nothing to verify on"):
        fid.verify(linear_fit(), [])
    record = fly(1)
    with pytest.raises(DataError, match="output 'y' of record 'run' does not change"):
        fid.verify(linear_fit(), record.replace({"y": np.ones(400)}))
