"""Couplings that start at zero, parameters without influence, files without kind."""

from __future__ import annotations

import tomllib
from pathlib import Path

import numpy as np
import pytest

import flightid as fid
from flightid.conventions import Light
from flightid.errors import ModelError, SingularError
from flightid.models.kinds import model_from_description
from flightid.study.model_section import _without_point
from flightid.uncertainty import cramer_rao, insensitivity
from tests.closeness import assert_close

MODEL: dict[str, object] = {
    "kind": "state-space",
    "name": "two axes",
    "states": {"p": "rad/s", "q": "rad/s"},
    "inputs": {"lat": "1", "lon": "1"},
    "outputs": {"p": "p", "q": "q"},
    "parameters": {
        "Lp": {"value": -3.0, "unit": "1/s"},
        "Mq": {"value": -2.0, "unit": "1/s"},
        "Llat": {"value": 5.0, "unit": "rad/s^2"},
        "Llon": {"value": -0.4, "unit": "rad/s^2"},
        "Mlon": {"value": 4.0, "unit": "rad/s^2"},
        "Mlat": {"value": 0.7, "unit": "rad/s^2"},
    },
    "equations": {"p'": "Lp*p + Llat*lat + Llon*lon", "q'": "Mq*q + Mlon*lon + Mlat*lat"},
}


def test_couplings_start_at_zero() -> None:
    truth = model_from_description(MODEL)
    omega = np.geomspace(0.3, 20.0, 30)
    data = fid.FrequencyResponse.from_values(
        omega,
        truth.frequency_response(omega),
        inputs=["lat", "lon"],
        outputs=["p", "q"],
        units={"p": "rad/s", "q": "rad/s"},
    )
    start = truth.with_values({"Llon": 0.0, "Mlat": 0.0, "Lp": -2.0, "Mq": -3.0})
    fit = fid.identify(start, data)
    for name, parameter in truth.parameters.items():
        assert_close(fit.parameters[name].value, parameter.value, rtol=1e-7, why="noise-free")
    assert "start-opened" in [finding.code for finding in fit.findings]


@pytest.mark.parametrize("bound", [cramer_rao, insensitivity])
def test_a_parameter_without_influence_is_named(bound: object) -> None:
    jacobian = np.array([[1.0, 0.0], [2.0, 0.0]])
    with pytest.raises(SingularError, match=r"found Nv; needed .* Next: fix it"):
        bound(jacobian, ["Lp", "Nv"])  # type: ignore[operator]
    with pytest.raises(SingularError, match="found parameter 2 of 2"):
        bound(jacobian)  # type: ignore[operator]


def test_a_model_without_kind_is_told_so() -> None:
    content = {key: value for key, value in MODEL.items() if key != "kind"}
    with pytest.raises(ModelError, match=r"does not say its kind.*kind = \"state-space\""):
        model_from_description(content)


def test_a_model_without_a_trim_is_told_which_states_stand_at_zero() -> None:
    falling = model_from_description(
        {
            "kind": "state-space",
            "name": "airspeed and path",
            "states": {"V": "m/s", "gamma": "rad"},
            "inputs": {"n": "1"},
            "outputs": {"V": "V"},
            "parameters": {"g": {"value": 9.81, "unit": "m/s^2"}},
            "equations": {"V'": "-g*sin(gamma)", "gamma'": "g*(n - cos(gamma))/V"},
        }
    )
    found = _without_point(falling)
    assert found is not None
    assert found.light is Light.AMBER
    assert "with V, gamma zero" in found.message
    assert "[trim]" in (found.action or "")
    assert isinstance(falling, fid.StateSpaceModel)
    assert _without_point(falling.linearise({"V": 60.0, "n": 1.0})) is None


def test_the_whole_file_of_the_guide_is_a_model() -> None:
    page = (Path(__file__).parents[2] / "docs" / "models.md").read_text(encoding="utf-8")
    whole = page.split("## A whole file")[1].split("```toml\n")[1].split("```")[0]
    assert model_from_description(tomllib.loads(whole)).inputs == ("lat",)
