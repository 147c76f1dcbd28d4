"""Every verb takes the hold from its records unless told, and says where nobody knows."""

from __future__ import annotations

import numpy as np
import pytest

import flightid as fid
from flightid.errors import DataError
from flightid.record import InputShape

TRUTH = fid.load_model("rate_first_order", axis="roll").with_values({"Lp": -6.0, "tau": 0.0})
MODEL = fid.load_model("rate_first_order", axis="roll").with_fixed(tau=0.0)


def _flown(hold: str | None, *, known: bool = True, seed: int = 0) -> fid.Record:
    time_s = np.arange(1200) * 0.05
    steps = np.repeat(0.1 * np.random.default_rng(seed).standard_normal(400), 3)
    driven = fid.Record.from_arrays(time_s, inputs={"tau_phi": steps}, units={"tau_phi": "1"})
    made = fid.simulate(TRUTH, driven, hold=hold, units={"p": "rad/s"})  # type: ignore[arg-type]
    noisy = made["p"] + 0.01 * np.random.default_rng(seed + 1).standard_normal(time_s.size)
    record = made.replace({"p": noisy})
    return record if known else record.replace(input_shape=InputShape())


def _said(result: fid.Fit | fid.Verification) -> list[str]:
    return [finding.message for finding in result.findings if finding.code.startswith("hold-")]


def test_a_fit_takes_the_hold_of_its_record() -> None:
    record = _flown("zero")
    by_record = fid.identify(MODEL, record)
    told = fid.identify(MODEL, record, hold="zero")
    wrong = fid.identify(MODEL, record, hold="first")
    assert by_record.parameters["Lp"].value == told.parameters["Lp"].value
    assert abs(by_record.parameters["Lp"].value + 6.0) < 0.1
    assert abs(wrong.parameters["Lp"].value + 6.0) > 0.3
    assert by_record.provenance["inputs"] == {"hold": "zero", "hold_from": "record"}
    assert not _said(by_record)


def test_an_unknown_hold_is_as_before_and_said() -> None:
    record = _flown("zero", known=False)
    fit = fid.identify(MODEL, record)
    told = fid.identify(MODEL, record, hold="first")
    assert fit.parameters["Lp"].value == told.parameters["Lp"].value
    said, sized = _said(fit)
    assert "steps" in sized
    assert "straight lines between samples, yet tau_phi" in said
    assert "every 3 samples" in said
    (doubted,) = _said(told)
    assert "steps between samples, not straight lines as was declared" in doubted
    assert fit.provenance["inputs"] == {"hold": "first", "hold_from": "assumed"}


def test_a_response_carries_the_hold_to_the_fit() -> None:
    held = fid.estimate_response(_flown("zero"), band_rad_s=(1.0, 15.0))
    assert held.input_shape.hold == "zero"
    fit = fid.identify(MODEL, held)
    assert fit.provenance["inputs"] == {"hold": "zero", "hold_from": "record"}
    silent = fid.estimate_response(_flown("zero", known=False), band_rad_s=(1.0, 15.0))
    fit = fid.identify(MODEL, silent)
    assert fit.provenance["inputs"] == {"hold": "band_limited", "hold_from": "assumed"}
    (said,) = _said(fit)
    # A wrong hold leaves far more than noise: without bars, other holds have no scale.
    assert said.startswith("inputs taken as smooth between samples; the record does not say")
    assert fit.covariance is None
    assert not _said(fid.identify(MODEL, silent, correct_bias=False))


def test_predictions_take_the_hold_of_each_record() -> None:
    held, lines = _flown("zero"), _flown("first")
    for record in (held, lines):
        assert fid.predict(TRUTH, record, initial_state="zero").rms_error["p"] < 0.011
    assert fid.predict(TRUTH, held, initial_state="zero", hold="first").rms_error["p"] > 0.02
    right = fid.verify(TRUTH, held, initial_state="zero")
    wrong = fid.verify(TRUTH, held, initial_state="zero", hold="first")
    assert (right.hold, wrong.hold) == ("zero", "first")
    assert right.rms_error["p"] < 0.6 * wrong.rms_error["p"]
    assert _said(fid.verify(TRUTH, _flown("zero", known=False)))


def test_different_holds_in_one_fit_are_refused_unless_told() -> None:
    pair = [_flown("zero"), _flown("first", seed=4)]
    with pytest.raises(DataError, match="hold their inputs differently"):
        fid.identify(MODEL, pair)
    with pytest.raises(DataError, match="hold their inputs differently"):
        fid.verify(TRUTH, pair)
    assert fid.identify(MODEL, pair, hold="zero").records
    assert len(fid.predict(TRUTH, pair, initial_state="zero")) == 2
