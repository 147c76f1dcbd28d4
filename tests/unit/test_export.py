"""What `export` writes, what it refuses, and that no name breaks out of generated code."""

from __future__ import annotations

import ctypes
import re
from pathlib import Path

import numpy as np
import pytest
import scipy.io
from hypothesis import given
from hypothesis import strategies as st

import flightid as fid
from flightid.conventions import Light
from flightid.errors import ExportError, ModelError, OptionError
from flightid.export import c_compiler
from flightid.export.names import comment, identifier, identifiers, text_literal
from tests.compiled_model import CompiledModel, needs_compiler
from tests.examples import examples
from tests.unit.test_saved_models import ARMAX, NARX

EVIL = ['"); system("id"); ("', "*/ int x; /*", "a\nb", "??/", "%s%n", "\\", "ü", "int", "9", ""]


@pytest.mark.parametrize("suffix", ["toml", "mat", "json", "npz"])
def test_formats_that_are_read_again(suffix: str, tmp_path: Path) -> None:
    made = fid.export(ARMAX, tmp_path / f"model.{suffix}")
    assert made.format == suffix
    read = fid.load_model if suffix == "toml" else fid.read_system
    back = read(made.files[0]).linear_system()
    assert np.array_equal(back.a, ARMAX.linear_system().a)
    assert repr(made) == f"ExportFiles({suffix}: model.{suffix})"
    assert "model." in str(made.summary())
    assert made.to_dict()["schema"] == "flightid.exported/1"


def test_a_fit_takes_its_covariance_along(tmp_path: Path) -> None:
    truth = fid.load_model("rate_first_order").with_values({"Lp": -5.0, "Ltphi": 150.0})
    omega = np.geomspace(0.5, 20.0, 30)
    data = fid.FrequencyResponse.from_values(
        omega, truth.frequency_response(omega), inputs=truth.inputs, outputs=truth.outputs,
        units=truth.units, random_error=np.full((1, 1, 30), 0.02),
    )  # fmt: skip
    fit = fid.identify(truth, data)
    made = fid.export(fit, tmp_path / "roll.mat")
    found = scipy.io.loadmat(made.files[0])
    assert np.array_equal(found["parameter_covariance"], fit.covariance)
    names = [str(each[0]) for each in found["parameter_names"].ravel()]
    assert found["parameter_values"].ravel()[names.index("Lp")] == fit.parameters["Lp"].value
    assert "ss(m.A, m.B" in made.facts["in MATLAB"]


def test_matrices_of_a_nonlinear_model_say_that_they_are_a_linearisation(tmp_path: Path) -> None:
    made = fid.export(fid.load_model("quadrotor_6dof"), tmp_path / "quad.json")
    assert [finding.code for finding in made.findings] == ["linearised"]
    assert made.findings[0].light is Light.AMBER
    assert repr(made).endswith("1 findings)")


def test_narx_goes_to_toml_alone(tmp_path: Path) -> None:
    assert fid.export(NARX, tmp_path / "narx.toml").format == "toml"
    with pytest.raises(ModelError, match="a NARX model has no linear system"):
        fid.export(NARX, tmp_path / "narx.mat")


def test_what_cannot_be_exported_is_said(tmp_path: Path) -> None:
    roll = fid.load_model("rate_first_order")
    with pytest.raises(OptionError, match="format of an export is not known"):
        fid.export(roll, tmp_path / "roll.docx")
    with pytest.raises(OptionError, match="suffix is not that of the format"):
        fid.export(roll, tmp_path / "roll.json", "mat")
    with pytest.raises(OptionError, match=r"ends in \.toml"):
        fid.export(roll, tmp_path / "roll.txt", "toml")
    with pytest.raises(OptionError, match="has no such option"):
        fid.export(roll, tmp_path / "roll.mat", hold="zero")
    with pytest.raises(OptionError, match="has no such option"):
        fid.export(roll, tmp_path / "roll.c", speed=3)
    with pytest.raises(ModelError, match="cannot be written as a model"):
        fid.export("roll", tmp_path / "roll.toml")
    with pytest.raises(ModelError, match="no linear system in this"):
        fid.export("roll", tmp_path / "roll.mat")
    assert not list(tmp_path.iterdir())


def test_options_of_c_are_checked(tmp_path: Path) -> None:
    roll = fid.load_model("rate_first_order")
    sampled = roll.linear_system().sampled(0.1)
    path = tmp_path / "roll.c"
    with pytest.raises(OptionError, match="needs the time of one step"):
        fid.export(roll, path)
    with pytest.raises(OptionError, match="sample_time_s is too small"):
        fid.export(roll, path, sample_time_s=-1.0)
    with pytest.raises(OptionError, match="hold is not known"):
        fid.export(roll, path, sample_time_s=0.1, hold="second")
    with pytest.raises(OptionError, match="its steps are exact"):
        fid.export(roll, path, sample_time_s=0.1, substeps=2)
    with pytest.raises(ExportError, match="no parameters that code could change"):
        fid.export(roll, path, sample_time_s=0.1, tunable=True)
    with pytest.raises(OptionError, match="a sample time of its own"):
        fid.export(sampled, path, sample_time_s=0.2)
    with pytest.raises(OptionError, match="at its samples alone"):
        fid.export(sampled, path, hold="first")
    with pytest.raises(OptionError, match="a name that its header cannot carry"):
        fid.export(roll, tmp_path / "my roll.c", sample_time_s=0.1)
    with pytest.raises(ModelError, match="a delay is too long"):
        fid.export(roll, path, sample_time_s=1e-9)
    assert not list(tmp_path.iterdir())


@examples(200)
@given(st.text(max_size=80))
def test_no_text_leaves_its_literal_or_comment(text: str) -> None:
    assert re.fullmatch(r"[A-Za-z][A-Za-z0-9_]*", identifier(text))
    assert re.fullmatch(r'"([\x20\x21\x23\x24\x26-\x3e\x40-\x5b\x5d-\x7e]|\\[0-7]{3})*"',
                        text_literal(text.encode("utf-8", "replace").decode()))  # fmt: skip
    assert "*/" not in comment(text)
    assert "\n" not in comment(text)


def test_identifiers_differ() -> None:
    assert identifiers(["p", "p!", "p", "int"]) == ["p", "p_2", "p_3", "value_int"]


@needs_compiler
def test_malicious_names_stay_names(tmp_path: Path) -> None:
    n = len(EVIL)
    system = fid.LinearSystem(
        -np.eye(n), np.eye(n), np.eye(n), np.zeros((n, n)), tuple(EVIL),
        tuple(f"y{each}" for each in EVIL), states=tuple(f"x{each}" for each in EVIL),
        units={EVIL[0]: '"; */', EVIL[1]: EVIL[2]},
    )  # fmt: skip
    made = fid.export(system, tmp_path / "evil.c", name='evil */ "\\', sample_time_s=0.1)
    compiled = CompiledModel(made.files[0], made.facts["prefix"], n)
    assert compiled.step(np.ones(n))[0] == 0

    class Entry(ctypes.Structure):
        _fields_ = [("name", ctypes.c_char_p), ("unit", ctypes.c_char_p)] + [
            (key, ctypes.c_double) for key in ("start", "minimum", "maximum")
        ]

    entries = (Entry * n).in_dll(compiled.library, f"{made.facts['prefix']}_inputs")
    assert [each.name.decode() for each in entries] == EVIL


def test_a_missing_compiler_is_said(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv("PATH", "")
    monkeypatch.delenv("CC", raising=False)
    with pytest.raises(ExportError, match="no C compiler"):
        c_compiler.compile_library([tmp_path / "a.c"], tmp_path / "a.so")


@needs_compiler
def test_code_that_does_not_compile_is_said(tmp_path: Path) -> None:
    (tmp_path / "a.c").write_text("this is not C")
    with pytest.raises(ExportError, match="refuses the exported code"):
        c_compiler.compile_library([tmp_path / "a.c"], tmp_path / "a.so")
