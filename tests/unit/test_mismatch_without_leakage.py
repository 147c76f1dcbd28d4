"""Envelopes judge a model's response as its estimator would have measured it."""

import numpy as np
import pytest

import flightid as fid
from flightid.validation import mismatch

SLOW = """
kind = "state-space"
name = "Slow lag behind a light mode"
[states]
y = "1"
q = "1/s"
w = "1"
[inputs]
e = "1"
[outputs]
w = "w"
[parameters]
k = { value = 4.0, unit = "1/s^2" }
n = { value = 4.0, unit = "1/s^2", fixed = true }
d = { value = 0.05, unit = "1/s" }
c = { value = 0.02, unit = "1/s", fixed = true }
g = { value = 1.0, unit = "1/s", fixed = true }
[equations]
"y'" = "q"
"q'" = "-n*y - d*q + k*e"
"w'" = "-c*w + g*y"
"""


@pytest.fixture(scope="module")
def flown(tmp_path_factory: pytest.TempPathFactory) -> tuple[fid.StateSpaceModel, object]:
    path = tmp_path_factory.mktemp("models") / "slow.toml"
    path.write_text(SLOW)
    model = fid.load_model(path)
    time_s = np.arange(4000) * 0.02
    sweep = np.sin(0.3 * time_s + 3.0 * time_s**2 / 80.0) * ((time_s > 2.0) & (time_s < 78.0))
    moved = fid.Record.from_arrays(time_s, inputs={"e": sweep}).declare(hold="zero")
    record = fid.simulate(model, moved, hold="zero")
    response = fid.estimate_response(
        record, band_rad_s=(0.8, 6.0), window_s=6.0, n_omega=30, estimator="composite"
    )
    return model, response


def test_leakage_is_no_fault_of_the_right_model(flown) -> None:  # type: ignore[no-untyped-def]
    model, response = flown
    seen = fid.verify(model, _record(model), responses=response).mismatch
    assert seen is not None
    assert seen.is_corrected
    assert seen.inside_percent == (100.0,)
    assert "leakage taken out" in seen.findings[0].message


def test_wrong_models_leave_the_envelopes(flown) -> None:  # type: ignore[no-untyped-def]
    model, response = flown
    for wrong in ({"k": 8.0}, {"k": -4.0}, {"d": 2.0}):
        seen = fid.verify(model.with_values(wrong), _record(model), responses=response).mismatch
        assert seen is not None
        assert seen.findings[0].light.value != "green"


def test_transfer_functions_are_judged_alike() -> None:
    model = fid.load_model("rate_first_order", axis="roll")
    time_s = np.arange(2000) * 0.02
    swept = {model.inputs[0]: np.sin(0.3 * time_s + 3.0 * time_s**2 / 40.0)}
    moved = fid.Record.from_arrays(time_s, inputs=swept).declare(hold="zero")
    response = fid.estimate_response(
        fid.simulate(model, moved, hold="zero"), band_rad_s=(1.0, 6.0), window_s=6.0
    )
    seen = mismatch(model, response)
    assert seen.is_corrected
    assert seen.inside_percent == (100.0,)


def _record(model: fid.StateSpaceModel) -> fid.Record:
    time_s = np.arange(1000) * 0.02
    steps = fid.Record.from_arrays(time_s, inputs={"e": 1.0 * (time_s % 6.0 > 3.0)})
    return fid.simulate(model, steps.declare(hold="zero"), hold="zero")
