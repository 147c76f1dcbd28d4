"""Linear systems and responses to python-control, SciPy and files, and back."""

from __future__ import annotations

import json
import tomllib
from pathlib import Path

import control
import numpy as np
import pytest
import scipy.io
import scipy.signal
from hypothesis import given
from hypothesis import strategies as st

import flightid as fid
from flightid.errors import ExportError, FileFormatError, ModelError
from flightid.models.kinds import model_from_description
from flightid.models.linear.system_files import MAXIMUM_BYTES
from flightid.models.save import model_as_toml
from tests.closeness import assert_close
from tests.examples import examples


def made_system(delays=(0.0, 0.0), sample_time_s=None, n: int = 2) -> fid.LinearSystem:
    rng = np.random.default_rng(3)
    return fid.LinearSystem(
        rng.standard_normal((n, n)) - 2 * np.eye(n),
        rng.standard_normal((n, 2)),
        rng.standard_normal((3, n)),
        rng.standard_normal((3, 2)),
        ("lat", "lon"),
        ("p", "q", "r"),
        delays,
        tuple(f"s{k}" for k in range(n)),
        sample_time_s,
        {"p": "rad/s", "lat": "1", "q": "deg/s"},
    )


def same(first: fid.LinearSystem, second: fid.LinearSystem, *, units: bool = True) -> None:
    for one, two in zip(first.state_space(), second.state_space(), strict=True):
        assert np.array_equal(one, two)
    for key in ("inputs", "outputs", "states", "sample_time_s"):
        assert getattr(first, key) == getattr(second, key)
    assert not units or dict(first.units) == dict(second.units)


@pytest.mark.parametrize("step", [None, 0.02])
def test_round_trip_through_python_control(step: float | None) -> None:
    system = made_system(sample_time_s=step)
    there = system.to_control(name="vehicle")
    assert there.name == "vehicle"
    assert there.dt == (step or 0)
    same(fid.from_control(there, units=system.units), system)


def test_responses_of_python_control_are_ours() -> None:
    system = made_system()
    omega = np.geomspace(0.1, 30.0, 20)
    theirs = control.frequency_response(system.to_control(), omega).frdata
    assert_close(theirs, system.frequency_response(omega), rtol=1e-12, why="the same matrices")


def test_a_delay_is_never_dropped() -> None:
    late = made_system((0.05, 0.0))
    with pytest.raises(
        ModelError, match=r"delays, which a rational system cannot hold: .*lat 0.05"
    ):
        late.to_control()
    with pytest.raises(ModelError, match="a rational system cannot hold"):
        fid.to_scipy(late)
    with pytest.raises(ModelError, match="either approximated or sampled"):
        late.to_control(pade_order=2, sample_time_s=0.1)


def test_pade_is_python_controls_own() -> None:
    late = made_system((0.05, 0.08))
    omega = np.geomspace(0.1, 20.0, 20)
    found = control.frequency_response(late.to_control(pade_order=3), omega).frdata
    wanted = made_system().frequency_response(omega).astype(complex)
    for k, delay in enumerate((0.05, 0.08)):
        late_by = control.tf(*control.pade(delay, 3))
        wanted[:, k] *= late_by(1j * omega)
    assert_close(found, wanted, rtol=1e-8, why="the same rational delay, realised in two ways")


@pytest.mark.parametrize("hold", ["zero", "first"])
def test_sampled_delays_are_exact(hold: str) -> None:
    late, step = made_system((0.05, 0.013)), 0.02
    there = late.to_control(sample_time_s=step, hold=hold)
    rng = np.random.default_rng(1)
    u = rng.standard_normal((2, 100))
    u[:, :5] = 0.0
    record = fid.Record.from_arrays(np.arange(100) * step, inputs={"lat": u[0], "lon": u[1]})
    wanted = fid.simulate(late, record, hold=hold).matrix(late.outputs)
    found = control.forced_response(there, U=u).outputs
    assert_close(found, wanted, atol=1e-11, why="one exact discretisation beside another")


def test_whole_delays_of_a_discrete_system_become_states() -> None:
    late = made_system((0.04, 0.0), 0.02)
    there = late.to_control()
    omega = np.array([1.0, 20.0])
    found = control.frequency_response(there, omega).frdata
    assert there.nstates == 4
    assert_close(found, late.frequency_response(omega), rtol=1e-10, why="exact shift register")


def test_transfer_functions_and_delays_come_back() -> None:
    made = fid.from_control(
        control.tf([3.0, 1.0], [1.0, 5.0, 2.0], inputs="u", outputs="p"),
        units={"p": "rad/s"},
        delays_s={"u": 0.1},
    )
    s = 1j * np.array([0.5, 3.0])
    wanted = (3 * s + 1) / (s**2 + 5 * s + 2) * np.exp(-0.1 * s)
    found = made.frequency_response(s.imag)[0, 0]
    assert_close(found, wanted, rtol=1e-12, why="closed form")
    assert made.units == {"p": "rad/s"}


def test_frequency_responses_round_trip() -> None:
    omega = np.geomspace(0.5, 20.0, 7)
    values = made_system().frequency_response(omega)
    ours = fid.FrequencyResponse.from_values(
        omega, values, inputs=["lat", "lon"], outputs=["p", "q", "r"], units={"p": "rad/s"}
    )
    theirs = fid.to_control(ours)
    assert isinstance(theirs, control.FrequencyResponseData)
    back = fid.from_control(theirs, units=ours.units)
    assert np.array_equal(back.response, values)
    assert np.array_equal(back.omega_rad_s, omega)
    assert (back.inputs, back.outputs) == (("lat", "lon"), ("p", "q", "r"))


def test_fits_and_models_go_as_they_are() -> None:
    model = fid.load_model("short_period")
    assert fid.to_control(model, pade_order=1).state_labels[:2] == list(model.states)


def test_what_python_control_cannot_hold_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    dotted = fid.LinearSystem([[-1.0]], [[1.0]], [[1.0]], [[0.0]], ("a.b",), ("y",))
    with pytest.raises(ModelError, match="no dots in names"):
        dotted.to_control()
    with pytest.raises(ModelError, match="no linear system of python-control"):
        fid.from_control("tf")  # type: ignore[arg-type]
    with pytest.raises(ModelError, match="no sample time"):
        fid.from_control(control.ss([[0.5]], [[1.0]], [[1.0]], [[0.0]], True))
    with pytest.raises(ModelError, match="a delay has no input"):
        fid.from_control(control.tf([1.0], [1.0, 1.0]), delays_s={"v": 0.1})
    monkeypatch.setitem(__import__("sys").modules, "control", None)
    with pytest.raises(ExportError, match="python-control is not installed"):
        made_system().to_control()


@pytest.mark.parametrize("step", [None, 0.1])
def test_scipy_round_trip(step: float | None) -> None:
    system = made_system(sample_time_s=step)
    there = fid.to_scipy(system)
    assert isinstance(there, scipy.signal.lti if step is None else scipy.signal.dlti)
    back = fid.from_scipy(there, inputs=system.inputs, outputs=system.outputs)
    assert np.array_equal(back.state_space()[0], system.state_space()[0])
    assert back.sample_time_s == step
    with pytest.raises(ModelError, match="no linear system of SciPy"):
        fid.from_scipy(3, inputs=["u"], outputs=["y"])  # type: ignore[arg-type]
    with pytest.raises(ModelError, match="no sample time"):
        fid.from_scipy(scipy.signal.dlti([1.0], [1.0, 0.5]), inputs=["u"], outputs=["y"])


def test_scipy_takes_a_gain_alone() -> None:
    gain = fid.LinearSystem([], [], [[]], [[3.0]], ("u",), ("y",))
    there = fid.to_scipy(gain)
    assert_close(abs(there.freqresp([1.0])[1][0]), 3.0, rtol=1e-15, why="a gain")


SYSTEMS = {
    "plain": made_system(),
    "late": made_system((0.05, 0.1)),
    "sampled": made_system((0.04, 0.0), 0.02),
    "one state": made_system(n=1),
    "gain": fid.LinearSystem([], [], [[]], [[3.0]], ("u",), ("y",), units={"y": "m/s^2"}),
}


@pytest.mark.parametrize("suffix", ["mat", "json", "npz"])
@pytest.mark.parametrize("kind", SYSTEMS)
def test_files_round_trip_exactly(kind: str, suffix: str, tmp_path: Path) -> None:
    path = tmp_path / f"system.{suffix}"
    same(fid.read_system(fid.write_system(SYSTEMS[kind], path)), SYSTEMS[kind])
    assert [each.name for each in tmp_path.iterdir()] == [path.name]


@pytest.mark.parametrize("kind", SYSTEMS)
def test_toml_round_trip(kind: str, tmp_path: Path) -> None:
    path = fid.write_model(SYSTEMS[kind], tmp_path / "system.toml")
    same(fid.load_model(path), SYSTEMS[kind])


@examples(25)
@given(st.lists(st.floats(allow_nan=False, allow_infinity=False), min_size=4, max_size=4))
def test_every_number_survives_json_and_toml(numbers: list[float]) -> None:
    a, b, c, d = ([[number]] for number in numbers)
    system = fid.LinearSystem(a, b, c, d, ("u",), ("y",))
    for table in (
        json.loads(json.dumps(system.to_dict())),
        tomllib.loads(model_as_toml(system)),
    ):
        same(model_from_description(table), system)


def test_matlab_finds_cells_and_columns(tmp_path: Path) -> None:
    path = fid.write_system(
        SYSTEMS["late"],
        tmp_path / "system.mat",
        {"names": ["Lp", "Mq"], "values": [1.0, 2.0], "covariance": np.eye(2)},
    )
    found = scipy.io.loadmat(path)
    assert found["inputs"].shape == (2, 1)
    assert found["inputs"].dtype == object
    assert found["input_delay_s"].tolist() == [[0.05], [0.1]]
    assert found["Ts"].item() == 0.0
    assert [str(cell[0]) for cell in found["channel_units"].ravel()][:3] == ["1", "1", "rad/s"]
    assert str(found["parameter_names"][1, 0][0]) == "Mq"
    assert np.array_equal(found["parameter_covariance"], np.eye(2))


def test_files_from_strangers_are_refused_in_words(tmp_path: Path) -> None:
    with pytest.raises(ModelError, match="not written so"):
        fid.write_system(SYSTEMS["plain"], tmp_path / "system.xml")
    with pytest.raises(ModelError, match="not read from this"):
        fid.read_system(tmp_path / "system.xml")
    for suffix in ("mat", "json", "npz"):
        path = tmp_path / f"bad.{suffix}"
        path.write_bytes(b"\x00\x01 not this")
        with pytest.raises(FileFormatError, match=r"(is not a|no JSON)"):
            fid.read_system(path)
    (tmp_path / "list.json").write_text("[1]")
    with pytest.raises(ModelError, match="holds no table"):
        fid.read_system(tmp_path / "list.json")
    scipy.io.savemat(tmp_path / "part.mat", {"A": np.eye(2)})
    with pytest.raises(ModelError, match="lacks variables"):
        fid.read_system(tmp_path / "part.mat")
    big = tmp_path / "big.json"
    with big.open("wb") as file:
        file.truncate(MAXIMUM_BYTES + 1)
    with pytest.raises(FileFormatError, match="longer than such a file can be"):
        fid.read_system(big)
