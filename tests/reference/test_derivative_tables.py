"""Derivatives: which parameters they are, units, intervals; to coefficients and back."""

from __future__ import annotations

import json

import numpy as np
import pytest

import flightid as fid
from flightid import errors
from flightid.dynamics import FixedWing, Rotorcraft, to_dimensional
from tests.closeness import assert_close

NAVION = FixedWing(1247.4, 1420.9, 4067.5, 4786.0, 17.094, 1.7374, 10.18, 53.645)
# Teper, NASA CR-96008: the Navion's coefficients, which the library's coefficient models hold.
ACROSS = {
    "CYbeta": -0.564, "Clbeta": -0.074, "Clp": -0.41, "Clr": 0.107, "Claileron": 0.134,
    "Cnbeta": 0.0701, "Cnp": -0.0575, "Cnr": -0.125, "Cnaileron": -0.0035, "Cnrudder": -0.072,
}  # fmt: skip
ALONG = {"CZalpha": -4.49, "CXalpha": 0.08, "Cmalpha": -0.683, "Cmalphadot": -4.36, "Cmq": -9.96}


def test_coefficients_of_the_navion() -> None:
    lateral = fid.derivatives(fid.load_model("fixed_wing_lateral"), NAVION)
    for name, value in ACROSS.items():
        found = lateral[name].coefficient
        assert found is not None
        assert_close(found.value, value, rtol=0.012, why="both sets are printed to three digits")
    longitudinal = fid.derivatives(fid.load_model("fixed_wing_longitudinal"), NAVION)
    for name, value in ALONG.items():
        found = longitudinal[name].coefficient
        assert found is not None
        assert_close(found.value, value, rtol=0.015, why="both sets are printed to three digits")


def test_there_and_back() -> None:
    for name in ("fixed_wing_lateral", "fixed_wing_longitudinal"):
        found = fid.derivatives(fid.load_model(name), NAVION)
        back = to_dimensional(found.coefficients, NAVION)
        expected = {d.name: d.si.value for d in found}
        assert back.keys() == expected.keys()
        for key, value in back.items():
            assert_close(value, expected[key], rtol=1e-12, atol=1e-15, why=f"round trip {key}")


def test_coefficient_models_linearised_are_the_dimensional_derivatives() -> None:
    """The nonlinear models' own Jacobians against the scaling of their parameters."""
    lateral = fid.load_model("fixed_wing_lateral_coefficients")
    a, b = lateral.state_space()[:2]
    values = {k: p.value or 0.0 for k, p in lateral.parameters.items() if k.startswith("C")}
    found = to_dimensional(values, NAVION)
    place = {name: k for k, name in enumerate(lateral.states)}
    for axis, state in (("L", "p"), ("N", "r")):
        for variable in ("beta", "p", "r"):
            entry = a[place[state], place[variable]]
            assert_close(entry, found[axis + variable], rtol=1e-9, why="Jacobian")
        for k, control in enumerate(lateral.inputs):
            assert_close(b[place[state], k], found[axis + control], rtol=1e-9, why="Jacobian")
    assert_close(a[0, 0] * 53.645, found["Ybeta"], rtol=1e-9, why="Jacobian")
    along = fid.load_model("fixed_wing_longitudinal_coefficients")
    speed = along.trim["V"]
    scale = FixedWing(1247.4, 1420.9, 4067.5, 4786.0, 17.094, 1.7374, 10.18, speed)
    a, b = along.state_space()[:2]
    values = {k: p.value or 0.0 for k, p in along.parameters.items() if k.startswith("C")}
    found = to_dimensional(values, scale)
    place = {name: k for k, name in enumerate(along.states)}
    # In wind axes: alpha' takes the lift and the thrust, which balances the drag.
    assert_close(a[place["alpha"], place["alpha"]] * speed, found["Zalpha"], rtol=1e-6, why="J")
    lift = found["Zq"] / speed
    assert_close(a[place["alpha"], place["q"]] - 1.0, lift, rtol=1e-6, why="J")
    rate = found["Malphadot"]
    stiffness = found["Malpha"] + rate * found["Zalpha"] / speed
    assert_close(a[place["q"], place["alpha"]], stiffness, rtol=1e-6, why="Jacobian")
    damping = found["Mq"] + rate * (1.0 + lift)
    assert_close(a[place["q"], place["q"]], damping, rtol=1e-6, why="Jacobian")


def test_a_helicopter_in_feet_by_its_rotor() -> None:
    """Independent of units: the same vehicle in metres has the same coefficients."""
    rotor = Rotorcraft(44.0, 1.5, 3.0, 3.5, 1.535, 89.0)
    found = fid.derivatives(fid.load_model("r50_hover"), rotor)
    tip, force = 89.0 * 1.535, 1.225 * np.pi * 1.535**2 * (89.0 * 1.535) ** 2
    heave, roll = found["Zw"], found["Lv"]
    assert heave.coefficient is not None
    assert roll.coefficient is not None
    assert_close(heave.coefficient.value, -0.614 * 44.0 * tip / force, rtol=1e-9, why="by hand")
    by_hand = 0.143 / 0.3048 * 1.5 * tip / (force * 1.535)
    assert_close(roll.coefficient.value, by_hand, rtol=1e-9, why="by hand, 1/ft to 1/m")
    assert found["Ba"].coefficient is None
    assert (found["Ba"].axis, found["Ba"].variable) == ("b", "a")
    assert found["Xa"].status == "tied"
    assert set(found.others) == {"tau_f", "hcg", "tau_s", "Krfb", "tau_ped", "g"}
    for axis in "XYZLMN":
        for variable in ("w", "q", "alphadot", "wdot", "stick"):
            assert (rotor.factor(axis, variable) or 0.0) > 0.0
            assert (NAVION.factor(axis, variable) or 0.0) > 0.0
    assert rotor.factor("b", "a") is None
    assert NAVION.factor("b", "a") is None


def test_intervals_are_scaled_with_the_values() -> None:
    truth = fid.load_model("short_period").with_fixed(Malphadot=-0.898)
    omega = np.geomspace(0.3, 30.0, 40)
    data = fid.FrequencyResponse.from_values(
        omega,
        truth.frequency_response(omega),
        inputs=truth.inputs,
        outputs=truth.outputs,
        units=truth.units,
        random_error=np.full((len(truth.outputs), 1, 40), 0.02),
    )
    fit = fid.identify(truth, data)
    found = fid.derivatives(fit, NAVION)
    damping = found["Mq"]
    assert damping.dimensional.interval95 == fit.parameters["Mq"].interval95
    assert damping.coefficient is not None
    ratio = (NAVION.factor("M", "q") or 0.0) * np.array(damping.coefficient.interval95)
    assert_close(ratio, damping.dimensional.interval95, rtol=1e-12, why="one factor")
    assert found["Malphadot"].status == "fixed"
    assert found["Malphadot"].dimensional.interval95 is None
    assert found["Malphadot"].meaning == "pitching moment by rate of alpha"
    assert repr(found) == "DerivativeTable('Short period': 4 stability, 2 control)"
    assert "Cmq" in found.summary().to_text()
    assert json.loads(json.dumps(found.to_dict()))["schema"] == "flightid.derivatives/1"


def test_what_has_no_derivatives_is_refused() -> None:
    with pytest.raises(errors.ModelError, match="derivatives need a state-space model"):
        fid.derivatives(fid.load_model("rate_second_order"))
    with pytest.raises(errors.ModelError, match="no parameter of the model is a derivative"):
        fid.derivatives(fid.load_model("fixed_wing_lateral_coefficients"))
    with pytest.raises(errors.ModelError, match="there is no such derivative"):
        fid.derivatives(fid.load_model("short_period"))["Lp"]
    with pytest.raises(errors.OptionError, match="span_m of a normalisation is not positive"):
        FixedWing(1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 0.0, 1.0)
    with pytest.raises(errors.OptionError, match="name of a coefficient"):
        to_dimensional({"Kp": 1.0}, NAVION)
    whole = fid.derivatives(fid.load_model("quadrotor_6dof"), Rotorcraft(1, 1, 1, 1, 1, 1))
    assert whole["Lp"].si.value is None
    assert "per mass or inertia" in whole["Lp"].si.reason
    assert "No coefficient" in whole.summary().to_text()
