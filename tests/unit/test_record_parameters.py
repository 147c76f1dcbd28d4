"""Parameters that each record has for itself: declared by its channels, or estimated."""

from __future__ import annotations

import numpy as np
import pytest

import flightid as fid
from flightid.errors import DataError, OptionError, UnknownNameError
from tests.closeness import assert_close

MASS, CONSTANT = (1.0, 2.0, 4.0), (0.1, -0.2, 0.3)


def cart() -> fid.StateSpaceModel:
    return fid.StateSpaceModel(
        states={"v": "m/s"},
        input_units={"force": "N"},
        measurements={"v": fid.Output("v", "m/s")},
        equations={"v'": "(K*force - d*v)/m + a0"},
        parameters=fid.Parameters(
            [
                fid.Parameter("K", 1.0, "1"),
                fid.Parameter("d", 0.5, "N*s/m"),
                fid.Parameter("m", 1.5, "kg", free=False),
                fid.Parameter("a0", 0.0, "m/s^2", free=False),
            ]
        ),
        name="cart",
    )


def runs(*, declared: bool = True) -> list[fid.Record]:
    records = []
    for place, (mass, constant) in enumerate(zip(MASS, CONSTANT, strict=True)):
        time_s = np.arange(200) * 0.05
        force = np.sin(0.8 * (place + 1) * time_s)
        driven = fid.Record.from_arrays(time_s, inputs={"force": force}, units={"force": "N"})
        truth = cart().with_values({"m": mass, "a0": constant})
        made = fid.simulate(truth, driven, initial_state=[0.5])
        weighed = {"m": np.full(200, mass)} if declared else {}
        records.append(
            fid.Record.from_arrays(
                time_s, inputs={"force": force}, outputs={"v": made["v"]}, others=weighed,
                units={"force": "N", "v": "m/s", **dict.fromkeys(weighed, "kg")}, hold="first",
                name=f"run {place}",
            )
        )  # fmt: skip
    return records


def fitted(**options: object) -> fid.Fit:
    start = cart().with_values({"K": 0.7, "d": 0.8})
    return fid.identify(start, runs(), output_bias=False, **options)


def test_declared_and_estimated_values_of_each_record() -> None:
    fit = fitted(record_parameters=["m", "a0"])
    assert_close(fit.parameters["K"].value, 1.0, rtol=1e-5, why="steps of 0.05 s, no noise")
    assert_close(fit.parameters["d"].value, 0.5, rtol=1e-4, why="steps of 0.05 s, no noise")
    own = [record.constants for record in fit.records]
    assert [each["m"].value for each in own] == list(MASS)
    assert {each["m"].status for each in own} == {"fixed"}
    assert_close([each["a0"].value for each in own], CONSTANT, atol=1e-4, why="no noise")
    assert own[0]["a0"].unit == "m/s^2"
    assert own[0]["a0"].stderr is not None
    assert_close(fit.model.parameters["a0"].value, np.mean(CONSTANT), atol=1e-4, why="the mean")
    assert set(fit.model.inputs) == {"force"}
    assert not fit.records[0].reference_shift.keys() & {"m", "a0"}


def test_verify_takes_the_value_of_the_record_it_judges() -> None:
    fit = fitted(record_parameters=["m", "a0"])
    heavy = runs()[2]
    told = fid.verify(fit, heavy, initial_state="measured")
    assert any(f.code == "verification-record-parameters" for f in told.findings)
    plain = fid.verify(fit.model, heavy, initial_state="measured")
    assert told.theil["v"] < 0.5 * plain.theil["v"]


def test_what_does_not_fit_is_refused() -> None:
    with pytest.raises(UnknownNameError, match="record_parameters names no parameter: found w"):
        fitted(record_parameters=["w"])
    mixed = [runs()[0], runs(declared=False)[1]]
    with pytest.raises(DataError, match="some records hold m and others do not"):
        fid.identify(cart(), mixed, record_parameters=["m"])
    moving = runs()[0]
    moving = moving.replace({"m": np.linspace(1.0, 2.0, 200)})
    with pytest.raises(DataError, match=r"does not stand still.*make it an input"):
        fid.identify(cart(), moving, record_parameters=["m"])
    trimmed = runs()[0].replace({}, trim={"force": 0.1})
    with pytest.raises(OptionError, match="declare none"):
        fid.identify(cart(), trimmed, record_parameters=["m"])
