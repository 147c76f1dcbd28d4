"""Published figures beside ours: ratios, what is absent, and files that cannot be read."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import flightid as fid
from flightid.errors import StudyError
from flightid.study.published import published_table, published_tables, read_published
from tests.closeness import assert_close

FIGURES = """
source = "a paper"
average_cost = 12.5
[value]
Ltphi = 70.0
[cramer_rao_percent]
Lp = {bound}
Ghost = 1.0
[insensitivity_percent]
Lp = 0.5
"""


@pytest.fixture(scope="module")
def fit() -> fid.Fit:
    model = fid.load_model("rate_first_order", axis="roll")
    omega = np.geomspace(0.5, 50.0, 30)
    data = fid.FrequencyResponse.from_values(
        omega, model.frequency_response(omega), inputs=model.inputs, outputs=model.outputs,
        units=model.units, random_error=np.full((1, 1, 30), 0.05),
    )  # fmt: skip
    return fid.identify(model, data, correct_bias=False)


def test_each_figure_has_its_ratio_to_ours(fit: fid.Fit, tmp_path: Path) -> None:
    bound = fit.parameters["Lp"].cramer_rao_percent
    assert bound is not None
    path = tmp_path / "figures.toml"
    path.write_text(FIGURES.format(bound=2.0 * bound), encoding="utf-8")
    table = published_table(read_published(path), fit)
    rows = {row[0]: dict(zip((c.name for c in table.columns), row, strict=True))
            for row in table.rows}  # fmt: skip
    assert set(rows) == {"Ltphi", "Lp"}
    assert_close(rows["Lp"]["CR ratio"], 0.5, rtol=1e-12, why="twice ours is published")
    assert rows["Lp"]["I"] == fit.parameters["Lp"].insensitivity_percent
    assert rows["Lp"]["published I"] == 0.5
    assert rows["Lp"]["value"] is None
    assert_close(rows["Ltphi"]["value ratio"], fit.parameters["Ltphi"].value / 70.0, rtol=1e-12,
                 why="ours over theirs")  # fmt: skip
    assert "not in this model: Ghost" in " ".join(table.notes)
    assert "published 12.5" in " ".join(table.notes)


def test_files_that_are_no_figures_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "figures.toml"
    with pytest.raises(StudyError, match="published figures cannot be read"):
        read_published(path)
    path.write_text("source = 3", encoding="utf-8")
    with pytest.raises(StudyError, match="source"):
        read_published(path)
    path.write_text('source = "a"\nluck = 1', encoding="utf-8")
    with pytest.raises(StudyError, match="there is no key 'luck'"):
        read_published(path)
    path.write_text('source = "a"\n[value]\nLp = "x"', encoding="utf-8")
    with pytest.raises(StudyError, match="Lp"):
        read_published(path)


ERRORS = """
source = "a paper"
[mean_square_error.training]
p = 0.1
ghost = 0.2
[mean_square_error.validation]
p = 0.3
[[remark]]
printed = "all errors below 0.002"
but = "0.1 and more"
"""


def test_mean_square_errors_stand_beside_ours(tmp_path: Path) -> None:
    time_s = 0.02 * np.arange(400)
    model = fid.load_model("rate_first_order", axis="roll")
    record, unseen = (
        fid.simulate(
            model,
            fid.Record.from_arrays(time_s, inputs={"tau_phi": np.sign(np.sin(rate * time_s))}),
            units={"p": "rad/s"}, noise=fid.Noise(sensor={"p": 0.05}, seed=3),
        )
        for rate in (3.0, 5.0)
    )  # fmt: skip
    fit = fid.identify(model, record)
    seen = fid.verify(fit, unseen)
    path = tmp_path / "figures.toml"
    path.write_text(ERRORS, encoding="utf-8")
    errors, remarks = published_tables(read_published(path), fit, {"doublet": seen})
    (row,) = errors.rows
    told = dict(zip((column.name for column in errors.columns), row, strict=True))
    assert (told["published training"], told["published validation"]) == (0.1, 0.3)
    assert_close(told["training, record"], np.mean(fit.records[0].residual("p") ** 2), rtol=1e-12,
                 why="one record")  # fmt: skip
    assert told["doublet"] == seen.mse["p"]
    assert remarks.rows == (("all errors below 0.002", "0.1 and more"),)


def test_errors_of_another_kind_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "figures.toml"
    path.write_text('source = "a paper"\n[mean_square_error.test]\np = 1.0\n', encoding="utf-8")
    with pytest.raises(StudyError, match="there is no key 'test'"):
        read_published(path)
