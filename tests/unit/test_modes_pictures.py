"""The map of eigenvalues and what a report shows of modes."""

from __future__ import annotations

import numpy as np
import pytest

import flightid as fid
from flightid.errors import DataError
from flightid.plot.modes import pole_map
from flightid.plot.participations import participation_bars
from flightid.report.content import Document, Figure, Lights, TableBlock
from flightid.report.html import to_html
from flightid.report.modes import modes_blocks, physics_blocks
from flightid.study.identified import ModelFits, ModelResults
from flightid.study.model_section import model_section
from flightid.study.model_settings import ModelSettings
from tests.closeness import assert_close


def _fit() -> fid.Fit:
    truth = fid.load_model("fixed_wing_lateral")
    omega = np.geomspace(0.1, 25.0, 40)
    data = fid.FrequencyResponse.from_values(
        omega,
        truth.frequency_response(omega),
        inputs=truth.inputs,
        outputs=truth.outputs,
        units=truth.units,
        random_error=np.full((len(truth.outputs), 2, 40), 0.05),
    )
    return fid.identify(truth, data)


def test_regions_hold_95_percent_and_slow_modes_are_drawn_again() -> None:
    found = fid.modes(_fit())
    made = pole_map(found)
    markers = [t for t in made.data if t.mode == "markers"]
    assert len(markers) == 2
    assert len(markers[0].x) == 3
    assert len(markers[1].x) == 1
    assert_close(markers[1].x[0], found.modes[0].root.real, rtol=1e-12, why="the spiral again")
    (ellipse,) = [t for t in made.data if t.fill == "toself"]
    roll = found.mode("Dutch roll")
    away = np.array([ellipse.x, ellipse.y]) - np.array([[roll.root.real], [roll.root.imag]])
    assert roll.covariance is not None
    squares = np.einsum("an,ab,bn->n", away, np.linalg.inv(roll.covariance), away)
    assert_close(squares, -2.0 * np.log(0.05), rtol=1e-9, why="the 95 % quantile of chi-square 2")
    bars = [t for t in made.data if t.mode == "lines" and t.line.width == 5]
    assert_close(
        bars[0].x, found.modes[0].real.interval95, rtol=1e-12, why="a real eigenvalue has a bar"
    )


def test_the_bars_of_a_mode_are_its_participations() -> None:
    found = fid.modes(fid.load_model("fixed_wing_longitudinal"))
    made = participation_bars(found)
    phugoid = {
        trace.name: trace.x[0] for trace in made.data if list(trace.y) == [found.modes[0].name]
    }
    told = {each.state: 100.0 * (each.share.value or 0.0) for each in found.modes[0].participations}
    assert phugoid == pytest.approx({name: told[name] for name in phugoid})
    assert sum(phugoid.values()) > 90.0
    named = [trace.name for trace in made.data if trace.showlegend]
    assert len(named) == len(set(named)), "one entry of the legend a state"
    box = fid.PolynomialModel(("u",), "y", 0.1, a=[1.0, 0.5], b=[[1.0]])
    with pytest.raises(DataError, match="no mode tells"):
        participation_bars(fid.modes(box))


def test_several_models_share_one_map() -> None:
    both = {name: fid.modes(fid.load_model(name)) for name in ("r50_hover", "r50_cruise")}
    made = pole_map(both)
    assert {t.name for t in made.data if t.mode == "markers"} == set(both)
    symbols = {t.marker.symbol for t in made.data if t.mode == "markers"}
    assert len(symbols) == 2


def test_report_blocks() -> None:
    lights, table, figure, bars, parts = modes_blocks(fid.modes(fid.load_model("ah64_hover")))
    assert isinstance(lights, Lights)
    assert isinstance(table, TableBlock)
    assert isinstance(figure, Figure)
    assert isinstance(bars, Figure)
    assert isinstance(parts, TableBlock)
    assert parts.folded
    box = fid.PolynomialModel(("u",), "y", 0.1, a=[1.0, 0.5], b=[[1.0]])
    assert len(modes_blocks(fid.modes(box))) == 2


def test_physics_blocks_are_folded_and_may_be_missing() -> None:
    model = fid.load_model("fixed_wing_lateral")
    blocks = physics_blocks(fid.approximate_modes(model), fid.derivatives(model))
    tables = [block for block in blocks if isinstance(block, TableBlock)]
    assert len(tables) == 2
    assert all(table.folded for table in tables)
    assert isinstance(blocks[0], Lights)
    assert physics_blocks(None, None) == ()


@pytest.mark.parametrize(
    ("name", "there", "missing"),
    [
        ("fixed_wing_lateral", ["Modes of", "Approximate modes of", "Derivatives of"], []),
        ("quadrotor_yaw", ["Modes of", "Derivatives of"], []),
        ("rate_first_order", ["Modes of"], ["Derivatives of", "Approximate modes"]),
    ],
)
def test_studies_show_modes_of_every_kind_and_derivatives_of_equations(
    name: str, there: list[str], missing: list[str]
) -> None:
    truth = fid.load_model(name)
    omega = np.geomspace(0.1, 25.0, 40)
    exact = truth.frequency_response(omega)
    data = fid.FrequencyResponse.from_values(
        omega,
        exact,
        inputs=truth.inputs,
        outputs=truth.outputs,
        units=truth.units,
        random_error=np.full(exact.shape, 0.05),
    )
    settings = ModelSettings(name=name, template=name, identify=())
    fitted = ModelFits({"composite": fid.identify(truth, data)})
    item = ModelResults(settings, {"composite": data}, fitted=fitted)
    page = to_html(Document("study", "", (model_section(item, None),)))
    assert all(f"{title} {truth.name}" in page for title in there)
    assert not any(title in page for title in missing)
