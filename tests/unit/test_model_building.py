"""Models built in Python, from SymPy, written to files and trimmed."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import sympy

import flightid as fid
from flightid import _native
from flightid.errors import FitError, ModelError, UnknownNameError
from flightid.models import StateSpaceModel
from flightid.models.language.sympy_input import sympy_formula, sympy_sides
from flightid.models.save import model_as_toml
from tests.closeness import assert_close

T = sympy.Symbol("t")


def _pendulum() -> fid.ModelBuilder:
    m, length, g, c = sympy.symbols("m l g c")
    theta, q, u = (sympy.Function(name)(T) for name in ("theta", "q", "u"))
    return (
        fid.ModelBuilder("pendulum", source="a textbook", note="swings")
        .state(theta, "rad")
        .state("q", "rad/s")
        .input(u, "N*m", delay="tau")
        .parameter(m, 2.0, "kg", min=0.1, max=9.0, note="mass")
        .parameter("l", 0.5, "m")
        .parameter(c, tie=m * sympy.Symbol("c0"), unit="N*m*s")
        .parameter("c0", 0.1, "N*m*s/kg")
        .parameter("tau", 0.02, "s", fixed=True)
        .constant("g", 9.81, "m/s^2", note="gravity")
        .define("stiffness", m * g * length, "N*m")
        .equation(sympy.Eq(theta.diff(T), q))
        .equation(
            m * length**2 * q.diff(T), -sympy.Symbol("stiffness") * sympy.sin(theta) - c * q + u
        )
        .output("theta")
        .output("far", sympy.Piecewise((theta, theta > sympy.Rational(1, 2)), (0, True)), "rad")
        .trim(theta=0.3)
        .initial("q", 0.0, min=-1.0, max=1.0)
        .bias("theta", free=True)
        .block("sensor", at="theta", kind="butterworth", omega=60.0, order=3)
    )


def test_sympy_and_text_build_the_same_model() -> None:
    model = _pendulum().build()
    text = (
        fid.ModelBuilder("pendulum")
        .state("theta", "rad")
        .state("q", "rad/s")
        .input("u", "N*m")
        .parameter("m", 2.0, "kg")
        .parameter("l", 0.5, "m")
        .parameter("c", 0.2, "N*m*s")
        .constant("g", 9.81, "m/s^2")
        .equation("theta'", "q")
        .equation("m*l^2*q'", "-m*g*l*sin(theta) - c*q + u")
        .output("theta")
        .build()
    )
    at = {"theta": 0.3, "q": 0.1}
    ours, peers = model.matrices(at=at), text.matrices(at=at)
    assert_close(ours.f[:2, :2], peers.f, rtol=1e-14, why="same equations")
    assert_close(ours.m[:2, :2], peers.m, rtol=1e-14, why="same equations")
    assert model.parameters["c"].tie == "(c0*m)"
    assert model.delays == {"u": "tau"}
    assert repr(fid.ModelBuilder("x").state("a")) == "ModelBuilder('x': 1 states)"
    assert repr(fid.ModelBuilder("x")) == "ModelBuilder('x': empty)"


@pytest.mark.parametrize(
    ("expression", "values"),
    [
        ("x**2 + y/3", {"x": 1.3, "y": 0.4}),
        ("sqrt(x)*exp(-y) + pi", {"x": 1.3, "y": 0.4}),
        ("Abs(x - y) + Min(x, y, 1) + Max(x, y, 2)", {"x": 1.3, "y": 0.4}),
        ("Piecewise((x, x < y), (2*y, And(x < 3, Not(y > 1))), (7, True))", {"x": 1.3, "y": 0.4}),
        ("Piecewise((x, Or(x <= 1, y >= 9)), (y, True)) + E*1.25e-3", {"x": 1.3, "y": 0.4}),
        ("atan2(x, y) + log(x)*sign(y) - tanh(x)**Rational(3, 2)", {"x": 1.3, "y": 0.4}),
    ],
)
def test_a_sympy_expression_keeps_its_value(expression: str, values: dict) -> None:
    item = sympy.sympify(expression)
    text = sympy_formula(item)
    found = _native.Tape([text], list(values), {}).evaluate(np.array(list(values.values())))
    assert_close(found[0], float(item.subs(values)), rtol=1e-13, why="SymPy's own value")


@pytest.mark.parametrize(
    "item",
    [
        sympy.I,
        sympy.oo,
        sympy.gamma(sympy.Symbol("x")),
        sympy.Piecewise((1, sympy.Symbol("x") < 1)),
        sympy.Function("x")(T).diff(T, 2),
        sympy.Integral(sympy.Symbol("x"), sympy.Symbol("x")),
        sympy.Matrix([[1]]),
    ],
    ids=str,
)
def test_what_has_no_place_in_a_formula_is_refused(item: object) -> None:
    with pytest.raises(ModelError, match="what has no place in a formula"):
        sympy_formula(item)


def test_deep_and_wrong_sympy_is_refused() -> None:
    deep = sympy.Symbol("x")
    for _ in range(80):
        deep = sympy.Add(sympy.sin(deep, evaluate=False), 1, evaluate=False)
    with pytest.raises(ModelError, match="nested too deep"):
        sympy_formula(deep)
    with pytest.raises(ModelError, match="neither two sides nor a SymPy Eq"):
        sympy_sides("p' = q")
    with pytest.raises(ModelError, match="neither two sides nor a SymPy Eq"):
        fid.ModelBuilder("x").equation(sympy.Symbol("p"))
    with pytest.raises(ModelError, match="states holds 'x' already"):
        fid.ModelBuilder("x").state("x").state(sympy.Symbol("x"))


def test_a_sympy_table_is_called() -> None:
    lift = sympy.Function("CL")(sympy.Symbol("alpha"))
    assert sympy_formula(2 * lift) == "((2)*CL(alpha))"
    built = (
        fid.ModelBuilder("table")
        .state("alpha", "rad")
        .input("u", "1/s")
        .equation("alpha'", sympy.Symbol("u") * lift)
        .output("alpha")
        .table("CL", {"axes": [{"points": [0, 1], "unit": "rad"}], "values": [1, 2],
                      "outside": "hold"})
        .trim(alpha=0.5, u=2.0)
        .build()
    )  # fmt: skip
    assert_close(built.matrices().f, [[2.0]], rtol=1e-14, why="slope of the table times u")


@pytest.mark.parametrize("name", fid.library_names())
def test_a_written_model_comes_back(name: str, tmp_path: Path) -> None:
    model = fid.load_model(name)
    assert fid.load_model(fid.write_model(model, tmp_path / "model.toml")) == model


def test_everything_in_a_model_is_written(tmp_path: Path) -> None:
    model = _pendulum().build()
    odd = StateSpaceModel.from_dict(model.to_dict() | {"note": 'a "quoted"\\ \x7f\n\ttext: ü'})
    again = fid.load_model(fid.write_model(odd, tmp_path / "odd.toml"))
    assert again == odd
    assert "[blocks]" in model_as_toml(model)
    with pytest.raises(ModelError, match="a model is written as TOML"):
        fid.write_model(model, tmp_path / "model.json")
    assert [path.name for path in tmp_path.iterdir()] == ["odd.toml"]


def _aeroplane() -> StateSpaceModel:
    model = fid.load_model("fixed_wing_longitudinal_coefficients")
    assert isinstance(model, StateSpaceModel)
    return model


def test_level_flight_is_found() -> None:
    level = _aeroplane().trimmed(
        ["alpha", "theta", "elevator", "thrust"], at={"V": 40.0}, require=["theta - alpha"]
    )
    assert max(map(abs, level.residuals().values())) < 1e-7
    trim = level.trim
    assert trim["theta"] == trim["alpha"]
    lift = 0.5 * 1.225 * 1600.0 * 17.094 * (
        0.41 + 4.44 * trim["alpha"] + 0.355 * trim["elevator"]
    ) + trim["thrust"] * np.sin(trim["alpha"])
    assert_close(lift, 1247.4 * 9.80665, rtol=1e-9, why="lift carries the weight")
    climb = level.trimmed(
        ["alpha", "theta", "elevator", "thrust"], require=["theta - alpha - 0.05"]
    )
    assert climb.trim["thrust"] > level.trim["thrust"]


def test_the_states_alone_are_solved_for_by_default() -> None:
    pendulum = _pendulum().build()
    settled = pendulum.trimmed(at={"u": 2.0})
    assert_close(np.sin(settled.trim["theta"]), 2.0 / 9.81, rtol=1e-10, why="closed form")
    assert settled.trim["sensor_1"] == pytest.approx(settled.trim["theta"])
    yaw = fid.load_model("quadrotor_yaw").linearise({"psi": 0.7})
    assert yaw.trimmed().trim == {"psi": 0.7}, "a heading stays where it is"


def test_trims_that_do_not_exist_are_refused() -> None:
    pendulum = _pendulum().build()
    with pytest.raises(FitError, match=r"no equilibrium of pendulum was found: found .*left with"):
        pendulum.trimmed(at={"u": 20.0})
    with pytest.raises(UnknownNameError, match="a trim names what is neither"):
        pendulum.trimmed(["height"])
    with pytest.raises(FitError, match="is not determined: found 3 independent equations"):
        _aeroplane().trimmed(["alpha", "theta", "elevator", "thrust"])
    with pytest.raises(FitError, match="equations without a value at the start"):
        _aeroplane().trimmed(at={"V": 0.0})
    with pytest.raises(ModelError, match="not defined here"):
        pendulum.trimmed(require=["height"])
