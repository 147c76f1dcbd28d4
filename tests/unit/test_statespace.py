"""State-space models as data: what is read, refused, shown and computed."""

from __future__ import annotations

import copy

import numpy as np
import pytest
import sympy
from hypothesis import given
from hypothesis import strategies as st

import flightid as fid
from flightid.dimensions import require_balance
from flightid.errors import DataError, FitError, ModelError, SingularError, UnknownNameError
from flightid.models.language import symbolic
from flightid.models.state_space.model import StateSpaceModel
from tests.closeness import assert_close
from tests.examples import examples

PENDULUM = {
    "kind": "state-space",
    "name": "pendulum on a cart's lag",
    "states": {"theta": "rad", "q": "rad/s", "f": "N"},
    "inputs": {"u": "1"},
    "outputs": {
        "theta": "theta",
        "az": {"expression": "l*q' + g*sin(theta)", "unit": "m/s^2"},
        "through": {"expression": "q + K*u/(m*l)*tau", "unit": "rad/s"},
    },
    "parameters": {
        "m": {"value": 2.0, "unit": "kg"},
        "l": {"value": 0.5, "min": 0.1, "max": 2.0, "unit": "m"},
        "c": {"value": 0.3, "unit": "N*m*s"},
        "K": {"value": 4.0, "unit": "N"},
        "tau": {"value": 0.1, "unit": "s"},
        "late": {"unit": "s"},
    },
    "constants": {"g": {"value": 9.81, "unit": "m/s^2"}},
    "constraints": {"late": "tau/2"},
    "equations": {
        "theta'": "q",
        "m*l^2*q' + c*theta'": "-m*g*l*sin(theta) + f*l",
        "tau*f'": "K*u - f",
    },
    "delays": {"u": "late"},
}


def _changed(**tables: object) -> dict[str, object]:
    content = copy.deepcopy(PENDULUM)
    for key, value in tables.items():
        old = content.get(key)
        content[key] = {**old, **value} if isinstance(old, dict) and value else value
    return content


def _model(**tables: object) -> StateSpaceModel:
    return StateSpaceModel.from_dict(_changed(**tables))


def test_matrices_are_those_of_the_equations() -> None:
    found = _model().matrices()
    assert_close(found.m, [[1, 0, 0], [0.3, 0.5, 0], [0, 0, 0.1]], rtol=1e-15, why="exact")
    assert_close(found.f, [[0, 1, 0], [-9.81, 0, 0.5], [0, 0, -1]], rtol=1e-15, why="exact")
    assert_close(found.g, [[0], [0], [4]], rtol=1e-15, why="exact")
    assert_close(found.h0, [[1, 0, 0], [9.81, 0, 0], [0, 1, 0]], rtol=1e-15, why="exact")
    assert_close(found.h1, [[0, 0, 0], [0, 0.5, 0], [0, 0, 0]], rtol=1e-15, why="exact")
    assert_close(found.d, [[0], [0], [0.4]], rtol=1e-15, why="exact")
    assert_close(found.delays_s, [0.05], rtol=1e-15, why="through the tie")


def test_linearisation_at_another_point() -> None:
    model, hanging = _model(), {"theta": 2.0}
    moved = model.linearise(hanging)
    expected = -9.81 * np.cos(2.0)
    assert_close(model.matrices(at=hanging).f[1, 0], expected, rtol=1e-15, why="exact")
    assert_close(moved.matrices().f[1, 0], expected, rtol=1e-15, why="exact")
    assert not model.is_linear
    assert fid.load_model("r50_cruise").is_linear
    assert_close(model.residuals(at=hanging)["m*l^2*q' + c*theta'"], 9.81 * np.sin(2.0),
                 rtol=1e-14, why="no trim there")  # fmt: skip
    with pytest.raises(UnknownNameError, match="point of linearisation has an unknown name"):
        model.linearise({"height": 1.0})


@given(st.floats(0.2, 2.0), st.floats(-1.0, 1.0))
@examples(25)
def test_derivatives_match_central_differences(length: float, theta: float) -> None:
    model, at = _model(), {"theta": theta, "q'": 0.3, "u": 0.5}
    values = {"l": length}
    exact = model.matrix_derivatives(values, at)
    for parameter in model.parameters.free:
        start = {"m": 2.0, "c": 0.3, "K": 4.0, "tau": 0.1, "l": length}[parameter.name]
        h = 1e-5 * start
        up = model.matrices({**values, parameter.name: start + h}, at)
        down = model.matrices({**values, parameter.name: start - h}, at)
        for ours, plus, minus in zip(exact[parameter.name], up, down, strict=True):
            assert_close(ours, (plus - minus) / (2 * h), atol=1e-6, why="second order in h")


def test_response_follows_the_matrices() -> None:
    model = _model()
    a, b, c, d, delays = model.state_space()
    omega = np.array([0.5, 3.0, 20.0])
    expected = [
        (c @ np.linalg.solve(1j * w * np.eye(3) - a, b) + d) * np.exp(-1j * w * delays)
        for w in omega
    ]
    found = model.frequency_response(omega)
    assert_close(found, np.moveaxis(expected, 0, -1), rtol=1e-12, why="same algebra")
    chosen = model.with_responses("az/u")
    assert chosen.response_names == ("az/u",)
    assert_close(chosen.frequency_response(omega), found, rtol=1e-15, why="all pairs still")


def test_a_pole_on_the_axis_is_refused() -> None:
    with pytest.raises(DataError, match="no finite response at these frequencies"):
        fid.load_model("quadrotor_yaw").frequency_response([0.0])


def test_simulation_and_verification_take_it() -> None:
    model = fid.load_model("quadrotor_yaw")
    time_s = np.arange(200) * 0.01
    record = fid.Record.from_arrays(time_s, inputs={"tau_psi": np.full(200, 0.1)})
    simulated = fid.simulate(model, record, units=model.units)
    rate = 0.1 * 52.1082 / 0.89142 * (1.0 - np.exp(-0.89142 * time_s))
    assert_close(simulated["r"], rate, atol=1e-11, why="exact discretisation")
    assert fid.verify(model, simulated, outputs=["r"]).to_dict()["schema"]


@pytest.mark.parametrize(
    "name", ["r50_hover", "r50_cruise", "quadrotor_roll_pitch", "short_period"]
)
def test_plain_values_make_the_same_model_again(name: str) -> None:
    model = fid.load_model(name)
    again = StateSpaceModel.from_dict(model.to_dict())
    assert again.to_dict() == model.to_dict()
    assert again == model
    assert model.source


@pytest.mark.parametrize(
    ("tables", "message"),
    [
        ({"equations": {"theta'": "q*q"}}, r"equation \"theta'\" has different units on its sides"
         r".*'1/s' = '1/s\^2'"),
        ({"equations": {"theta'": "q + f"}}, r"equation \"theta'\".*adds '1/s' and 'kg\*m/s\^2'"),
        ({"states": {"theta": "deg"}}, r"equation \"theta'\" has different.*'deg/s' = '1/s'"),
        ({"equations": {"theta'": "sin(q)"}}, r"takes sin of '1/s'"),
        ({"equations": {"theta'": "q^theta"}}, r"raises '1/s' to a power that is not"),
        ({"equations": {"theta'": "2^q"}}, r"has an exponent in '1/s'"),
        ({"outputs": {"az": {"expression": "q'", "unit": "m/s^2"}}},
         r"output az does not have its unit.*'1/s\^2'; needed 'm/s\^2'"),
        ({"outputs": {"az": "q*q"}}, "output az has no unit"),
        ({"delays": {"u": "l"}}, "delay of input u does not have its unit.*'m'; needed 's'"),
        ({"delays": {"u": "q"}}, "delay of input u names what is not defined"),
        ({"delays": {"w": "tau"}}, "a delay has no input: found w"),
        ({"equations": {"theta'": "q +"}}, r"equation \"theta'\" is outside the grammar"),
        ({"equations": {"theta'": "q.__class__"}}, r"equation \"theta'\" is outside the grammar"),
        ({"equations": {"theta'": "(" * 100}}, r"outside the grammar.*deeper"),
        ({"equations": {"theta'": "speed"}}, r"equation \"theta'\" names what is not defined"),
        ({"equations": {"0": "q"}}, "one equation for each state: found 4 equations"),
        ({"states": {"sin": "1"}}, "name of one of the states cannot stand in a formula"),
        ({"inputs": {"q": "1"}}, "name 'q' is given twice: found among the states and the inputs"),
        ({"outputs": {"u": "q"}}, "an output cannot have this name"),
        ({"trim": {"theta": float("nan")}}, "trim value of theta is not finite"),
        ({"trim": {"x": 1.0}}, "point of linearisation has an unknown name"),
        ({"responses": ["q/u"]}, "name of a response is not 'output/input'"),
        ({"responses": ["az/u", "az/u"]}, "a response is given twice"),
        ({"responses": "az/u"}, "responses must be a list"),
        ({"constraints": {"nothing": "tau"}}, "a constraint names no parameter"),
        ({"constants": {"g": {"value": 9.81, "min": 0.0}}}, "constant g has an unknown key"),
        ({"physics": {}}, "the model has an unknown key"),
        ({"inputs": {f"u{k}": "1" for k in range(200)}}, "number of inputs"),
        ({"equations": {}}, "no table .equations."),
    ],
)  # fmt: skip
def test_what_contradicts_itself_is_refused(tables: dict, message: str) -> None:
    with pytest.raises((ModelError, UnknownNameError), match=message):
        _model(**tables)


def test_a_state_without_equation_is_named() -> None:
    equations = dict(PENDULUM["equations"])
    equations["tau*theta' + 0*f"] = equations.pop("tau*f'").replace("K*u - f", "tau*q")
    with pytest.raises(ModelError, match="no equation gives the derivative of state f"):
        StateSpaceModel.from_dict({**PENDULUM, "equations": equations})


def test_equations_that_repeat_each_other_cannot_be_simulated() -> None:
    model = _model()
    with pytest.raises(SingularError, match="do not give every state derivative"):
        model.state_space({"tau": 0.0})


def test_sums_on_the_left_and_sympy_objects() -> None:
    rate, angle, damping = sympy.symbols("p phi Lp")
    content = {
        "states": {"phi": "rad", "p": "rad/s"},
        "inputs": {"u": "rad/s^2"},
        "outputs": {"p": rate},
        "parameters": {"Lp": {"value": -2.0, "unit": "1/s"}},
        "equations": {
            sympy.Symbol("phi'"): rate,
            "p'": damping * rate + sympy.Abs(sympy.cos(angle)) * sympy.Symbol("u"),
        },
    }
    model = StateSpaceModel.from_dict(content)
    assert_close(model.matrices().f, [[0, 1], [0, -2]], rtol=1e-15, why="exact")


def test_display() -> None:
    model = _model()
    shown = model.displayed()
    assert [term.latex for term in shown.m[1]] == ["c", r"m l^{2}", "0"]
    assert shown.f[1][0].latex == r"-m g l \cos\left(\theta\right)"
    assert shown.g[2][0].latex == "K"
    assert r"\dot{q}" in model.latex()
    assert "$$" in model._repr_html_()
    assert "output az" in model.summary().to_text()
    assert str(model).startswith("theta' = q")
    assert repr(model).endswith("3 states, 1 input, 3 outputs, 7 parameters, 5 free)")


FUNCTIONS = ["sin", "cos", "tan", "asin", "acos", "atan", "sinh", "cosh", "tanh", "exp", "log"]
FUNCTIONS += ["sqrt", "abs", "sign"]


@pytest.mark.parametrize("name", FUNCTIONS)
def test_every_function_is_shown(name: str) -> None:
    (term,) = symbolic.derivatives(f"2*{name}(x*a)", ["x"])
    assert term.names <= {"x", "a"}
    assert symbolic.derivatives("atan2(x, a) + min(x, a) + max(a, x) + x^a", ["x", "a"])


def test_a_derivative_too_long_is_refused() -> None:
    with pytest.raises(ModelError, match="too long to be shown"):
        symbolic.derivatives("*".join(["sin(x*abcdefgh)"] * 200), ["x"])


@given(st.text("xv()+-*/^' 0123.usin", max_size=60))
@examples(150)
def test_any_equation_is_taken_or_refused_in_order(text: str) -> None:
    content = {
        "states": {"x": "1", "v": "1/s"},
        "inputs": {"u": "1"},
        "outputs": {"x": "x"},
        "parameters": {},
        "equations": {"x'": "v", "v'": text},
    }
    try:
        model = StateSpaceModel.from_dict(content)
    except ModelError:
        return
    assert model.displayed() is not None


def test_fit_refuses_a_pair_without_path() -> None:
    model = fid.load_model("r50_cruise").with_responses("phi/ped")
    truth = model.frequency_response(np.geomspace(1.0, 30.0, 50))
    data = fid.FrequencyResponse.from_values(
        np.geomspace(1.0, 30.0, 50), np.ones_like(truth), inputs=list(model.inputs),
        outputs=list(model.outputs), units=model.units,
    )  # fmt: skip
    broken = model.with_fixed(Yped=0.0, Nped=0.0)
    with pytest.raises(FitError, match="no response of phi/ped"):
        fid.identify(broken, data)


def test_outputs_that_no_fitted_response_needs_may_be_missing() -> None:
    model = fid.load_model("ah64_hover").with_responses("az/col")
    omega = np.geomspace(0.2, 20.0, 40)
    az = model.frequency_response(omega)[[model.outputs.index("az")]]
    data = fid.FrequencyResponse.from_values(
        omega, az, inputs=list(model.inputs), outputs=["az"], units=model.units
    )
    others = [p.name for p in model.parameters.free if p.name not in ("Zw", "Zcol")]
    start = model.with_fixed(**{name: model.parameters[name].value for name in others})
    fit = fid.identify(start.with_values({"Zw": -0.3, "Zcol": -4.0}), data)
    assert_close(fit.parameters["Zw"].value, -0.122571, rtol=1e-6, why="without noise")


@pytest.mark.parametrize(
    ("inertia", "moment", "same"),
    [
        ("slug*ft^2", "ft*lbf", True),
        ("kg*m^2", "N*m", True),
        ("slug*ft^2", "N*m", False),
        ("kg*m^2", "ft*lbf", False),
    ],
)
def test_named_units_balance_by_their_base_units(inertia: str, moment: str, same: bool) -> None:
    units = {"I": inertia, "M": moment, "q'": "rad/s^2"}
    if same:
        require_balance("I*q'", "M", units, subject="equation of q")
        require_balance("sin(I*q'/M)", "1", units, subject="a sine")
    else:
        with pytest.raises(ModelError, match="different units on its sides"):
            require_balance("I*q'", "M", units, subject="equation of q")
