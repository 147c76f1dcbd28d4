"""A helicopter whose cross terms start at zero: the search finds its minimum, or doubts it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import flightid as fid
from flightid.conventions import Light
from flightid.identification.fit_findings import judge_cost

G = 32.174
TRUTH = {
    "Xu": -0.02, "Yv": -0.05, "Lu": 0.004, "Lv": -0.03, "Mu": 0.004, "Mv": 0.003, "Lb": 32.0,
    "Ma": 7.0, "Nr": -0.35, "Nped": 0.4, "Nv": 0.01, "Np": -0.1, "tau_f": 0.1, "Ba": 0.15,
    "Ab": -0.2, "Blat": 0.03, "Blon": 0.004, "Alat": -0.003, "Alon": 0.025,
}  # fmt: skip
STARTS = {
    "Xu": -0.1, "Yv": -0.1, "Lv": -0.01, "Mu": 0.001, "Lb": 20.0, "Ma": 12.0, "Nr": -0.8,
    "Nped": 0.2, "tau_f": 0.15, "Blat": 0.02, "Alon": 0.015,
}  # fmt: skip
"""What a stranger began with; all others at zero."""
UNITS = {
    **dict.fromkeys(("Xu", "Yv", "Nr", "Np"), "1/s"), "tau_f": "s",
    **dict.fromkeys(("Lu", "Lv", "Mu", "Mv", "Nv"), "rad/(ft*s)"),
    **dict.fromkeys(("Lb", "Ma"), "1/s^2"), "Nped": "rad/(s^2*in)",
    **dict.fromkeys(("Ba", "Ab"), "1"), **dict.fromkeys(("Blat", "Blon", "Alat", "Alon"), "rad/in"),
}  # fmt: skip
EQUATIONS = """
kind = "state-space"
name = "Helicopter"
[states]
u = "ft/s"
v = "ft/s"
p = "rad/s"
q = "rad/s"
r = "rad/s"
phi = "rad"
theta = "rad"
a = "rad"
b = "rad"
[inputs]
lon = "in"
lat = "in"
ped = "in"
[outputs]
u = "u"
v = "v"
p = "p"
q = "q"
r = "r"
[equations]
"u'" = "Xu*u - g*theta - g*a"
"v'" = "Yv*v + g*phi + g*b"
"p'" = "Lu*u + Lv*v + Lb*b"
"q'" = "Mu*u + Mv*v + Ma*a"
"r'" = "Nr*r + Nv*v + Np*p + Nped*ped"
"phi'" = "p"
"theta'" = "q"
"tau_f*b'" = "-b - tau_f*p + Ba*a + Blat*lat + Blon*lon"
"tau_f*a'" = "-a - tau_f*q + Ab*b + Alat*lat + Alon*lon"
[constants]
g = { value = 32.174, unit = "ft/s^2" }
[parameters]
"""


def response(omega: np.ndarray) -> np.ndarray:
    """C (jω − A)⁻¹ B of the truth by NumPy, without flightid's models."""
    n = {name: place for place, name in enumerate(("u", "v", "p", "q", "r", "phi", "th", "a", "b"))}
    t, lag = TRUTH, TRUTH["tau_f"]
    entries = {
        ("u", "u"): t["Xu"], ("u", "th"): -G, ("u", "a"): -G,
        ("v", "v"): t["Yv"], ("v", "phi"): G, ("v", "b"): G,
        ("p", "u"): t["Lu"], ("p", "v"): t["Lv"], ("p", "b"): t["Lb"],
        ("q", "u"): t["Mu"], ("q", "v"): t["Mv"], ("q", "a"): t["Ma"],
        ("r", "r"): t["Nr"], ("r", "v"): t["Nv"], ("r", "p"): t["Np"],
        ("phi", "p"): 1.0, ("th", "q"): 1.0,
        ("b", "b"): -1 / lag, ("b", "p"): -1.0, ("b", "a"): t["Ba"] / lag,
        ("a", "a"): -1 / lag, ("a", "q"): -1.0, ("a", "b"): t["Ab"] / lag,
    }  # fmt: skip
    a, b = np.zeros((9, 9)), np.zeros((9, 3))
    for (row, column), value in entries.items():
        a[n[row], n[column]] = value
    b[n["b"], :2] = t["Blon"] / lag, t["Blat"] / lag
    b[n["a"], :2] = t["Alon"] / lag, t["Alat"] / lag
    b[n["r"], 2] = t["Nped"]
    return np.stack([np.linalg.solve(1j * w * np.eye(9) - a, b)[:5] for w in omega], axis=-1)


def test_cross_terms_that_start_at_zero_find_their_signs(tmp_path: Path) -> None:
    values = "".join(
        f'{name} = {{ value = {STARTS.get(name, 0.0)}, unit = "{UNITS[name]}" }}\n'
        for name in TRUTH
    )
    path = tmp_path / "helicopter.toml"
    path.write_text(EQUATIONS + values)
    omega = np.geomspace(0.4, 15.0, 30)
    inputs, outputs = ("lon", "lat", "ped"), ("u", "v", "p", "q", "r")
    data = fid.FrequencyResponse.from_values(
        omega, response(omega), inputs=inputs, outputs=outputs,
        units=dict(zip(outputs, ("ft/s", "ft/s", "rad/s", "rad/s", "rad/s"), strict=True))
        | dict.fromkeys(inputs, "in"),
    )  # fmt: skip
    seen = ("u/lon", "p/lon", "q/lon", "v/lat", "p/lat", "q/lat", "r/lat", "r/ped")
    model = fid.load_model(path).with_responses(*seen)
    found = fid.identify(model, data, minimum_coherence=None)
    for name, true in TRUTH.items():
        assert found.parameters[name].value == pytest.approx(true, rel=1e-3), name


def test_a_cost_that_says_wrong_minimum_is_not_called_settled() -> None:
    found = judge_cost({"q/lat": 804.0, "p/lat": 20.0}, 88.0)
    doubt = [each for each in found if each.code == "minimum-doubted"]
    assert [each.light for each in doubt] == [Light.AMBER]
    assert "q/lat 804" in doubt[0].message
    advice = [each.action for each in found if each.light is not Light.GREEN]
    assert [each[:21] for each in advice] == ["try more starts first"] * 2
    assert judge_cost({"q/lat": 80.0, "p/lat": 20.0}, 50.0)[-1].code == "cost"
