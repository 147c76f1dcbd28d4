"""Tables, choices and auxiliary quantities in formulas: values, derivatives, units, refusals."""

from __future__ import annotations

import copy

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import integrate, interpolate

import flightid as fid
from flightid.errors import DataError, ModelError
from flightid.models import RecordValue, StateSpaceModel, TableAxis, TableFunction
from flightid.models.language.symbolic import Printer
from tests.closeness import assert_close
from tests.examples import examples

X = (-0.4, -0.1, 0.0, 0.3, 0.5, 0.9)
Y = (0.1, 0.2, 0.5, 0.7)


def _values(*axes: tuple[float, ...]) -> np.ndarray:
    grids = np.meshgrid(*axes, indexing="ij")
    return np.sin(3.0 * grids[0]) + sum((g**2 for g in grids[1:]), start=np.zeros(1))


def _table(interpolation: str, *axes: tuple[float, ...], outside: str = "hold") -> TableFunction:
    listed = tuple(TableAxis(points) for points in axes)
    values = tuple(_values(*axes).ravel())
    return TableFunction(listed, values, "1", interpolation, outside)


@given(st.lists(st.floats(-0.4, 0.9), min_size=1, max_size=8))
@examples(40)
def test_one_axis_is_scipys(places: list[float]) -> None:
    peers = {
        "linear": interpolate.make_interp_spline(X, _values(X), k=1),
        "pchip": interpolate.PchipInterpolator(X, _values(X)),
        "cubic": interpolate.CubicSpline(X, _values(X)),
    }
    for kind, peer in peers.items():
        found = _table(kind, X)(places)
        assert_close(found, peer(places), rtol=1e-11, atol=1e-13, why="same interpolation")


def test_two_axes_are_scipys() -> None:
    x, y = np.meshgrid(np.linspace(-0.4, 0.9, 23), np.linspace(0.1, 0.7, 17), indexing="ij")
    spline = interpolate.RectBivariateSpline(X, Y, _values(X, Y), s=0.0)
    found = _table("cubic", X, Y)(x, y)
    assert_close(found, spline.ev(x, y), atol=1e-12, why="the tensor spline is unique")
    peer = interpolate.RegularGridInterpolator((X, Y), _values(X, Y))
    found = _table("linear", X, Y)(x, y)
    assert_close(found, peer(np.stack([x, y], axis=-1)), atol=1e-13, why="bilinear")


def test_outside_is_what_was_asked_for() -> None:
    assert _table("pchip", X)(2.0) == _values(X)[-1]
    assert np.isnan(_table("pchip", X, outside="refuse")(0.901))
    line = _table("cubic", X, outside="linear")
    slope = interpolate.CubicSpline(X, _values(X))(0.9, 1)
    assert_close(line(1.9), _values(X)[-1] + slope, rtol=1e-12, why="tangent at the edge")


WING = {
    "states": {"alpha": "rad", "V": "m/s"},
    "inputs": {"T": "N"},
    "outputs": {"lift": {"expression": "qbar*S*CL(alpha, V/a)", "unit": "N"}, "V": "V"},
    "parameters": {
        "m": {"value": 5.0, "unit": "kg"},
        "S": {"value": 0.6, "unit": "m^2"},
        "tau": {"value": 0.4, "unit": "s"},
        "k": {"value": 1.3, "unit": "1"},
    },
    "constants": {
        "rho": {"value": 1.2, "unit": "kg/m^3"},
        "a": {"value": 340.0, "unit": "m/s"},
    },
    "definitions": {
        "qbar": {"expression": "0.5*rho*V^2", "unit": "Pa"},
        "drag": {"expression": "qbar*S*k*clip(CL(alpha, V/a)^2, 0, 1)", "unit": "N"},
    },
    "tables": {
        "CL": {
            "axes": [{"points": list(X), "unit": "rad"}, {"points": [0.0, 0.1, 0.3]}],
            "values": _values(X, (0.0, 0.1, 0.3)).tolist(),
            "interpolation": "cubic",
            "outside": "refuse",
            "note": "tunnel",
        },
    },
    "equations": {"tau*alpha'": "-alpha", "m*V'": "where(T > 0*T, T, k*T) - drag"},
    "trim": {"alpha": 0.1, "V": 30.0, "T": 2.0},
    "initial": {"alpha": {"value": 0.1, "min": -0.2, "max": 0.4}, "V": 30.0},
    "biases": {"V": {"value": 0.0, "min": -1.0, "max": 1.0}},
}


def _wing(**changes: object) -> StateSpaceModel:
    content = copy.deepcopy(WING)
    for key, value in changes.items():
        content[key] = {**content.get(key, {}), **value}  # type: ignore[dict-item]
    return StateSpaceModel.from_dict(content)


def test_derivatives_pass_through_tables_choices_and_definitions() -> None:
    model, h = _wing(), 1e-5
    names = model.point_names
    matrices = model.matrices()
    base = dict(model.trim)
    for k, name in enumerate(model.states):
        at = [base | {name: base[name] + step} for step in (h, -h)]
        up, down = (np.array(list(model.residuals(at=point).values())) for point in at)
        assert_close(
            -matrices.f[:, k], (up - down) / (2 * h), rtol=1e-8, atol=1e-7, why="second order in h"
        )
    assert names[0] == "alpha'"
    second = model.matrix_second_derivatives()
    up, down = (model.matrix_derivatives({"S": 0.6 + step})["k"].f for step in (h, -h))
    assert_close(second["S", "k"].f, (up - down) / (2 * h), atol=1e-8, why="second order in h")
    assert ("m", "m") not in second
    assert not model.is_linear


def test_second_derivatives_match_differences_of_the_first() -> None:
    pendulum = _wing(delays={"T": "tau^3/tau^2*k^2"}, trim={"T": -2.0})
    second, h = pendulum.matrix_second_derivatives(), 1e-5
    free = [parameter.name for parameter in pendulum.parameters.free]
    for k, later in enumerate(free):
        start = pendulum.parameters[later].value or 0.0
        up, down = (pendulum.matrix_derivatives({later: start + step}) for step in (h, -h))
        for earlier in free[: k + 1]:
            for part, (plus, minus) in enumerate(zip(up[earlier], down[earlier], strict=True)):
                exact = second.get((earlier, later))
                ours = exact[part] if exact is not None else np.zeros_like(plus)
                assert_close(ours, (plus - minus) / (2 * h), atol=1e-6, why="second order in h")
    assert second["k", "k"].delays_s[0] == pytest.approx(0.8)


def test_the_file_comes_back() -> None:
    model = _wing()
    assert StateSpaceModel.from_dict(model.to_dict()) == model
    assert model.initial["alpha"] == RecordValue(0.1, -0.2, 0.4)
    assert model.initial["V"] == RecordValue(30.0, free=False)
    assert model.biases["V"].free
    assert "qbar = 0.5*rho*V^2 [Pa]" in str(model)
    assert "TableFunction(18 values in 1, cubic" in repr(model.tables["CL"])


def test_the_display_shows_choices_tables_and_definitions() -> None:
    shown = _wing().latex()
    assert r"\begin{cases}" in shown
    assert r"\partial_{1} \mathrm{CL}" in shown
    assert r"\mathrm{qbar} = 0.5 \rho V^{2}" in shown
    printer = Printer(["x"], tables=["CL_a"])
    assert printer.value("CL_a(x) + min(x, 2)").latex == (
        r"\mathrm{CL\_a}\left(x\right) + \min\left(x, 2\right)"
    )
    (slope,) = printer.derivatives("where(x <= 1, 3*x, 3*x + y)")
    assert slope.latex == "3"


def test_a_table_that_refuses_stops_the_evaluation() -> None:
    with pytest.raises(DataError, match="not finite"):
        _wing().matrices(at={"alpha": 1.5})


def _bad_table(**changes: object) -> dict[str, object]:
    return {"tables": {"CL": {**WING["tables"]["CL"], **changes}}}  # type: ignore[index]


AXES = WING["tables"]["CL"]["axes"]  # type: ignore[index]


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        (_bad_table(axes=[AXES[0]]), "CL.values must be a number"),
        (_bad_table(axes=[AXES[0], {"points": [0, 0, 1]}]), "breakpoints that rise"),
        (_bad_table(axes=[AXES[0], {"points": [0, 1]}]), "needed 12"),
        (_bad_table(axes=[AXES[0], {"points": 3}]), "points of table CL must be a list"),
        (_bad_table(axes=[AXES[0], {"unit": "1"}]), "an axis of table CL needs points"),
        (_bad_table(axes=[AXES[0], {"points": [0, 1], "n": 1}]), "axis of table CL has an unknown"),
        (_bad_table(axes=[]), "table CL needs one or two axes"),
        (_bad_table(values=[[1, 2], [3]]), "rows of table CL.values differ in length"),
        (_bad_table(values=[[float("nan")] * 3] * 6), "contradicts itself.*not finite"),
        (_bad_table(interpolation="nearest"), "a table has an unknown word: found 'nearest'"),
        (_bad_table(outside="extrapolate"), "found 'extrapolate'; needed hold"),
        (_bad_table(size=3), "table CL has an unknown key"),
        ({"tables": {"CL": {"values": [1, 2]}}}, "table CL lacks 'axes'"),
        ({"tables": {"CL": 3}}, "table CL must be a table"),
        ({"tables": {"min": WING["tables"]["CL"]}}, "name of a table cannot stand"),
        ({"tables": {"V": WING["tables"]["CL"]}}, "name 'V' is given twice"),
        ({"equations": {"m*V'": "CL(V, V/a)*T"}}, "calls table CL with 'm/s'"),
        ({"equations": {"m*V'": "CL(alpha)*T"}}, "with 1 values for 2 axes"),
        ({"equations": {"m*V'": "CM(alpha)*T"}}, "not a function known here"),
        ({"equations": {"m*V'": "where(V, T, T)"}}, "asks whether 'm/s' holds"),
        ({"equations": {"m*V'": "where(alpha < V, T, T)"}}, "compares '1' and 'm/s'"),
        ({"equations": {"m*V'": "where(alpha < 0, T, V)"}}, "chooses between 'kg"),
        ({"equations": {"m*V'": "clip(T, 0, V)"}}, "compares"),
        ({"equations": {"m*V'": "clip(T, 0)"}}, "clip does not take 2"),
        ({"definitions": {"x": "V"}}, "definition x has no unit"),
        ({"definitions": {"x": {"expression": "V", "unit": "m"}}}, "definition x does not have"),
        ({"definitions": {"x": {"expression": "y", "unit": "m"}}}, "definition x names what"),
        ({"definitions": {"qbar": {"expression": "drag/S", "unit": "Pa"}}}, "circle"),
        ({"definitions": {"m": {"expression": "V", "unit": "m/s"}}}, "name 'm' is given twice"),
        ({"initial": {"z": 1.0}}, "initial. names what is not there: found 'z'"),
        ({"biases": {"alpha": 1.0}}, "biases. names what is not there: found 'alpha'"),
        ({"biases": {"V": {"free": 1}}}, "biases.V.free must be true or false"),
        ({"biases": {"V": {"value": 2.0, "max": 1.0}}}, "number of each record lies outside"),
        ({"biases": {"V": {"size": 1}}}, "biases.V has an unknown key"),
    ],
)  # fmt: skip
def test_wrong_models_are_refused(changes: dict, message: str) -> None:
    with pytest.raises(ModelError, match=message):
        _wing(**changes)


def test_a_simulation_takes_tables_and_choices() -> None:
    """Against an independent integrator of the same right side."""
    model = StateSpaceModel.from_dict(
        {
            "states": {"x": "1", "v": "1/s"},
            "inputs": {"f": "1/s^2"},
            "outputs": {"x": "x", "a": {"expression": "v'", "unit": "1/s^2"}},
            "parameters": {"k": {"value": 3, "unit": "1/s^2"}, "c": {"value": 0.5, "unit": "1/s"}},
            "definitions": {"spring": {"expression": "k*soft(x)", "unit": "1/s^2"}},
            "tables": {"soft": {"axes": [{"points": [-1, 0, 0.5, 2]}], "values": [-0.5, 0, 0.6, 1],
                                "interpolation": "cubic", "outside": "linear"}},
            "equations": {"x'": "v", "v'": "f - spring - where(v > 0, c, 2*c)*v"},
        }
    )  # fmt: skip
    time_s = np.arange(400) * 0.01
    force = 2.0 * np.sin(3.0 * time_s)
    record = fid.Record.from_arrays(time_s, inputs={"f": force}, units={"f": "1/s^2"})
    found = fid.simulate(model, record, units=model.units, hold="first", substeps=4)
    table = model.tables["soft"]

    def rates(t: float, state: np.ndarray) -> list[float]:
        damping = 0.5 if state[1] > 0 else 1.0
        drive = float(np.interp(t, time_s, force))
        return [state[1], drive - 3.0 * float(table(state[0])) - damping * state[1]]

    peer = integrate.solve_ivp(
        rates, (0.0, time_s[-1]), [0.0, 0.0], t_eval=time_s, rtol=1e-9, atol=1e-11, max_step=0.01
    )
    assert np.ptp(found["x"]) > 0.5
    assert_close(found["x"], peer.y[0], atol=3e-6, why="Runge-Kutta across the corner at v = 0")
