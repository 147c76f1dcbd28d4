"""Initial states and biases that a model declares reach the fit to records."""

from __future__ import annotations

import numpy as np

import flightid as fid
from tests.closeness import assert_close


def _model(**initial: object) -> fid.StateSpaceModel:
    return fid.StateSpaceModel.from_dict(
        {
            "states": {"p": "rad/s", "b": "rad"},
            "inputs": {"lat": "1"},
            "outputs": {"p": "p", "b": "b"},
            "parameters": {
                "Lp": {"value": -4.0, "unit": "1/s"},
                "L": {"value": 20.0, "unit": "rad/s^2"},
            },
            "equations": {"p'": "Lp*p + L*lat", "b'": "p"},
            "initial": {"p": {"free": True}, "b": 0.25} | initial,
            "biases": {"p": {"free": True}, "b": 0.1, "lat": 0.0},
        }
    )


def _record() -> fid.Record:
    time_s = np.arange(300) * 0.02
    lat = np.sign(np.sin(2.0 * time_s)) * 0.2
    record = fid.Record.from_arrays(time_s, inputs={"lat": lat})
    model = _model()
    flown = fid.simulate(model, record, initial_state=[0.3, 0.25], units=model.units, hold="zero")
    biased = {"p": flown["p"] + 0.05, "b": flown["b"] + 0.1}
    return flown.replace(biased)


def test_a_fit_follows_the_model() -> None:
    start = _model().with_values({"Lp": -3.0, "L": 15.0})
    fit = fid.identify(start, _record(), hold="zero")
    (record,) = fit.records
    assert_close(fit.parameters["Lp"].value, -4.0, rtol=1e-6, why="no noise")
    assert_close(record.initial_state["p"].value, 0.3, rtol=1e-5, why="no noise")
    assert_close(record.bias["p"].value, 0.05, rtol=1e-5, why="no noise")
    held = (record.initial_state["b"], record.bias["b"], record.reference_shift["lat"])
    assert [(each.value, each.status) for each in held] == [
        (0.25, "fixed"),
        (0.1, "fixed"),
        (0.0, "fixed"),
    ]


def test_options_overrule_the_model() -> None:
    fit = fid.identify(
        _model(),
        _record(),
        hold="zero",
        initial_state={"p": 0.3, "b": "estimate"},
        output_bias=["b"],
    )
    (record,) = fit.records
    assert record.initial_state["p"].status == "fixed"
    assert record.initial_state["b"].status == "free"
    assert record.bias["p"].status == "fixed"


def test_bounds_of_a_free_number_are_held() -> None:
    start = _model(p={"min": -1.0, "max": 0.2}).with_values({"Lp": -3.0, "L": 15.0})
    fit = fid.identify(start, _record(), hold="zero")
    found = fit.records[0].initial_state["p"]
    assert (found.value, found.status) == (0.2, "at bound")
    assert found.interval95 is None
    assert "would move it further" in found.reason
    wide = _model(p={"min": -1.0, "max": 1.0}).with_values({"Lp": -3.0, "L": 15.0})
    inside = fid.identify(wide, _record(), hold="zero").records[0].initial_state["p"]
    assert_close(inside.value, 0.3, rtol=1e-5, why="no noise, bounds out of the way")
    assert inside.status == "free"
