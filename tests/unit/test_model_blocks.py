"""Actuators, sensors and filters in a model: their responses, names, units and refusals."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import signal

import flightid as fid
from flightid.errors import ModelError
from flightid.models import ModelBlock, StateSpaceModel
from flightid.models.language.blocks import KINDS
from tests.closeness import assert_close

OMEGA = np.geomspace(0.3, 300.0, 40)
S = 1j * OMEGA
SERVO = {"omega": 30.0, "zeta": 0.6}


def _yaw() -> StateSpaceModel:
    model = fid.load_model("quadrotor_yaw")
    assert isinstance(model, StateSpaceModel)
    return model


def _butterworth(order: int, omega: float) -> np.ndarray:
    above, below = signal.butter(order, omega, analog=True)
    return np.polyval(above, S) / np.polyval(below, S)


def _ardupilot_notch(centre: float, width: float, attenuation: float) -> np.ndarray:
    """ArduPilot's coefficients, in the limit of fast sampling."""
    octaves = np.log2(centre / (centre - width / 2.0)) * 2.0
    quality = np.sqrt(2.0**octaves) / (2.0**octaves - 1.0)
    depth, omega = 10.0 ** (-attenuation / 40.0), 2.0 * np.pi * centre
    return (S**2 + depth**2 * omega / quality * S + omega**2) / (
        S**2 + omega / quality * S + omega**2
    )


def _px4_notch(centre: float, width: float) -> np.ndarray:
    omega = 2.0 * np.pi * centre
    return (S**2 + omega**2) / (S**2 + 2.0 * np.pi * width * S + omega**2)


CASES = {
    "first_order_lag": ({"T": 0.1}, 1.0 / (0.1 * S + 1.0)),
    "second_order_lag": (SERVO, 900.0 / (S**2 + 36.0 * S + 900.0)),
    "lead_lag": ({"lead": 0.5, "lag": 0.02}, (0.5 * S + 1.0) / (0.02 * S + 1.0)),
    "washout": ({"T": 0.4}, 0.4 * S / (0.4 * S + 1.0)),
    "pade_delay": (
        {"delay": 0.05, "order": 2},
        np.polyval([1 / 12, -0.5, 1.0], 0.05 * S) / np.polyval([1 / 12, 0.5, 1.0], 0.05 * S),
    ),
    "delay": ({"delay": 0.03}, np.exp(-0.03 * S)),
    "butterworth": ({"omega": 25.0, "order": 5}, _butterworth(5, 25.0)),
    "ardupilot_low_pass": ({"cutoff_hz": 8.0}, _butterworth(2, 16.0 * np.pi)),
    "ardupilot_low_pass_first_order": ({"cutoff_hz": 8.0}, _butterworth(1, 16.0 * np.pi)),
    "ardupilot_notch": (
        {"centre_hz": 9.0, "bandwidth_hz": 4.0, "attenuation_db": 30.0},
        _ardupilot_notch(9.0, 4.0, 30.0),
    ),
    "px4_low_pass": ({"cutoff_hz": 8.0}, _butterworth(2, 16.0 * np.pi)),
    "px4_notch": ({"centre_hz": 9.0, "bandwidth_hz": 4.0}, _px4_notch(9.0, 4.0)),
    "transfer": (
        {"numerator": [2.0, 0.0, 9.0], "denominator": [0.5, 3.0, 4.0]},
        (2.0 * S**2 + 9.0) / (0.5 * S**2 + 3.0 * S + 4.0),
    ),
}


def test_every_kind_is_tested() -> None:
    assert set(CASES) == set(KINDS)


@pytest.mark.parametrize("kind", KINDS)
def test_a_block_multiplies_the_response(kind: str) -> None:
    values, expected = CASES[kind]
    bare = _yaw()
    plain = bare.frequency_response(OMEGA)
    at_input = bare.with_block("act", at="tau_psi", kind=kind, **values)
    assert_close(at_input.frequency_response(OMEGA), plain * expected, rtol=1e-9, why="product")
    if kind == "delay":
        with pytest.raises(ModelError, match="pure delay at an output"):
            bare.with_block("sensor", at="r", kind=kind, **values)
        return
    at_output = bare.with_block("sensor", at="r", kind=kind, **values)
    changed = plain.copy()
    changed[0] *= expected
    assert_close(at_output.frequency_response(OMEGA), changed, rtol=1e-9, why="one output alone")
    assert StateSpaceModel.from_dict(at_output.to_dict()) == at_output
    assert at_output.displayed().is_linear


@pytest.mark.parametrize("order", range(1, 11))
def test_butterworth_of_every_order(order: int) -> None:
    model = _yaw().with_block("f", at="r", kind="butterworth", omega=25.0, order=order)
    found = model.frequency_response(OMEGA)[0, 0] / _yaw().frequency_response(OMEGA)[0, 0]
    assert_close(found, _butterworth(order, 25.0), rtol=1e-8, why="SciPy's analog design")


def test_blocks_stand_one_behind_the_other_in_the_file() -> None:
    content = _yaw().to_dict() | {
        "blocks": {
            "late": {"at": "tau_psi", "kind": "delay", "delay": 0.01},
            "motor": {"at": "tau_psi", "kind": "first_order_lag", "T": "T_m", "note": "bench"},
            "limit": {"at": "tau_psi", "kind": "second_order_lag", **SERVO},
            "gyro": {"at": "r", "kind": "ardupilot_low_pass", "cutoff_hz": 20.0},
        },
    }
    content["parameters"] = {**_yaw().to_dict()["parameters"], "T_m": {"value": 0.05, "unit": "s"}}  # type: ignore[dict-item]
    model = StateSpaceModel.from_dict(content)
    assert list(model.states) == ["r", "psi", "motor_1", "limit_1", "limit_2", "gyro_1", "gyro_2"]
    plain = _yaw().frequency_response(OMEGA)
    chain = np.exp(-0.01 * S) / (0.05 * S + 1.0) * 900.0 / (S**2 + 36.0 * S + 900.0)
    expected = plain * chain
    expected[0] *= _butterworth(2, 40.0 * np.pi)
    assert_close(model.frequency_response(OMEGA), expected, rtol=1e-9, why="product")
    again = StateSpaceModel.from_dict(model.to_dict())
    assert again == model
    assert again.to_dict() == model.to_dict()
    assert model.parameters["limit_omega"].status == "fixed"
    assert model.parameters["T_m"].status == "free"
    assert "block motor at tau_psi: first_order_lag, T = T_m" in str(model)
    assert "gyro" in model.summary().to_text()
    assert r"\tau_{\psi}(t - \mathrm{late}_{\mathrm{delay}})" in model.latex()


def test_a_fit_finds_the_time_constant_of_an_actuator() -> None:
    model = _yaw().with_block("motor", at="tau_psi", kind="first_order_lag", T=0.05)
    free = model.with_free("motor_T")
    truth = free.with_values({"motor_T": 0.08, "Nr": -1.2})
    omega = np.geomspace(0.5, 60.0, 40)
    data = fid.FrequencyResponse.from_values(
        omega, truth.frequency_response(omega),
        inputs=list(model.inputs), outputs=list(model.outputs), units=model.units,
    )  # fmt: skip
    fit = fid.identify(free, data)
    assert_close(fit.parameters["motor_T"].value, 0.08, rtol=1e-6, why="no noise")
    assert StateSpaceModel.from_dict(truth.to_dict()) == truth


def test_simulation_sees_the_blocks() -> None:
    model = _yaw().with_block("motor", at="tau_psi", kind="first_order_lag", T=0.05)
    time_s = np.arange(100) * 0.01
    record = fid.Record.from_arrays(time_s, inputs={"tau_psi": np.full(100, 0.1)})
    found = fid.simulate(model, record, units=model.units)["r"]
    system = signal.TransferFunction([52.1082], np.polymul([0.05, 1.0], [1.0, 0.89142]))
    _, expected = signal.step(system, T=time_s)
    assert_close(found, 0.1 * expected, atol=1e-9, why="exact discretisation, SciPy's step")


def test_the_trim_of_an_actuator_is_its_steady_state() -> None:
    model = StateSpaceModel.from_dict(
        {
            "states": {"x": "m"},
            "inputs": {"u": "m"},
            "outputs": {"x": "x"},
            "parameters": {"k": {"value": 2.0, "unit": "1/(m*s)"}},
            "equations": {"x'": "k*u^2 - k*x^2"},
            "trim": {"u": 3.0, "x": 6.0},
            "blocks": {
                "gain": {
                    "at": "u",
                    "kind": "transfer",
                    "numerator": [8.0],
                    "denominator": [2, 4.0],
                },
                "lag": {"at": "u", "kind": "first_order_lag", "T": 0.1},
            },
        }
    )
    assert model.trim == {"u": 3.0, "x": 6.0, "gain_1": 0.75, "lag_1": 6.0}
    assert all(abs(value) < 1e-12 for value in model.residuals().values())
    moved = model.linearise({"lag_1": 1.0})
    assert StateSpaceModel.from_dict(moved.to_dict()).trim == moved.trim


@pytest.mark.parametrize(
    ("block", "message"),
    [
        ({"kind": "magic"}, "kind of block b is not known: found 'magic'; needed one of first"),
        ({"kind": "first_order_lag"}, "block b lacks T"),
        ({"kind": "first_order_lag", "T": 0.1, "K": 2}, "block b has an unknown key: found K"),
        ({"kind": "first_order_lag", "T": [1]}, "block b.T must be a number or a formula"),
        ({"kind": "first_order_lag", "T": float("nan")}, "block b.T is not finite"),
        ({"kind": "first_order_lag", "T": "Nr"}, r"equation \"Nr\*b_1'\" has different units"),
        ({"kind": "first_order_lag", "T": "speed"}, "names what is not defined"),
        ({"kind": "first_order_lag", "T": 0.1, "at": "z"}, "input nor output: found 'z'"),
        ({"kind": "butterworth", "omega": 1.0, "order": 11}, "must be a whole number"),
        ({"kind": "butterworth", "omega": 1.0, "order": True}, "must be a whole number"),
        ({"kind": "pade_delay", "delay": 1.0, "order": 6}, "order of a Padé delay: found 6"),
        ({"kind": "delay", "delay": "Nr"}, "delay of block b does not have its unit"),
        ({"kind": "delay", "delay": "speed"}, "block b names what is no parameter"),
        ({"kind": "transfer", "numerator": [1, 1], "denominator": [1]}, "more zeros than poles"),
        ({"kind": "transfer", "numerator": 1, "denominator": [1]}, "must be a list"),
        ({"kind": "transfer", "numerator": [1], "denominator": [1] * 20}, "must be a list"),
        ({"kind": "transfer", "numerator": ["Nr"], "denominator": ["Nr", "Nr^2", "Nr"]},
         "equation.*subtracts '1' and 's.2'"),
    ],
)  # fmt: skip
def test_wrong_blocks_are_refused(block: dict, message: str) -> None:
    content = _yaw().to_dict() | {"blocks": {"b": {"at": "tau_psi", **block}}}
    with pytest.raises(ModelError, match=message):
        StateSpaceModel.from_dict(content)


def test_blocks_that_are_no_blocks_are_refused() -> None:
    plain = _yaw().to_dict()
    with pytest.raises(ModelError, match="block b must be a table"):
        StateSpaceModel.from_dict(plain | {"blocks": {"b": 3}})
    with pytest.raises(ModelError, match="block b lacks 'at'"):
        StateSpaceModel.from_dict(plain | {"blocks": {"b": {"kind": "washout", "T": 1}}})
    with pytest.raises(ModelError, match="name of a block cannot stand in a formula"):
        ModelBlock("sin", "r", "washout", {"T": 1.0})
    with pytest.raises(ModelError, match="name 'r' is given twice"):
        _yaw().with_block("r", at="r", kind="washout", T=1.0)
    block = _yaw().with_block("b", at="r", kind="washout", T=1.0)
    with pytest.raises(ModelError, match="two of one name"):
        block.with_block("b", at="r", kind="washout", T=1.0)
