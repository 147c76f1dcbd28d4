"""FMUs checked against the standard's schemas and flown by FMPy beside `simulate`."""

from __future__ import annotations

import ctypes
import zipfile
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import flightid as fid
from flightid.errors import ExportError, OptionError
from flightid.export import c_compiler
from flightid.export import fmu as fmu_module
from flightid.export.fmu_description import base_unit
from tests.closeness import assert_close
from tests.compiled_model import needs_compiler
from tests.unit.test_export import EVIL

fmpy = pytest.importorskip("fmpy")
validation = pytest.importorskip("fmpy.validation")
STEP_S = 0.02
SYSTEM = fid.LinearSystem(
    [[-1.0, 3.0], [-4.0, -0.5]], [[1.0, 0.0], [0.0, 2.0]], [[1.0, 0.0], [0.0, 1.0]],
    np.zeros((2, 2)), ("u", "v"), ("p", "q"), units={"p": "rad/s"},
)  # fmt: skip
DELAYED = fid.LinearSystem(SYSTEM.a, SYSTEM.b, SYSTEM.c, SYSTEM.d, ("u", "v"), ("p", "q"),
                           [0.033, 0.1])  # fmt: skip


def flown(path: Path, model, kind: str, n: int = 100, **options: object):
    """Outputs of the FMU and the record that drove it."""
    time_s = np.arange(n) * STEP_S
    trim = {} if getattr(model, "is_linear", True) else model.trim
    inputs = {
        name: trim.get(name, 0.0) + 0.05 * np.sin(2.0 * time_s + k) + 0.02 * k
        for k, name in enumerate(model.inputs)
    }
    signals = np.array(
        list(zip(time_s, *inputs.values(), strict=True)),
        dtype=[("time", float), *((name, float) for name in inputs)],
    )
    found = fmpy.simulate_fmu(
        str(path), fmi_type=kind, stop_time=time_s[-1], output_interval=STEP_S, step_size=STEP_S,
        input=signals, relative_tolerance=1e-9, **options,
    )  # fmt: skip
    return found[:n], fid.Record.from_arrays(time_s, inputs=inputs)


def exchanged(path: Path, folder: Path, record: fid.Record, names):
    """Outputs of model exchange under a solver of ours; FMPy's own holds inputs over its steps."""
    description = fmpy.read_model_description(str(path))
    references = {each.name: each.valueReference for each in description.modelVariables}
    unit = fmpy.fmi3.FMU3Model(
        guid=description.guid,
        unzipDirectory=fmpy.extract(str(path), unzipdir=str(folder)),
        modelIdentifier=description.modelExchange.modelIdentifier,
        instanceName="one",
    )
    unit.instantiate()
    unit.enterInitializationMode()
    unit.exitInitializationMode()
    unit.enterContinuousTimeMode()
    n = description.numberOfContinuousStates
    driven = [references[name] for name in record.inputs]
    inputs, time_s = record.matrix(record.inputs), record.time_s
    buffer = (ctypes.c_double * n)()

    def rates(t: float, x: np.ndarray) -> np.ndarray:
        unit.setTime(t)
        buffer[:] = x
        unit.setContinuousStates(buffer, n)
        unit.setFloat64(driven, [float(np.interp(t, time_s, row)) for row in inputs])
        unit.getContinuousStateDerivatives(buffer, n)
        return np.array(buffer)

    unit.getContinuousStates(buffer, n)
    x, rows = np.array(buffer), []
    for k, t in enumerate(time_s):
        rates(t, x)
        rows.append(unit.getFloat64([references[name] for name in names]))
        if k + 1 < len(time_s):
            span = (t, time_s[k + 1])
            x = solve_ivp(rates, span, x, method="DOP853", rtol=1e-10, atol=1e-12).y[:, -1]
    unit.terminate()
    unit.freeInstance()
    return dict(zip(names, np.array(rows).T, strict=True))


def compare(found, wanted: fid.Record, names, tolerance: float, why: str) -> None:
    for name in names:
        scale = np.abs(wanted[name]).max()
        assert scale > 1e-4
        assert_close(found[name] / scale, wanted[name] / scale, atol=tolerance, why=why)


@pytest.fixture(autouse=True)
def quickly(plane: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Compile all but the first as quickly as may be; that one as users get it."""
    quick = ("-O0" if each == "-O2" else each for each in c_compiler._FLAGS)
    monkeypatch.setattr(c_compiler, "_FLAGS", tuple(quick))


@pytest.fixture(scope="module")
def plane(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("plane")
    return fid.export(SYSTEM, folder / "plane.fmu", sample_time_s=STEP_S).files[0]


@needs_compiler
def test_a_linear_system_flies_as_simulate_does(plane: Path, tmp_path: Path) -> None:
    assert validation.validate_fmu(str(plane)) == []
    found, record = flown(plane, SYSTEM, "CoSimulation", n=50)
    wanted = fid.simulate(SYSTEM, record, hold="zero")
    compare(found, wanted, ("p", "q"), 1e-6, "Runge-Kutta steps")
    found = exchanged(plane, tmp_path / "unzipped", record, ("p", "q"))
    wanted = fid.simulate(SYSTEM, record, hold="first")
    compare(found, wanted, ("p", "q"), 1e-9, "the solver's tolerance")


@needs_compiler
def test_fmpys_solver_flies_a_step(plane: Path) -> None:
    found = fmpy.simulate_fmu(
        str(plane), fmi_type="ModelExchange", stop_time=2.0, output_interval=STEP_S,
        relative_tolerance=1e-9, start_values={"u": 1.0, "v": -0.5},
    )  # fmt: skip
    time_s = np.arange(len(found)) * STEP_S
    inputs = {"u": np.ones(len(time_s)), "v": np.full(len(time_s), -0.5)}
    wanted = fid.simulate(SYSTEM, fid.Record.from_arrays(time_s, inputs=inputs))
    compare(found, wanted, ("p", "q"), 1e-6, "the solver's tolerance")


@needs_compiler
def test_delays_are_in_co_simulation(tmp_path: Path) -> None:
    made = fid.export(DELAYED, tmp_path / "late.fmu", sample_time_s=STEP_S)
    assert made.facts["interfaces"] == "co-simulation"
    assert [each.code for each in made.findings] == ["no-model-exchange"]
    found, record = flown(made.files[0], DELAYED, "CoSimulation")
    wanted = fid.simulate(DELAYED, record, hold="zero")
    compare(found, wanted, ("p", "q"), 2e-5, "a jump inside a step keeps its area and moment")


@needs_compiler
def test_pade_makes_model_exchange_possible(tmp_path: Path) -> None:
    made = fid.export(DELAYED, tmp_path / "pade.fmu", sample_time_s=STEP_S, pade_order=2)
    _, record = flown(made.files[0], DELAYED, "CoSimulation")
    found = exchanged(made.files[0], tmp_path / "unzipped", record, ("p", "q"))
    wanted = fid.simulate(DELAYED.with_pade(2), record, hold="first")
    compare(found, wanted, ("p", "q"), 1e-9, "the solver's tolerance")


@needs_compiler
def test_nonlinear_equations_and_their_units(tmp_path: Path) -> None:
    model = fid.load_model("quadrotor_6dof").with_fixed(tau_d=0.0)
    made = fid.export(model, tmp_path / "quad.fmu", sample_time_s=STEP_S)
    assert validation.validate_fmu(str(made.files[0])) == []
    names = [name for name in ("p", "q", "r", "phi", "theta") if name in model.outputs]
    found, record = flown(made.files[0], model, "CoSimulation")
    wanted = fid.simulate(model, record, hold="zero", substeps=20)
    compare(found, wanted, names, 1e-6, "Runge-Kutta steps")
    found = exchanged(made.files[0], tmp_path / "unzipped", record, names)
    wanted = fid.simulate(model, record, hold="first", substeps=20)
    compare(found, wanted, names, 1e-8, "Runge-Kutta steps of ours")
    description = fmpy.read_model_description(str(made.files[0]))
    variables = {each.name: each for each in description.modelVariables}
    assert variables["p"].unit == "rad/s"
    tuned = [each for each in variables.values() if each.causality == "parameter"]
    assert len(tuned) == len(model.parameters.independent)
    assert {each.variability for each in tuned} == {"tunable"}


@needs_compiler
def test_parameters_are_tuned_from_outside(tmp_path: Path) -> None:
    model = fid.load_model("short_period")
    other = model.with_values({"Mq": -3.5})
    made = fid.export(model, tmp_path / "sp.fmu", sample_time_s=STEP_S)
    found, record = flown(made.files[0], model, "CoSimulation", start_values={"Mq": -3.5})
    wanted = fid.simulate(other, record, hold="zero")
    compare(found, wanted, ("alpha", "q"), 1e-5, "Runge-Kutta steps")
    before = fid.simulate(model, record, hold="zero")
    assert np.abs(before["q"] - wanted["q"]).max() > 0.05 * np.abs(wanted["q"]).max()


@needs_compiler
def test_a_discrete_model_keeps_its_samples(tmp_path: Path) -> None:
    system = SYSTEM.sampled(STEP_S)
    made = fid.export(system, tmp_path / "sampled.fmu")
    found, record = flown(made.files[0], system, "CoSimulation")
    wanted = fid.simulate(SYSTEM, record, hold="zero")
    compare(found, wanted, ("p", "q"), 1e-12, "exact samples")
    with pytest.raises(ExportError, match="model exchange knows states"):
        fid.export(system, tmp_path / "bad.fmu", interfaces=("model-exchange",))


@needs_compiler
def test_a_state_is_saved_and_brought_back(plane: Path, tmp_path: Path) -> None:
    description = fmpy.read_model_description(str(plane))
    folder = fmpy.extract(str(plane), unzipdir=str(tmp_path / "unzipped"))
    references = {each.name: each.valueReference for each in description.modelVariables}
    unit = fmpy.fmi3.FMU3Slave(
        guid=description.guid, unzipDirectory=folder, modelIdentifier="plane", instanceName="one"
    )
    unit.instantiate()
    unit.enterInitializationMode()
    unit.exitInitializationMode()
    unit.setFloat64([references["u"]], [1.0])
    unit.doStep(0.0, STEP_S)
    kept = unit.getFMUState()
    unit.doStep(STEP_S, STEP_S)
    later = unit.getFloat64([references["p"]])
    unit.setFMUState(kept)
    unit.doStep(STEP_S, STEP_S)
    assert unit.getFloat64([references["p"]]) == later
    with pytest.raises(Exception, match=r"[dD]oStep"):
        unit.doStep(2 * STEP_S, 0.3 * STEP_S)
    unit.freeFMUState(kept)
    unit.terminate()
    unit.freeInstance()


@needs_compiler
def test_malicious_names_stay_names(tmp_path: Path) -> None:
    names = [*EVIL, "<a/>", "&amp;", "]]>", "\x00", "time"]
    n = len(names)
    system = fid.LinearSystem(
        -np.eye(n), np.eye(n), np.eye(n), np.zeros((n, n)), tuple(names),
        tuple(f"y{each}" for each in names), states=tuple(f"x{each}" for each in names),
        sample_time_s=0.1, units={names[0]: '"<&'},
    )  # fmt: skip
    made = fid.export(system, tmp_path / "evil.fmu", name='<evil> */ "')
    description = fmpy.read_model_description(str(made.files[0]))
    shown = [each.name for each in description.modelVariables]
    assert {'"); system("id"); ("', "<a/>", "&amp;", "]]>"} <= set(shown)
    assert len(set(shown)) == len(shown)
    with zipfile.ZipFile(made.files[0]) as archive:
        assert all(".." not in name and not name.startswith("/") for name in archive.namelist())


def test_sources_alone_are_said_to_be_so(tmp_path: Path) -> None:
    made = fid.export(SYSTEM, tmp_path / "plane.fmu", sample_time_s=STEP_S, compile=False)
    with zipfile.ZipFile(made.files[0]) as archive:
        names = archive.namelist()
    assert not [name for name in names if name.startswith("binaries")]
    assert "sources/plane_fmi3.c" in names
    assert [each.code for each in made.findings] == ["sources-alone"]
    twice = fid.export(SYSTEM, tmp_path / "again.fmu", name="plane", sample_time_s=STEP_S,
                       compile=False)  # fmt: skip
    assert twice.files[0].read_bytes() == made.files[0].read_bytes()


def test_what_an_fmu_cannot_be(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    path = tmp_path / "plane.fmu"
    with pytest.raises(OptionError, match=r"a file in \.fmu"):
        fid.export(SYSTEM, tmp_path / "plane.zip", "fmu", sample_time_s=STEP_S)
    with pytest.raises(OptionError, match="needs the time of one step"):
        fid.export(SYSTEM, path)
    with pytest.raises(OptionError, match="interfaces holds a word that is not known"):
        fid.export(SYSTEM, path, sample_time_s=STEP_S, interfaces=("scheduled",))
    with pytest.raises(ExportError, match="its inputs are delayed"):
        fid.export(DELAYED, path, sample_time_s=STEP_S, interfaces=("model-exchange",))
    with pytest.raises(ExportError, match="delays of a nonlinear model"):
        fid.export(fid.load_model("quadrotor_6dof"), path, sample_time_s=STEP_S, pade_order=2)
    monkeypatch.setattr(fmu_module, "c_compiler", lambda: None)
    with pytest.raises(ExportError, match="no C compiler for the FMU's binary"):
        fid.export(SYSTEM, path, sample_time_s=STEP_S)
    assert not list(tmp_path.iterdir())


def test_units_in_base_units() -> None:
    assert base_unit("ft/s^2") == {"m": "1", "s": "-2", "factor": "0.3048"}
    assert base_unit("N*m") == {"kg": "1", "m": "2", "s": "-2"}
    assert base_unit("nonsense!") is None
