"""Aerodynamics for JSBSim, loaded and run by JSBSim, moment by moment."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

import flightid as fid
from flightid.errors import ExportError, OptionError
from flightid.export.jsbsim import FT_M, LBF_N
from tests.closeness import assert_close

INERTIA = {"ixx": 1421.0, "iyy": 4067.0, "izz": 4786.0, "ixz": 150.0}
MASS = 1247.0
U, W, THETA = 50.0, 4.0, math.atan2(4.0, 50.0)
STATES = ("u", "v", "w", "p", "q", "r", "phi", "theta")
INPUTS = ("aileron", "elevator", "rudder")
AIRCRAFT = """<?xml version="1.0"?>
<fdm_config name="plane" version="2.0" release="ALPHA">
 <fileheader><author>test</author><version>1</version></fileheader>
 <metrics><wingarea unit="M2">17</wingarea><wingspan unit="M">10</wingspan>
  <chord unit="M">1.7</chord>
  <location name="AERORP" unit="M"><x>0</x><y>0</y><z>0</z></location></metrics>
 <mass_balance><ixx unit="KG*M2">1421</ixx><iyy unit="KG*M2">4067</iyy><izz unit="KG*M2">4786</izz>
  <emptywt unit="KG">1247</emptywt>
  <location name="CG" unit="M"><x>0</x><y>0</y><z>0</z></location></mass_balance>
 <ground_reactions/><propulsion/>
 <flight_control name="fcs"><property value="0">fcs/elevator-pos-rad</property></flight_control>
 <aerodynamics file="aero.xml"/>
</fdm_config>
"""


def derivatives() -> np.ndarray:
    """Aerodynamic part: rows u, v, w in 1/s and m/s², rows p, q, r; columns STATES then INPUTS."""
    rows = np.random.default_rng(0).normal(size=(6, len(STATES) + len(INPUTS)))
    rows[:, [6, 7]] = 0.0
    rows[3:, :3] *= 0.1
    return rows


def vehicle() -> fid.LinearSystem:
    g = 9.80665
    whole = np.zeros((8, 11))
    whole[:6] = derivatives()
    # -q w + r v - g sin θ, -r u + p w + g cos θ sin φ, -p v + q u + g cos θ cos φ, linearised.
    whole[0, [4, 7]] += [-W, -g * math.cos(THETA)]
    whole[1, [3, 5, 6]] += [W, -U, g * math.cos(THETA)]
    whole[2, [4, 7]] += [U, -g * math.sin(THETA)]
    whole[6, [3, 5]] = [1.0, math.tan(THETA)]
    whole[7, 4] = 1.0
    return fid.LinearSystem(
        whole[:, :8], whole[:, 8:], np.eye(8), np.zeros((8, 3)), INPUTS,
        tuple(f"{x}_out" for x in STATES), states=STATES,
    )  # fmt: skip


def export(folder: Path, system: object, **changes: object):
    options = {
        "mass_kg": MASS, "inertia_kg_m2": INERTIA, "trim": {"u": U, "w": W, "theta": THETA},
        **changes,
    }  # fmt: skip
    return fid.export(system, folder / "aero.xml", **options)


def test_jsbsim_finds_the_same_forces_and_moments(tmp_path: Path) -> None:
    jsbsim = pytest.importorskip("jsbsim")
    folder = tmp_path / "aircraft" / "plane"
    folder.mkdir(parents=True)
    made = export(folder, vehicle())
    assert made.facts["axes"] == "X, Y, Z, ROLL, PITCH, YAW"
    (folder / "plane.xml").write_text(AIRCRAFT)
    jsbsim.FGJSBBase().debug_lvl = 0
    executive = jsbsim.FGFDMExec(str(tmp_path))
    executive.set_debug_level(0)
    assert executive.load_model("plane")
    state = {"u": 55.0, "v": 3.0, "w": 2.5, "p": 0.1, "q": -0.2, "r": 0.15}
    for name in "uvw":
        executive[f"ic/{name}-fps"] = state[name] / FT_M
    for name in "pqr":
        executive[f"ic/{name}-rad_sec"] = state[name]
    executive["ic/h-sl-ft"] = 3000.0
    assert executive.run_ic()
    controls = {"aileron": 0.05, "elevator": -0.1, "rudder": 0.02}
    for name, prop in (("aileron", "left-aileron"), ("elevator", "elevator"), ("rudder", "rudder")):
        executive[f"fcs/{prop}-pos-rad"] = controls[name]
    executive.run()
    seen = {name: executive[f"velocities/{name}-aero-fps"] * FT_M for name in "uvw"}
    seen |= {name: executive[f"velocities/{name}-aero-rad_sec"] for name in "pqr"}
    point = np.array([
        seen["u"] - U, seen["v"], seen["w"] - W, seen["p"], seen["q"], seen["r"], 0.0, 0.0,
        *(executive[f"fcs/{x}-pos-rad"] for x in ("left-aileron", "elevator", "rudder")),
    ])  # fmt: skip
    specific = derivatives() @ point
    held = MASS * 9.80665 * np.array([math.sin(THETA), 0.0, -math.cos(THETA)])
    forces = (MASS * specific[:3] + held) / LBF_N
    ixz = INERTIA["ixz"]
    tensor = np.diag([INERTIA["ixx"], INERTIA["iyy"], INERTIA["izz"]])
    tensor[0, 2] = tensor[2, 0] = -ixz
    moments = tensor @ specific[3:] / (LBF_N * FT_M)
    found = [executive[f"forces/fb{x}-aero-lbs"] for x in "xyz"]
    assert_close(np.array(found), forces, rtol=1e-9, why="the derivatives at JSBSim's own state")
    found = [executive[f"moments/{x}-aero-lbsft"] for x in "lmn"]
    assert_close(np.array(found), moments, rtol=1e-9, why="the derivatives at JSBSim's own state")


def test_library_models_have_their_own_trim(tmp_path: Path) -> None:
    model = fid.load_model("fixed_wing_lateral")
    made = fid.export(model, tmp_path / "navion.xml", mass_kg=MASS, inertia_kg_m2=INERTIA)
    assert made.facts["axes"] == "Y, ROLL, YAW"
    assert [each.code for each in made.findings] == ["delays-left-out"]
    text = made.files[0].read_text()
    assert "aero/beta-rad" in text
    assert "phi" not in text


def test_what_does_not_map_is_named(tmp_path: Path) -> None:
    with pytest.raises(ExportError, match=r"state .*input lat"):
        export(tmp_path, fid.load_model("r50_hover"))
    system = vehicle()
    wrong = fid.LinearSystem(
        np.asarray(system.a) + np.outer(np.eye(8)[3], np.eye(8)[6]),
        system.b, system.c, system.d, INPUTS, system.outputs, states=STATES,
    )  # fmt: skip
    with pytest.raises(ExportError, match=r"axis ROLL depends on the attitude.*phi"):
        export(tmp_path, wrong)
    with pytest.raises(ExportError, match=r"axis X depends on the attitude.*theta"):
        export(tmp_path, system, trim={"u": U, "w": W, "theta": THETA + 1.0})
    with pytest.raises(ExportError, match="continuous time"):
        export(tmp_path, system.sampled(0.1))
    still = fid.LinearSystem(np.zeros((1, 1)), [[0.0]], [[1.0]], [[0.0]], ("rudder",), ("y",),
                             states=("r",))  # fmt: skip
    with pytest.raises(ExportError, match="neither a force nor a moment"):
        export(tmp_path, still)
    assert not list(tmp_path.iterdir())


def test_options_are_checked(tmp_path: Path) -> None:
    system = vehicle()
    for changes, said in (
        ({"mass_kg": None}, "forces need the mass"),
        ({"inertia_kg_m2": {"ixx": 1.0}}, "moments need the inertia"),
        ({"inertia_kg_m2": {"ixx": 1.0, "iyy": 1.0, "izz": 1.0, "ixz": 2.0}}, "of no body"),
        ({"trim": {}}, "trim of the model is not known"),
        ({"trim": {"u": math.inf}}, "needed numbers by name"),
    ):
        with pytest.raises(OptionError, match=said):
            export(tmp_path, system, **changes)
    with pytest.raises(OptionError, match=r"ends in \.xml"):
        fid.export(system, tmp_path / "aero.txt", "jsbsim")


def test_names_stay_names(tmp_path: Path) -> None:
    evil = '<x/>"&'
    system = fid.LinearSystem([[-1.0]], [[2.0]], [[1.0]], [[0.0]], (evil,), ("y",), states=("r",))
    made = export(tmp_path, system, properties={evil: "fcs/<b>&"})
    text = made.files[0].read_text()
    assert "<x/>" not in text
    assert "fcs/&lt;b&gt;&amp;" in text
