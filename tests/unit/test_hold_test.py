"""Where no record knows its hold: what is said, and how it colours the light."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import flightid as fid
from flightid.identification.hold_test import OtherHold, judged
from flightid.models import load_model
from tests.strangers import holds


def _fit(shape: str, *, told: bool, method: str = "output_error") -> fid.Fit:
    return fid.identify(holds.model(), holds.flight(0, shape, told=told), method=method)


@pytest.mark.parametrize(
    ("shape", "light", "code"),
    [
        ("steps", "amber", "hold-unknown"),
        ("held", "amber", "hold-unknown"),
        ("straight", "green", "hold-supported"),
        ("smooth", "amber", "hold-contradicted"),
    ],
)
def test_an_unknown_hold_is_never_silent(shape: str, light: str, code: str) -> None:
    fit = _fit(shape, told=False)
    check = fit.evidence.check("input hold")
    assert check is not None
    assert str(check.light) == light
    assert code in [each.code for each in fit.findings]
    others = fit.provenance["other_holds"]
    assert isinstance(others, dict)
    assert others["zero"]["parameter"] == "tau"


def test_a_known_hold_is_not_examined() -> None:
    fit = _fit("steps", told=True)
    assert fit.evidence.check("input hold") is None
    assert "other_holds" not in fit.provenance


def test_steps_are_found_by_what_they_leave() -> None:
    fit = _fit("held", told=False, method="fourier_output_error")
    said = next(each for each in fit.findings if each.code == "hold-contradicted")
    assert "hold='zero'" in said.action


def test_a_hold_that_moves_nothing_is_green() -> None:
    found = judged([OtherHold("zero", "tau", 0.1, None)], "band_limited")
    assert str(found.light) == "green"
    asked = judged([OtherHold("zero", "tau", 4.0, None)], "band_limited")
    assert str(asked.light) == "amber"
    assert "4 standard errors" in asked.message


@pytest.mark.parametrize("shape", ["steps", "straight", "smooth"])
def test_verify_and_predict_take_the_hold_of_the_fit(shape: str, tmp_path: Path) -> None:
    fit = _fit(shape, told=True)
    unseen, known = holds.flight(1, shape, told=False), holds.flight(1, shape, told=True)
    wanted = fid.verify(fit, known)
    model = load_model(fid.write_model(fit, tmp_path / "fit.toml"))
    for source in (fit, model):
        found = fid.verify(source, unseen)
        assert found.hold == known.hold
        assert found.theil == wanted.theil
        assert not [each for each in found.findings if each.code.startswith("hold-")]
        run = fid.predict(source, unseen)
        assert np.array_equal(run.predicted["q"], fid.predict(source, known).predicted["q"])


def test_a_black_box_has_no_hold_to_forget() -> None:
    structure = fid.PolynomialModel.arx(("de",), "q", na=2, nb=2, nk=1)
    fit = fid.identify(structure, holds.flight(0, "steps", told=False))
    assert fit.evidence.check("input hold") is None


def test_bars_reach_what_an_unknown_hold_decides() -> None:
    told, untold = (
        _fit("steps", told=each, method="equation_error").parameters["tau"]
        for each in (True, False)
    )
    low, high = untold.interval95
    assert low < holds.TRUTH["tau"] < high
    assert untold.stderr > 3.0 * told.stderr
