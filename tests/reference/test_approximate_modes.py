"""Approximations of modes: closed forms, a textbook airliner, and where they must not be used."""

from __future__ import annotations

import json

import numpy as np
import pytest

import flightid as fid
from flightid import errors
from tests.closeness import assert_close

# Etkin and Reid, Dynamics of Flight, 3rd ed., ch. 6: Boeing 747 at 40 000 ft and Mach 0.8 (ft, s).
AIRLINER_ALONG = [
    [-0.006868, 0.01395, 0.0, -32.2],
    [-0.09055, -0.3151, 773.98, 0.0],
    [0.0001187, -0.001026, -0.4285, 0.0],
    [0.0, 0.0, 1.0, 0.0],
]
AIRLINER_ACROSS = [
    [-0.0558, 0.0, -774.0, 32.2],
    [-0.003865, -0.4342, 0.4136, 0.0],
    [0.001086, -0.006112, -0.1458, 0.0],
    [0.0, 1.0, 0.0, 0.0],
]


def _system(a: list[list[float]], states: str) -> fid.LinearSystem:
    names = tuple(states.split())
    n = len(a)
    units = {"u": "ft/s", "v": "ft/s", "w": "ft/s", "p": "rad/s", "q": "rad/s", "r": "rad/s"}
    units |= {"phi": "rad", "theta": "rad"}
    return fid.LinearSystem(
        a, np.zeros((n, 1)), np.eye(n), np.zeros((n, 1)), ("stick",), names,
        states=names, units={name: units[name] for name in names},
    )  # fmt: skip


def test_airliner() -> None:
    along = fid.approximate_modes(_system(AIRLINER_ALONG, "u w q theta"))
    assert along.flight == "forward"
    assert_close(along.full.mode("phugoid").root, -0.003289 + 0.06723j, rtol=2e-3, why="printed")
    assert_close(along.full.mode("short").root, -0.3719 + 0.8875j, rtol=2e-3, why="printed")
    across = fid.approximate_modes(_system(AIRLINER_ACROSS, "v p r phi"))
    for name, printed in (
        ("spiral", -0.0072973 + 0j),
        ("roll", -0.56248 + 0j),
        ("Dutch roll", -0.033011 + 0.94655j),
    ):
        assert_close(across.full.mode(name).root, printed, rtol=4e-3, why="printed")
    lanchester = along.mode("phugoid")
    expected = np.sqrt(32.2 * 0.09055 / 773.98)
    assert_close(lanchester.natural_frequency.value, expected, rtol=1e-12, why="closed form")
    assert_close(
        lanchester.damping_ratio.value, 0.006868 / 2.0 / expected, rtol=1e-12, why="closed form"
    )
    short = along.mode("short period")
    square = 0.3151 * 0.4285 + 0.001026 * 773.98
    assert_close(short.natural_frequency.value, np.sqrt(square), rtol=1e-12, why="closed form")
    assert abs(short.difference_percent or 0.0) < 1.0
    dutch = across.mode("Dutch roll")
    square = 0.0558 * 0.1458 + 774.0 * 0.001086
    assert_close(dutch.natural_frequency.value, np.sqrt(square), rtol=1e-12, why="closed form")
    twice = 2.0 * (dutch.damping_ratio.value or 0.0) * np.sqrt(square)
    assert_close(twice, 0.0558 + 0.1458, rtol=1e-12, why="closed form")
    assert_close(across.mode("roll").root, -0.4342, rtol=1e-12, why="Lp alone")
    crude = (-0.003865 * -0.1458 - 0.001086 * 0.4136) / -0.003865
    assert_close(across.mode("spiral").root, crude, rtol=1e-12, why="closed form")
    better = across.mode("spiral, last two coefficients")
    assert abs(better.difference_percent or 0.0) < 2.0
    assert {f.message.split(":")[0] for f in across.findings} == {"spiral"}
    assert across.mode("roll").damping_difference is None


def test_navion_spiral_of_the_textbook() -> None:
    """Nelson's example 5.3: crude spiral root -0.144, Dutch roll -0.51 ± 2.1i, against -0.00877."""
    found = fid.approximate_modes(fid.load_model("fixed_wing_lateral"))
    assert_close(found.mode("spiral").root, -0.144, rtol=0.01, why="three printed digits")
    assert_close(found.mode("Dutch roll").root, -0.51 + 2.1j, rtol=0.01, why="two printed digits")
    assert_close(found.mode("roll").root, -8.4, rtol=0.01, why="two printed digits")


def test_quasi_static_limit() -> None:
    """With a short period a hundred times faster the reduced phugoid is the phugoid."""
    a = np.array(AIRLINER_ALONG)
    a[2] *= 1e4
    a[1, 1:3] *= [1e2, 1.0]
    found = fid.approximate_modes(_system(a.tolist(), "u w q theta"))
    reduced = found.mode("phugoid, quasi-static short period")
    assert reduced.full is not None
    assert_close(reduced.root, reduced.full.root, rtol=2e-3, why="two time scales")


def test_hovering_cubics() -> None:
    """Roots of the printed cubics for the uncoupled part of a hovering helicopter."""
    found = fid.approximate_modes(fid.load_model("ah64_hover"))
    assert found.flight == "hover"
    assert found.quasi_static == ("inflow",)
    value = {k: p.value or 0.0 for k, p in fid.load_model("ah64_hover").parameters.items()}
    gravity = value["g"] * np.cos(value["theta0"])
    climb = value["Xu"] * value["Mq"] - value["Xq"] * value["Mu"]
    cubic = [
        1.0, -(value["Xu"] + value["Mq"]), climb, gravity * value["Mu"] * np.cos(value["phi0"]),
    ]  # fmt: skip
    roots = np.roots(cubic)
    swing = found.mode("hovering cubic, longitudinal: oscillation")
    assert_close(swing.root, roots[roots.imag > 0][0], rtol=1e-9, why="the printed cubic")
    pitch = found.mode("hovering cubic, longitudinal: pitch")
    assert_close(pitch.root, roots[roots.imag == 0][0], rtol=1e-9, why="the printed cubic")
    assert swing.full is not None
    assert swing.full.name == "longitudinal phugoid-like"
    assert_close(found.mode("heave").root, value["Zw"], rtol=1e-9, why="Zw alone")


def test_intervals_follow_the_parameters() -> None:
    truth = fid.load_model("fixed_wing_lateral")
    omega = np.geomspace(0.05, 25.0, 40)
    data = fid.FrequencyResponse.from_values(
        omega,
        truth.frequency_response(omega),
        inputs=truth.inputs,
        outputs=truth.outputs,
        units=truth.units,
        random_error=np.full((len(truth.outputs), 2, 40), 0.05),
    )
    fit = fid.identify(truth, data)
    roll = fid.approximate_modes(fit).mode("roll").natural_frequency
    damping = fit.parameters["Lp"]
    assert damping.interval95 is not None
    assert roll.interval95 is not None
    assert_close(roll.interval95, damping.interval95, rtol=1e-6, why="the parameter itself")
    dutch = fid.approximate_modes(fit).mode("Dutch roll").natural_frequency

    def frequency(change: dict[str, float]) -> float:
        v = {name: p.value for name, p in fit.parameters.items()} | change
        block = [[v["Ybeta"] / 53.645, v["Yr"] / 53.645 - 1.0], [v["Nbeta"], v["Nr"]]]
        return float(np.sqrt(np.linalg.det(block)))

    slope = []
    for name in fit.names:
        value = fit.parameters[name].value
        step = 1e-5
        ends = [frequency({name: value + sign * step}) for sign in (1.0, -1.0)]
        slope.append((ends[0] - ends[1]) / (2 * step))
    assert fit.covariance is not None
    half = 1.959964 * np.sqrt(np.array(slope) @ fit.covariance @ np.array(slope))
    assert dutch.interval95 is not None
    assert_close((dutch.interval95[1] - dutch.interval95[0]) / 2, half, rtol=1e-3, why="by hand")
    assert "±" in fid.approximate_modes(fit).summary().to_text()


def test_where_no_formula_fits() -> None:
    found = fid.approximate_modes(fid.load_model("r50_hover"))
    lost = found.mode("hovering cubic, longitudinal: oscillation")
    assert lost.natural_frequency.value is None
    assert lost.natural_frequency.reason == "the formula gives no such root here"
    assert found.quasi_static == ("a", "b", "rfb", "c", "d")
    assert json.loads(json.dumps(found.to_dict()))["schema"] == "flightid.approximate_modes/1"
    assert "Taken as quasi-static" in found._repr_html_()
    with pytest.raises(errors.ModelError, match="there is no such approximation"):
        found.mode("short period")
    box = fid.PolynomialModel(("u",), "y", 0.1, a=[1.0, -0.5], b=[[1.0]])
    with pytest.raises(errors.ModelError, match="sampled model has none of"):
        fid.approximate_modes(box)
    with pytest.raises(errors.ModelError, match="no approximation fits the states"):
        fid.approximate_modes(fid.load_model("rate_second_order"))
