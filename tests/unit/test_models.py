"""Parameters, transfer-function models, their files and their library."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import flightid as fid
from flightid.errors import DataError, FileFormatError, ModelError, OptionError, UnknownNameError
from flightid.models.kinds import model_from_description
from tests.closeness import assert_close

P = fid.Parameter


def second_order(**changes: object) -> fid.TransferFunctionModel:
    response = {
        "output": "p",
        "input": "u",
        "gain": "K",
        "numerator": ("s + z",),
        "denominator": ("s^2 + 2*zeta*w*s + w^2", "T*s + 1"),
        "delay": "tau",
    } | changes
    parameters = fid.Parameters(
        [
            P("K", 3.0, "rad/s^2"),
            P("w", 5.0, "rad/s", minimum=0.1, maximum=50.0),
            P("zeta", 0.4, "1"),
            P("z", unit="1/s", tie="w/2"),
            P("T", 0.1, "s", free=False),
            P("tau", 0.02, "s", minimum=0.0),
        ]
    )
    return fid.TransferFunctionModel(
        (fid.TransferFunction(**response),),  # type: ignore[arg-type]
        parameters,
        units={"p": "rad/s"},
        name="test",
    )


def test_response_is_the_formula() -> None:
    omega = np.array([0.5, 5.0, 30.0])
    s = 1j * omega
    expected = 3 * (s + 2.5) / (s**2 + 4 * s + 25) / (0.1 * s + 1) * np.exp(-0.02 * s)
    assert_close(
        second_order().frequency_response(omega)[0, 0], expected, rtol=1e-14, why="same formula"
    )
    assert_close(
        second_order().frequency_response(omega, {"K": 6.0})[0, 0],
        2 * expected,
        rtol=1e-14,
        why="gain is linear",
    )


def test_poles_zeros_and_state_space_agree() -> None:
    model = second_order()
    poles = np.sort_complex(model.poles()["p/u"])
    assert_close(
        poles, np.sort_complex(np.roots(np.polymul([1, 4, 25], [0.1, 1]))), rtol=1e-12, why="roots"
    )
    assert_close(model.zeros()["p/u"], [-2.5], rtol=1e-14, why="tied zero w/2")
    a, b, c, d, delay = model.state_space()
    omega = np.geomspace(0.1, 100, 20)
    found = [
        (c @ np.linalg.solve(1j * w * np.eye(3) - a, b) + d)[0, 0] * np.exp(-1j * w * delay[0])
        for w in omega
    ]
    assert_close(
        found, model.frequency_response(omega)[0, 0], rtol=1e-10, why="two routes to H(jω)"
    )
    assert delay.tolist() == [0.02]


def test_state_space_simulates() -> None:
    # The step response of K/(T s + 1) after the delay is K (1 − e^(−t/T)).
    model = fid.load_model("rate_gain_lag").with_values({"K": 2.0, "T": 0.5, "tau": 0.03})
    time = np.arange(200) * 0.01
    step = fid.Record.from_arrays(time, inputs={"tau_phi": (time > 0.095).astype(float)})
    found = fid.simulate(model, step, hold="zero")["p"]
    expected = 2.0 * (1 - np.exp(-np.maximum(time - 0.1 - 0.03, 0.0) / 0.5))
    assert_close(found, expected, atol=1e-12, why="exact for a held step")


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"gain": "Q"}, "names an unknown parameter: found 'Q'"),
        ({"delay": "s"}, "names an unknown parameter: found 's'"),
        ({"delay": "T*T"}, "delay of response p/u does not have its unit"),
        ({"gain": "K*w"}, "response p/u does not have its unit"),
        ({"denominator": ("exp(s)",)}, "does not have its unit|may not stand inside"),
        ({"denominator": ("s +",)}, "found the end"),
    ],
)
def test_models_that_contradict_themselves(change: dict[str, object], words: str) -> None:
    with pytest.raises(ModelError, match=words):
        second_order(**change)


def test_factors_must_be_polynomials() -> None:
    with pytest.raises(ModelError, match=r"s may not stand inside a divisor, in \"1/\(s\*T\)\""):
        second_order(gain="K/w", denominator=("1/(s*T)",), numerator=())


def test_what_cannot_be_simulated() -> None:
    with pytest.raises(ModelError, match="more zeros than poles"):
        second_order(gain="K*T^3", numerator=("s", "s"), denominator=("T*s+1",)).state_space()
    with pytest.raises(ModelError, match="negative delay cannot be simulated"):
        second_order(delay="-tau").state_space()
    with pytest.raises(ModelError, match="a denominator is zero"):
        second_order(denominator=("0*s^2 + 0*w*s", "T*s + 1")).state_space()
    one, two = (
        fid.TransferFunction("p", "u", "a", delay="t1"),
        fid.TransferFunction("q", "u", "a", delay="t2"),
    )
    both = fid.TransferFunctionModel(
        (one, two), fid.Parameters([P("a", 1.0), P("t1", 0.1, "s"), P("t2", 0.2, "s")])
    )
    with pytest.raises(ModelError, match="responses to input u have different delays"):
        both.state_space()
    assert both.frequency_response([1.0]).shape == (2, 1, 1)


def test_odd_models_are_refused() -> None:
    empty = fid.Parameters([])
    with pytest.raises(ModelError, match="a model needs a response"):
        fid.TransferFunctionModel((), empty)
    one = fid.TransferFunction("p", "u", "2")
    with pytest.raises(ModelError, match="a response is given twice"):
        fid.TransferFunctionModel((one, one), empty)
    with pytest.raises(DataError, match="no finite response"):
        fid.load_model("rate_integrator").frequency_response([0.0])
    with pytest.raises(UnknownNameError, match="no such response"):
        second_order().response("q/u")
    assert second_order().response("p/u").gain == "K"


@pytest.mark.parametrize(
    ("parameters", "words"),
    [
        ([P("a", 1.0), P("a", 2.0)], "given twice"),
        ([P("a", tie="b")], "names an unknown parameter"),
        ([P("a", tie="b"), P("b", tie="a")], "form a circle"),
        ([P("a", 1.0, "s"), P("b", unit="1/s", tie="2*a")], "does not have its unit"),
        ([P("a", 1.0, "ft"), P("b", unit="m", tie="2*a")], "does not have its unit"),
    ],
)
def test_ties_that_cannot_be(parameters: list[fid.Parameter], words: str) -> None:
    with pytest.raises(ModelError, match=words):
        fid.Parameters(parameters)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ({"name": "2a", "value": 1.0}, "cannot stand in a formula"),
        ({"name": "sin", "value": 1.0}, "cannot stand in a formula"),
        ({"name": "s", "value": 1.0}, "cannot stand in a formula"),
        ({"name": "a"}, "has no value"),
        ({"name": "a", "value": float("nan")}, "has no value"),
        ({"name": "a", "value": 1.0, "minimum": 2.0, "maximum": 0.0}, "contradict each other"),
        ({"name": "a", "value": 1.0, "minimum": 2.0}, "lies outside its bounds"),
        ({"name": "a", "value": 1.0, "unit": "furlongz"}, "unit is not known"),
    ],
)
def test_parameters_that_cannot_be(arguments: dict[str, object], words: str) -> None:
    with pytest.raises(ValueError, match=words):
        fid.Parameter(**arguments)  # type: ignore[arg-type]


def test_parameters_are_changed_by_copy() -> None:
    model = second_order()
    assert model.parameters["z"].value == 2.5
    assert model.with_values({"w": 8.0}).parameters["z"].value == 4.0
    assert model.parameters["w"].value == 5.0
    with pytest.raises(ModelError, match="parameter z is tied"):
        model.with_values({"z": 1.0})
    with pytest.raises(UnknownNameError, match="no such parameter"):
        model.with_values({"nobody": 1.0})
    with pytest.raises(UnknownNameError, match="no such parameter"):
        model.parameters.with_parameter(P("nobody", 1.0))
    fixed = model.with_fixed(zeta=0.5, z=1.0)
    assert [p.name for p in fixed.parameters.free] == ["K", "w", "tau"]
    assert fixed.with_free("z").parameters["z"].status == "free"
    assert model.with_tie("T", "tau*5").parameters["T"].value == pytest.approx(0.1)
    assert "tie" in model.summary().to_text()
    assert "<table>" in model._repr_html_()
    assert "K" in model.parameters._repr_html_()


TEMPLATES = [name for name in fid.library_names() if name.startswith(("rate_", "attitude_"))]


@pytest.mark.parametrize("name", TEMPLATES)
@pytest.mark.parametrize("axis", ["roll", "pitch", "yaw"])
def test_every_template_loads_and_simulates(name: str, axis: str) -> None:
    model = fid.load_model(name, axis=axis)
    assert model.source
    assert all(parameter.note for parameter in model.parameters.values())
    assert "<" not in str(model.to_dict())
    assert np.all(np.isfinite(model.frequency_response([0.1, 1.0, 30.0])))
    model.state_space()
    again = model_from_description(
        {key: value for key, value in model.to_dict().items() if value != ""}
    )
    assert again.to_dict() == model.to_dict()
    assert fid.load_model(f"{name}_{axis}") == model


def test_files_are_read_as_data(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "model.toml"
    path.write_text(
        'kind="transfer"\n[inputs]\nu="1"\n[outputs]\ny="m"\n[parameters]\nK={value=2,unit="m"}\n'
        "L={unit='m'}\n[constraints]\nL='2*K'\n[responses.'y/u']\ngain='L'\n"
    )
    model = fid.load_model(path)
    assert model.frequency_response([1.0])[0, 0, 0] == 4.0
    with pytest.raises(OptionError, match="written for one vehicle"):
        fid.load_model(str(path), axis="roll")
    path.write_bytes(b"\xff\xfe")
    with pytest.raises(FileFormatError, match="is no TOML in UTF-8"):
        fid.load_model(path)
    path.write_text("[" * 5000)
    with pytest.raises(FileFormatError, match="is no TOML"):
        fid.load_model(path)
    path.write_bytes(b"#" * ((1 << 20) + 1))
    with pytest.raises(FileFormatError, match="longer than such a file can be"):
        fid.load_model(path)
    with pytest.raises(UnknownNameError, match="no such library model"):
        fid.load_model("no_such_model")
    # Whatever lies there from the folder that tests run in: nothing lies there from this one.
    monkeypatch.chdir(tmp_path)
    with pytest.raises(UnknownNameError, match="no such library model"):
        fid.load_model("../../etc/passwd")
    with pytest.raises(OptionError, match="not written for that axis"):
        fid.load_model("rate_first_order", axis="heave")
    with pytest.raises(FileNotFoundError):
        fid.load_model(tmp_path / "absent.toml")


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"kind": "magic"}, "kind of model is not known"),
        ({"extra": 1}, "the model has an unknown key"),
        ({"parameters": {}}, r"no table \[parameters\]"),
        ({"parameters": {"K": {"value": "2"}}}, "must be a number"),
        ({"parameters": {"K": {"value": 10**400}}}, "is too large"),
        ({"parameters": {"K": {"value": 1.0, "fixed": "yes"}}}, "must be true or false"),
        ({"parameters": {"K": {"value": 1.0, "colour": 2}}}, "unknown key"),
        ({"parameters": {f"K{i}": 1.0 for i in range(1001)}}, "is too long"),
        ({"constraints": {"L": "2"}}, "a constraint names no parameter"),
        ({"responses": {"y/u": 3}}, "must be a table"),
        ({"responses": {"y": {}}}, "is not 'output/input'"),
        ({"responses": {"y/u": {"numerator": "s"}}}, "must be a list of factors"),
        ({"responses": {"y/u": {"gain": True}}}, "must be a text"),
    ],
)
def test_descriptions_are_checked(change: dict[str, object], words: str) -> None:
    content = {
        "inputs": {"u": "1"},
        "outputs": {"y": "1"},
        "parameters": {"K": 2.0},
        "responses": {"y/u": {"gain": "K"}},
    } | change
    with pytest.raises(ModelError, match=words):
        model_from_description(content)
