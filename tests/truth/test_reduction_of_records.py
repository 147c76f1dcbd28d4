"""Reduction of fits to records, by every method that fits a state-space model to them."""

from __future__ import annotations

import numpy as np
import pytest

import flightid as fid
from tests.roll_and_yaw import REAL, lateral

STEP_S = 0.02
NOISE = {"p": 0.02, "r": 0.01}
METHODS = (
    "output_error",
    *(
        pytest.param(method, marks=pytest.mark.nightly)
        for method in ("equation_error", "fourier_regression")
    ),
    "filter_error",
)


def flight(seed: int) -> fid.Record:
    """Square waves on both controls, held over whole samples; white noise on both rates."""
    time_s = np.arange(800) * STEP_S
    waves = np.sign(np.sin(2.0 * np.pi * time_s / np.array([[2.3], [3.7]]) + 0.1))
    ramps = np.cumsum(0.05 * waves, axis=1) * np.exp(-time_s / 40.0)
    inputs = dict(zip(("a", "d"), ramps - ramps.mean(axis=1, keepdims=True), strict=True))
    model = lateral()
    units = {name: model.units[name] for name in ("a", "d", "p", "r")}
    driven = fid.Record.from_arrays(time_s, inputs=inputs, units={"a": "1", "d": "1"})
    flown = fid.simulate(model, driven, units=units)
    random = np.random.default_rng(seed)
    return flown.replace(
        {name: flown[name] + s * random.standard_normal(len(time_s)) for name, s in NOISE.items()}
    )


@pytest.mark.parametrize("method", METHODS)
def test_what_is_not_there_goes_whatever_the_method(method: str) -> None:
    records = [flight(seed) for seed in (1, 2)]
    units = {"a": "1", "d": "1"}
    model = fid.StateSpaceModel(
        states={"p": "rad/s", "r": "rad/s"},
        input_units=units,
        measurements={name: fid.Output(name, "rad/s") for name in ("p", "r")},
        equations={"p'": "Lp*p + Lr*r + La*a + Ld*d", "r'": "Np*p + Nr*r + Na*a + Nd*d"},
        parameters=fid.Parameters(
            [
                fid.Parameter(name, value, lateral().parameters[name].unit)
                for name, value in {**REAL, "Ld": 0.4}.items()
            ]
        ),
        name="roll and yaw",
    )
    fit = fid.identify(model, records, method=method)
    found = fid.reduce(fit, records)
    assert list(found.dropped) == ["Ld"]
    assert found.path[0].reason.startswith("insensitivity")
    assert found.fit.provenance["method"] == fit.provenance["method"]
    assert found.fit.provenance["options"] == fit.provenance["options"]
    for name, value in REAL.items():
        estimate = found.fit.parameters[name]
        assert estimate.stderr is not None
        assert abs(estimate.value - value) < 4.0 * estimate.stderr, name
    assert len(found.summary().rows) == 1 + len(found.path)
