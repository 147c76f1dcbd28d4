"""The screen Model: library, equations of a study, refused values, predictions, own models."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from flightid import library_names, load_model, run_study, verify
from flightid.app.model_prediction import predict_model
from flightid.app.model_work import judge_own, make_library, make_model, make_use
from flightid.app.study_edits import KeyEdit, edited
from flightid.errors import ModelError, UnknownNameError
from flightid.record import Record
from flightid.study.proposal import propose_study
from flightid.validation.verification import held_otherwise
from tests.sweep_log import SweepFlight

OWN = """kind = "state-space"
name = "Own"

[states]
p = "rad/s"

[inputs]
tau_phi = "1"

[outputs]
p = "p"

[parameters]
Lp = { value = -3.0, min = -60.0, max = 0.0, unit = "1/s" }
Ltphi = { value = 60.0, unit = "rad/s^2" }

[equations]
"p'" = "Lp*p + Ltphi*tau_phi"
"""


@pytest.fixture(scope="module")
def study(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("model")
    log = SweepFlight(sweep_s=20.0, rate_hz=100.0).write(folder)
    path = folder / "study.toml"
    propose_study([log], folder=folder).write(path)
    return path


def _set(name: str, key: str, value: object) -> KeyEdit:
    return KeyEdit(("model", 0, "parameters", name, key), value)


def test_the_library_tells_every_model() -> None:
    told = {each["key"]: each for each in make_library()}
    assert sorted(told) == library_names()
    assert told["rate_motor_lag"]["axes"] == ["roll", "pitch", "yaw"]
    assert told["r50_hover"]["axes"] == []
    right = {each["left"]: each["right"] for each in told["short_period"]["equations"]}
    assert right["U0*alpha'"] == "Zalpha*alpha + U0*q + Zelevator*elevator"


def test_each_cell_is_one_key_and_refusals_say_why(study: Path) -> None:
    text = study.read_text(encoding="utf-8")

    def rows(*edits: KeyEdit) -> dict[str, dict[str, object]]:
        made = make_model(study, text, edits, "Roll rate")
        assert made is not None
        return {each["name"]: each for each in made["parameters"]}

    # The proposal writes `parameters.T_m = {…}`: an edit beside it stays in its model.
    assert [name for name, each in rows().items() if each["changed"]] == ["T_m"]
    row = rows(_set("Lp", "value", -4.0))["Lp"]
    assert (row["value"], row["start"], row["changed"]) == (-4.0, -3.0, True)
    assert "parameters.Lp = {value = -4.0}" in edited(text, [_set("Lp", "value", -4.0)])
    tied = rows(_set("T_m", "tie", "2*tau"))["T_m"]
    assert (tied["value"], tied["free"]) == (0.04, False)
    with pytest.raises(ModelError, match=r"Lp lies outside its bounds: found 500"):
        rows(_set("Lp", "value", 500.0))
    with pytest.raises(ModelError, match="does not have its unit"):
        rows(_set("T_m", "tie", "Lp"))
    with pytest.raises(UnknownNameError):
        rows(_set("Lq", "value", 1.0))


def test_a_model_of_the_library_takes_the_place_of_another(study: Path) -> None:
    text = study.read_text(encoding="utf-8")
    asked = {"place": 0, "template": "rate_first_order", "axis": "roll", "columns": {}}
    used = make_use(study, text, asked)
    assert [each["path"][2] for each in used["edits"]] == ["parameters", "template"]
    asked["place"] = 3
    used = make_use(study, text, asked)
    made = edited(text, [KeyEdit(tuple(each["path"]), each["value"]) for each in used["edits"]])
    beside = make_model(study, made, [], used["name"])
    assert beside is not None
    assert beside["key"] == "rate_first_order"


def test_a_model_of_a_rig_reads_columns_and_samples(tmp_path: Path) -> None:
    time_s = np.arange(400) * 0.02
    inputs = np.sign(np.sin(time_s))
    table = np.column_stack([time_s, inputs, 0.1 * np.sin(time_s)])
    np.savetxt(tmp_path / "a.csv", table, delimiter=",", header="t,u,y", comments="")
    path = tmp_path / "study.toml"
    text = """[study]
title = "Rig"

[[record]]
name = "a"
path = "a.csv"
time_column = "t"

[[model]]
name = "y from u"
structure = "arx"
inputs = ["u"]
outputs = "y"
identify = "a"
na = 1
nb = 1
nk = 1
"""
    path.write_text(text, encoding="utf-8")
    columns = {"tau_psi": "u", "r": "y"}
    asked = {"place": 0, "template": "rate_first_order", "axis": "yaw", "columns": columns}
    edits = [
        KeyEdit(tuple(each["path"]), each["value"]) for each in make_use(path, text, asked)["edits"]
    ]
    units = KeyEdit(("defaults", "record", "units"), {"r": "rad/s", "tau_psi": "1"})
    made = edited(text, [*edits, units])
    told = predict_model(path, made, [], "y from u", {})["prediction"]
    (curve,) = told["curves"]
    assert (curve["output"], told["responses"]) == ("r", [])
    record = Record.from_arrays(
        time_s, inputs={"tau_psi": inputs}, outputs={"r": table[:, 2]}, units={"r": "rad/s"}
    )
    model = load_model("rate_first_order", axis="yaw")
    assert curve["theil"] == pytest.approx(verify(model, record).theil["r"], rel=1e-12)


def test_a_prediction_is_that_of_the_run(study: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Sliders at the estimates show the coefficient that `flightid run` prints."""
    text = study.read_text(encoding="utf-8")
    text = edited(text, [KeyEdit(("model", 0, "verify"), ["yaw sweep"])])
    path = study.with_name("run.toml")
    path.write_text(text, encoding="utf-8")
    (found, *_) = run_study(path, output=study.parent / "out").identified
    fit = found.fit
    assert fit is not None
    values = {name: float(each.value or 0.0) for name, each in fit.parameters.items()}
    told = predict_model(path, text, [], "Roll rate", values)["prediction"]
    assert told["curves"][0]["theil"] == found.on_unseen["yaw sweep"].theil["p"]
    # While the slider moves, other holds are not run again: three quarters of the time it took.
    monkeypatch.delattr(held_otherwise, "numbers_of")
    assert predict_model(path, text, [], "Roll rate", values)["prediction"] == told
    shown = np.array(told["responses"][0]["gain"])
    fitted = fit.responses[0]
    omega = np.array(told["responses"][0]["omega_rad_s"])
    here = np.isin(omega, fitted.omega_rad_s)
    assert np.allclose(shown[here], np.abs(fitted.model)[np.isin(omega, fitted.omega_rad_s)])


@pytest.mark.parametrize(
    ("was", "written", "said", "line"),
    [
        ('"rad/s^2"', '"rad/s"', "does not have its unit", 18),
        ("Lp*p", "Lq*p", "names what is not defined", 18),
        ("max = 0.0", "most = 0.0", "unknown key: found most", 14),
        ("value = -3.0", "value = 3.0", "lies outside its bounds", 14),
        ("[equations]", "[equations", "no TOML", 17),
    ],
)
def test_a_faulty_line_of_an_own_model_is_named(
    was: str, written: str, said: str, line: int
) -> None:
    judged = judge_own(OWN.replace(was, written, 1))
    assert judged.model is None
    assert said in judged.error
    assert judged.line == line


def test_an_own_model_without_fault_is_shown() -> None:
    judged = judge_own(OWN)
    assert judged.model is not None
    assert [each.name for each in judged.model.parameters] == ["Lp", "Ltphi"]
