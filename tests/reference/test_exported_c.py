"""Exported C against `simulate`, sample by sample, for every kind of model."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import flightid as fid
from flightid.errors import OptionError
from flightid.models.narx.terms import KERNELS
from tests.closeness import assert_close
from tests.compiled_model import CompiledModel, needs_compiler
from tests.narx_records import quadratic

pytestmark = needs_compiler
STEP_S = 0.0125
ROUNDING = 1e-12


def random_record(model: object, n: int = 300, size: float = 0.05, step_s: float = STEP_S):
    generator = np.random.default_rng(4)
    trim = {} if getattr(model, "is_linear", True) else model.trim
    names = list(model.inputs)
    walk = size * np.cumsum(generator.standard_normal((len(names), n)), axis=1)
    inputs = {name: walk[i] + trim.get(name, 0.0) for i, name in enumerate(names)}
    return fid.Record.from_arrays(np.arange(n) * step_s, inputs=inputs)


def compare(model, folder: Path, hold: str, record=None, **options: object) -> None:
    record = random_record(model) if record is None else record
    options.setdefault("sample_time_s", record.sample_time_s)
    made = fid.export(model, folder / "model.c", hold=hold, **options)
    compiled = CompiledModel(made.files[0], made.facts["prefix"], len(model.outputs))
    found = compiled.run(record.matrix(model.inputs))
    kept = {"substeps": options["substeps"]} if "substeps" in options else {}
    wanted = fid.simulate(model, record, hold=hold, **kept).matrix(model.outputs)
    assert np.ptp(wanted) > 1e-3
    scale = np.abs(wanted).max(axis=1, keepdims=True)
    assert_close(found / scale, wanted / scale, atol=ROUNDING, why="order of sums only")


@pytest.mark.parametrize("hold", ["zero", "first"])
@pytest.mark.parametrize("name", ["rate_second_order", "short_period", "r50_hover"])
def test_linear_models_are_exact(name: str, hold: str, tmp_path: Path) -> None:
    compare(fid.load_model(name), tmp_path, hold)


@pytest.mark.parametrize("hold", ["zero", "first"])
@pytest.mark.parametrize("delay_s", [0.0, 0.004, STEP_S, 0.0333, 0.2])
def test_any_delay_is_exact(delay_s: float, hold: str, tmp_path: Path) -> None:
    a = [[-1.0, 3.0], [-4.0, -0.5]]
    system = fid.LinearSystem(
        a, [[1.0, 0.2], [0.0, 2.0]], [[1.0, 0.0]], [[0.3, 0.0]], ("u", "v"), ("y",),
        [delay_s, 0.7 * delay_s],
    )  # fmt: skip
    compare(system, tmp_path, hold)


@pytest.mark.parametrize("hold", ["zero", "first"])
@pytest.mark.parametrize("name", ["quadrotor_6dof", "fixed_wing_longitudinal_coefficients"])
def test_nonlinear_equations_take_the_same_steps(name: str, hold: str, tmp_path: Path) -> None:
    model = fid.load_model(name)
    assert not model.is_linear
    compare(model, tmp_path, hold, substeps=3)


@pytest.mark.parametrize("kernel", [None, *KERNELS])
def test_narx_models_are_the_sum_of_their_terms(kernel: str | None, tmp_path: Path) -> None:
    flown = quadratic(300, noise=0.05)
    degree = 2 if kernel is None else 1
    structure = fid.NarxStructure(
        ("u",), "y", 2, 3, kernel=kernel, width=4.0, degree=degree, maximum_terms=8
    )
    model = fid.identify(structure, flown).model
    loud = flown.replace({"u": 7.0 + 3.0 * (flown["u"] - 7.0)})
    compare(model, tmp_path, "zero", loud)
    with pytest.raises(OptionError, match="sample time of its own"):
        fid.export(model, tmp_path / "other.c", sample_time_s=0.1)


EVERY_FORM = {
    "states": {"x": "1", "v": "1/s"},
    "inputs": {"u": "1", "w": "1"},
    "outputs": {
        "x": "x",
        "a": {"expression": "v' + lift(x, u)", "unit": "1/s^2"},
        "z": {"expression": "where(u > 0, sin(x)^2, x^3) + min(x, u) - max(w, 0.1)",
              "unit": "1"},
        "f": {"expression": "clip(u, -0.2, 0.2) + deadband(x, 0.01) + sign(w) + abs(w)^1.5",
              "unit": "1"},
        "g": {"expression": "atan2(x, 1 + u^2) + tanh(w) - log(2 + x^2)*sqrt(1 + u^2)",
              "unit": "1"},
    },
    "parameters": {
        "m": {"value": 1.7, "unit": "1"},
        "k": {"value": 3.0, "unit": "1/s^2"},
        "c": {"value": 0.4, "unit": "1/s"},
        "tau": {"value": 0.031, "unit": "s"},
        "rate": {"value": 1.0, "unit": "1/s^2"},
    },
    "equations": {
        "x'": "v",
        "(m + 0.3*cos(x))*v' + 0.2*x'*c": "-k*x - c*v + rate*(u + drag(w)) + exp(-x^2)*rate*w",
    },
    "delays": {"u": "tau", "w": "2*tau/3"},
    "tables": {
        "drag": {
            "axes": [{"points": [-1.0, -0.1, 0.2, 1.0], "unit": "1"}],
            "values": [-2.0, -0.1, 0.3, 1.0], "unit": "1",
            "interpolation": "pchip", "outside": "linear",
        },
        "lift": {
            "axes": [{"points": [-1.0, 0.0, 0.5], "unit": "1"},
                     {"points": [-0.3, 0.0, 0.1, 0.4], "unit": "1"}],
            "values": [[1.0, 2.0, 2.5, 1.0], [0.0, 0.3, 0.2, 0.1], [2.0, 1.0, 0.0, 0.5]],
            "unit": "1/s^2", "interpolation": "cubic", "outside": "hold",
        },
    },
}  # fmt: skip


@pytest.mark.parametrize("hold", ["zero", "first"])
def test_moving_factors_tables_choices_and_delays(hold: str, tmp_path: Path) -> None:
    model = fid.StateSpaceModel.from_dict(EVERY_FORM)
    record = random_record(model, size=0.03)
    compare(model, tmp_path, hold, record, substeps=2)


@pytest.mark.parametrize("interpolation", ["linear", "pchip", "cubic"])
@pytest.mark.parametrize("outside", ["hold", "linear"])
def test_tables_of_each_kind(interpolation: str, outside: str, tmp_path: Path) -> None:
    table = {**EVERY_FORM["tables"]["lift"], "interpolation": interpolation, "outside": outside}
    tables = {**EVERY_FORM["tables"], "lift": table}
    model = fid.StateSpaceModel.from_dict({**EVERY_FORM, "tables": tables})
    compare(model, tmp_path, "zero", random_record(model, n=120, size=0.1))


def test_a_value_outside_a_refusing_table_is_no_value(tmp_path: Path) -> None:
    table = {**EVERY_FORM["tables"]["lift"], "outside": "refuse"}
    tables = {**EVERY_FORM["tables"], "lift": table}
    model = fid.StateSpaceModel.from_dict({**EVERY_FORM, "tables": tables})
    made = fid.export(model, tmp_path / "m.c", sample_time_s=STEP_S)
    compiled = CompiledModel(made.files[0], "m", len(model.outputs))
    assert compiled.step(np.array([5.0, 0.0]))[0] == 1


def test_discrete_models_are_taken_as_they_are(tmp_path: Path) -> None:
    model = fid.PolynomialModel(("u",), "y", STEP_S, a=[1, -1.5, 0.7], b=[[1.0, 0.5]], nk=(3,))
    system = model.linear_system()
    record = random_record(system)
    made = fid.export(model, tmp_path / "arx.c")
    found = CompiledModel(made.files[0], "arx", 1).run(record.matrix(["u"]))[0]
    u, y = record["u"], np.zeros(record.n_samples)
    # Before the record the input had the value of its first sample, the state was zero.
    for t in range(record.n_samples):
        past = [y[t - k] if t >= k else 0.0 for k in (1, 2)]
        late = [u[t - k] if t >= k else 0.0 for k in (3, 4)]
        y[t] = 1.5 * past[0] - 0.7 * past[1] + late[0] + 0.5 * late[1]
    assert_close(found, y, rtol=1e-12, why="the difference equation itself")


def test_a_discrete_system_with_a_delay(tmp_path: Path) -> None:
    system = fid.LinearSystem(
        [[0.9]], [[1.0, 0.5]], [[1.0]], [[0.0, 2.0]], ("u", "v"), ("y",), [0.04, 0.0],
        sample_time_s=0.02,
    )  # fmt: skip
    record = random_record(system, step_s=0.02)
    made = fid.export(system, tmp_path / "late.c")
    found = CompiledModel(made.files[0], "late", 1).run(record.matrix(["u", "v"]))[0]
    u, v, x, y = record["u"], record["v"], 0.0, []
    for t in range(record.n_samples):
        y.append(x + 2.0 * v[t])
        x = 0.9 * x + u[max(t - 2, 0)] + 0.5 * v[t]
    assert_close(found, np.array(y), rtol=1e-12, why="the recursion itself")


def test_parameters_can_be_tuned(tmp_path: Path) -> None:
    model = fid.load_model("short_period")
    record = random_record(model)
    other = model.with_values({"Mq": -3.5})
    made = fid.export(model, tmp_path / "sp.c", sample_time_s=STEP_S, tunable=True, substeps=8)
    text = made.files[1].read_text()
    offset = text.index("sp_p_Mq")
    place = text[text.index("enum {\n    sp_p_") : offset].count(",")
    compiled = CompiledModel(made.files[0], "sp", len(model.outputs))
    n, m, depth = len(model.states), len(model.inputs), _depth(text)
    doubles = np.frombuffer(compiled.memory, dtype=np.float64)
    doubles[n + m * depth + place] = -3.5
    assert compiled._call("prepare", compiled.memory) == 0
    found = compiled.run(record.matrix(model.inputs))
    wanted = fid.simulate(other, record, hold="zero").matrix(model.outputs)
    scale = np.abs(wanted).max()
    assert_close(found / scale, wanted / scale, atol=1e-8, why="eight Runge-Kutta steps a sample")


def _depth(header: str) -> int:
    line = next(each for each in header.splitlines() if "_HISTORY" in each)
    return int(line.split()[-1])


def test_output_does_not_move_the_model(tmp_path: Path) -> None:
    model = fid.load_model("short_period")
    made = fid.export(model, tmp_path / "sp.c", sample_time_s=STEP_S)
    compiled = CompiledModel(made.files[0], "sp", len(model.outputs))
    rng = np.random.default_rng(0)
    for u in rng.standard_normal((5, 1)):
        peeked = [compiled.step(u, "output")[1] for _ in range(2)]
        stepped = compiled.step(u)[1]
        assert np.array_equal(peeked[0], stepped)
        assert np.array_equal(peeked[1], stepped)
