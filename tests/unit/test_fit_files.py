"""Fitted models as files: covariance, evidence and provenance come back with them."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

import flightid as fid
from flightid.errors import DataError, ModelError
from flightid.evidence import Evidence
from flightid.identification import uncertain_of
from flightid.identification.withheld_intervals import without_intervals
from flightid.models.kinds import model_from_description, model_to_description
from flightid.result import Result
from tests.contract.test_kinds import STRUCTURES, fit

KINDS = [kind for kind in STRUCTURES if kind != "NARX"]


@pytest.mark.parametrize("kind", STRUCTURES)
def test_what_a_fit_knew_comes_back(kind: str, tmp_path: Path) -> None:
    made = fit(kind)
    back = fid.load_model(fid.write_model(made, tmp_path / "model.toml"))
    assert back.estimated is not None
    assert back.estimated.method == made.method
    assert back.estimated.provenance["data_sha256"] == made.provenance["data_sha256"]
    assert Evidence.from_dict(back.estimated.evidence).light is made.evidence.light
    before, after = uncertain_of(made), uncertain_of(back)
    if made.covariance is None:
        assert after.covariance is None
        return
    np.testing.assert_array_equal(after.covariance, before.covariance)
    again = fid.load_model(fid.write_model(back, tmp_path / "again.toml"))
    np.testing.assert_array_equal(uncertain_of(again).covariance, before.covariance)


@pytest.mark.parametrize("kind", KINDS)
def test_modes_of_the_file_have_the_intervals_of_the_fit(kind: str, tmp_path: Path) -> None:
    made = fit(kind)
    back = fid.load_model(fid.write_model(made, tmp_path / "model.toml"))
    of_fit, of_file = (fid.modes(source).modes for source in (made, back))
    for mine, theirs in zip(of_file, of_fit, strict=True):
        assert mine.real.interval95 == theirs.real.interval95


def test_margins_and_matrices_of_the_file_are_as_uncertain(tmp_path: Path) -> None:
    made = fit("transfer")
    back = fid.load_model(fid.write_model(made, tmp_path / "model.toml"))
    assert fid.margins(back).phase_margin.stderr == fid.margins(made).phase_margin.stderr
    assert fid.export(back, tmp_path / "model.mat").files


@pytest.mark.parametrize(
    ("kind", "withheld", "level"),
    [
        ("grey linear", False, 0.95),
        ("grey linear", True, 0.8),
        ("transfer", False, 0.8),
        ("transfer", True, 0.95),
    ],
)
def test_a_fit_and_its_file_print_the_same_tables(
    kind: str, withheld: bool, level: float, tmp_path: Path
) -> None:
    made = fit(kind)
    if withheld:
        made = without_intervals(made, "inputs are left in the errors")
    back = fid.load_model(fid.write_model(made, tmp_path / "model.toml"))
    verbs: dict[str, Callable[[object], Result]] = {
        "modes": fid.modes,
        "margins": fid.margins,
        "compare": lambda it: fid.compare_conditions({"it": it, "flown": made}),
    }
    if kind != "transfer":
        verbs["derivatives"] = fid.derivatives
    for name, verb in verbs.items():
        of_fit, of_file = (each.summary(level=level).to_text() for each in (verb(made), verb(back)))
        assert of_file == of_fit, name
        assert ("inputs are left in the errors" in of_file) is withheld, name


def test_changed_numbers_are_no_fits_any_more(tmp_path: Path) -> None:
    back = fid.load_model(fid.write_model(fit("grey linear"), tmp_path / "model.toml"))
    assert back.with_values({"Lp": -9.0}).estimated is None
    assert uncertain_of(back.with_values({"Lp": -9.0})).covariance is None


@pytest.mark.parametrize(
    ("change", "problem"),
    [
        ({"names": ["Lp", "stray"]}, "names no parameter"),
        ({"covariance": [[1.0]]}, "does not fit the names"),
        ({"covariance": [[1.0, 0.0], [5.0, 1.0]]}, "no covariance"),
        ({"covariance": [[-1.0, 0.0], [0.0, 1.0]]}, "no covariance"),
        ({"bands": {"p/tau_phi": [1.0]}}, "two frequencies"),
        ({"secret": 1}, "unknown key"),
    ],
)
def test_a_file_that_contradicts_itself_is_refused(change: dict, problem: str) -> None:
    content = model_to_description(fit("grey linear"))
    content["estimated"] = {**content["estimated"], **change}
    with pytest.raises(ModelError, match=problem):
        model_from_description(content)


def test_evidence_that_was_changed_by_hand_is_refused() -> None:
    for values in ({}, {"checks": [3], "required": []}, {"checks": [{"name": "x"}]}):
        with pytest.raises(DataError, match="no evidence"):
            Evidence.from_dict(values)
