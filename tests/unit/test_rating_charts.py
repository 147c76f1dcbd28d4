"""Charts of levels: the printed tables, levels with doubt, and files that are none."""

from __future__ import annotations

import json
from itertools import product
from pathlib import Path

import numpy as np
import pytest

from flightid.dynamics import RatingChart, rate, rating_chart, rating_charts
from flightid.dynamics.handling_qualities.rating import normal_draws
from flightid.errors import DataError, FileFormatError, OptionError, UnknownNameError
from tests.closeness import assert_close

CLASSES = ("I", "II-L", "II-C", "III", "IV")
# MIL-F-8785C, table VII: category, classes, then the longest time constant of levels 1, 2, 3.
ROLL_MODE = (
    ("A", ("I", "IV"), (1.0, 1.4, 10.0)),
    ("A", ("II-L", "II-C", "III"), (1.4, 3.0, 10.0)),
    ("B", CLASSES, (1.4, 3.0, 10.0)),
    ("C", ("I", "II-C", "IV"), (1.0, 1.4, 10.0)),
    ("C", ("II-L", "III"), (1.4, 3.0, 10.0)),
)
# Table VI: category, classes, then ζ, ζω, ω of level 1; levels 2 and 3 are the same for all.
DUTCH_ROLL = (
    ("A", ("I", "IV"), (0.19, 0.35, 1.0)),
    ("A", ("II-L", "II-C", "III"), (0.19, 0.35, 0.4)),
    ("B", CLASSES, (0.08, 0.15, 0.4)),
    ("C", ("I", "II-C", "IV"), (0.08, 0.15, 1.0)),
    ("C", ("II-L", "III"), (0.08, 0.10, 0.4)),
)
SPIRAL = {"A": (12.0, 8.0, 4.0), "B": (20.0, 8.0, 4.0), "C": (12.0, 8.0, 4.0)}
SHORT_PERIOD = {"A": (0.35, 1.3, 0.25, 2.0), "B": (0.3, 2.0, 0.2, 2.0), "C": (0.35, 1.3, 0.25, 2.0)}


def chart_for(key: str, category: str, vehicle: str = "I") -> RatingChart:
    return rating_chart(key, category=category, **{"class": vehicle})


def level(chart: RatingChart, **values: float) -> int:
    return rate(chart, values).level


@pytest.mark.parametrize("row", ROLL_MODE)
def test_roll_mode_table(row: tuple[str, tuple[str, ...], tuple[float, ...]]) -> None:
    category, classes, limits = row
    for vehicle in classes:
        chart = chart_for("roll_mode", category, vehicle)
        for place, limit in enumerate(limits, start=1):
            assert level(chart, time_constant=limit) == place
            assert level(chart, time_constant=limit * 1.0001) == place + 1
        assert level(chart, time_constant=np.inf) == 4


@pytest.mark.parametrize("row", DUTCH_ROLL)
def test_dutch_roll_table(row: tuple[str, tuple[str, ...], tuple[float, ...]]) -> None:
    category, classes, (damping, decay, frequency) = row
    for vehicle in classes:
        chart = chart_for("dutch_roll", category, vehicle)
        plenty = {"damping": 0.5, "decay": 2.0, "frequency": 4.0}
        assert level(chart, **plenty) == 1
        for name, least in (("damping", damping), ("decay", decay), ("frequency", frequency)):
            assert level(chart, **{**plenty, name: least}) == 1
            assert level(chart, **{**plenty, name: least - 1e-6}) == (
                4 if name == "frequency" and least == 0.4 else 2
            )
        assert level(chart, damping=0.02, decay=0.05, frequency=0.4) == 2
        assert level(chart, damping=0.019, decay=0.05, frequency=0.4) == 3
        assert level(chart, damping=0.02, decay=0.049, frequency=0.4) == 3
        assert level(chart, damping=-0.01, decay=-0.1, frequency=2.0) == 4


@pytest.mark.parametrize("category", "ABC")
def test_spiral_short_period_and_phugoid(category: str) -> None:
    for vehicle in CLASSES:
        spiral = chart_for("spiral", category, vehicle)
        for place, least in enumerate(SPIRAL[category], start=1):
            assert level(spiral, time_to_double=least) == place
            assert level(spiral, time_to_double=least - 1e-6) == place + 1
        assert level(spiral, time_to_double=np.inf) == 1
        short = chart_for("short_period_damping", category, vehicle)
        low, high, lower, higher = SHORT_PERIOD[category]
        assert level(short, damping=low) == level(short, damping=high) == 1
        assert level(short, damping=lower) == 2
        assert level(short, damping=higher) == (1 if category == "B" else 2)
        assert level(short, damping=lower - 1e-6) == level(short, damping=higher + 0.1) == 3
        assert level(short, damping=0.149) == 4
    phugoid = chart_for("phugoid", category)
    assert level(phugoid, damping=0.04, time_to_double=np.inf) == 1
    assert level(phugoid, damping=0.0, time_to_double=np.inf) == 2
    assert level(phugoid, damping=-0.01, time_to_double=55.0) == 3
    assert level(phugoid, damping=-0.01, time_to_double=54.0) == 4


def test_control_anticipation_and_its_lines() -> None:
    for category, first, second in (("A", 0.28, 0.16), ("B", 0.085, 0.038), ("C", 0.16, 0.05)):
        chart = chart_for("control_anticipation", category)
        well = {"damping": 0.7, "frequency": 3.0}
        assert level(chart, cap=first, **well) == level(chart, cap=3.6, **well) == 1
        assert level(chart, cap=second, **well) == level(chart, cap=10.0, **well) == 2
        assert level(chart, cap=10.1, **well) == 3
    slow = {"damping": 0.7, "cap": 1.0}
    fast = chart_for("control_anticipation", "A")
    assert [level(fast, frequency=omega, **slow) for omega in (1.0, 0.99, 0.59)] == [1, 2, 3]


def test_delay_and_bandwidth() -> None:
    delay = rating_chart("equivalent_delay")
    assert [level(delay, delay=t) for t in (0.0, 0.1, 0.101, 0.2, 0.25, 0.26)] == [1, 1, 2, 2, 3, 4]
    yaw = rating_chart("attitude_bandwidth", axis="yaw", task="tracking", speed="hover")
    found = rate(yaw, {"bandwidth": 3.5, "phase_delay": 0.05})
    assert (found.level, found.text) == (1, "Level 1")
    late = rate(yaw, {"bandwidth": 5.0, "phase_delay": 0.2})
    assert late.text == "at best Level 1"
    assert late.findings[0].light.value == "amber"
    assert rate(yaw, {"bandwidth": 0.4, "phase_delay": 0.05}).text == "Level 3"
    fighter = rating_chart("pitch_bandwidth", category="A")
    assert level(fighter, bandwidth=6.6, phase_delay=0.02) == 1
    assert level(fighter, bandwidth=6.6, phase_delay=0.0375) == 2
    assert level(fighter, bandwidth=20.0, phase_delay=0.061) == 2
    assert level(fighter, bandwidth=0.9, phase_delay=0.0) == 3


def test_every_case_is_found_once_and_every_number_is_finite_somewhere() -> None:
    table = rating_charts()
    keys = [str(row[0]) for row in table.rows]
    assert len(set(keys)) == len(keys) >= 10
    ways = {
        "category": "ABC",
        "class": CLASSES,
        "axis": ("roll", "pitch", "yaw"),
        "task": ("tracking", "other"),
        "speed": ("hover", "forward"),
        "attention": ("full", "divided"),
    }
    for key in keys:
        told = set()
        for values in product(*ways.values()):
            conditions = dict(zip(ways, values, strict=True))
            if key == "pitch_bandwidth" and conditions["category"] != "A":
                continue
            chart = rating_chart(key, **conditions)
            assert chart.source
            assert chart.regions
            if chart.regions not in told:
                json.dumps(chart.to_dict(), allow_nan=False)
            told.add(chart.regions)
    assert "Boundaries not confirmed" in str(
        rating_chart("attitude_bandwidth", axis="yaw", task="other", speed="hover").summary()
    )


def test_levels_with_doubt() -> None:
    chart = chart_for("roll_mode", "A")
    values, covariance = np.array([0.98]), np.array([[0.02**2]])
    drawn = normal_draws(values, covariance)
    assert drawn is not None
    found = rate(chart, {"time_constant": 0.98}, {"time_constant": drawn[0]}, subject="p/lat")
    assert found.probabilities is not None
    # P(x > 1) for one standard deviation.
    assert_close(found.probabilities[1], 0.158655, atol=0.018, why="4000 draws, three deviations")
    assert found.text == "Level 1–2"
    assert "p/lat: Level 1–2 by MIL-F-8785C" in str(found.findings[0])
    far = rate(chart, {"time_constant": 9.9}, {"time_constant": 9.9 + 3.0 * (drawn[0] - 0.98)})
    assert far.text == "Level 3 or worse"
    assert far.findings[0].light.value == "red"
    sure = rate(chart, {"time_constant": 0.5}, {"time_constant": drawn[0] - 0.48})
    assert (sure.text, sure.findings[0].light.value) == ("Level 1", "green")
    assert repr(sure) == "Rating(Roll mode: Level 1)"
    json.dumps(far.to_dict(), allow_nan=False)
    assert normal_draws(values, None) is None
    assert normal_draws(values, [[np.nan]]) is None


def test_two_numbers_are_drawn_together() -> None:
    covariance = np.array([[0.04, -0.018], [-0.018, 0.01]])
    drawn = normal_draws([1.0, 2.0], covariance)
    assert drawn is not None
    assert_close(np.cov(drawn), covariance, atol=0.003, why="4000 draws")
    assert_close(drawn.mean(axis=1), [1.0, 2.0], atol=0.015, why="4000 draws")


def test_refusals() -> None:
    with pytest.raises(UnknownNameError, match="there is no such chart"):
        rating_chart("cooper_harper")
    with pytest.raises(OptionError, match="no case of 'Roll mode' fits"):
        rating_chart("roll_mode", category="D")
    with pytest.raises(UnknownNameError, match="needs another quantity"):
        rate(chart_for("dutch_roll", "A"), {"damping": 0.2})
    with pytest.raises(DataError, match="a value is not a number"):
        rate(chart_for("roll_mode", "A"), {"time_constant": np.nan})


GOOD = """
[[chart]]
key = "own"
standard = "our yard"
title = "Bandwidth"
source = "experience"
confirmed = true
quantities.bandwidth = { label = "bandwidth", unit = "rad/s" }
quantities.delay = { label = "delay", unit = "s" }
axes = ["bandwidth", "delay"]
[[chart.case]]
when = {}
levels = [{ boundary = [[2, 0], [2, 0.1], [4, 0.3]] }, { bandwidth = [1, inf] }]
"""


def test_a_chart_of_ones_own(tmp_path: Path) -> None:
    path = tmp_path / "own.toml"
    path.write_text(GOOD)
    chart = rating_chart("own", path=path)
    assert level(chart, bandwidth=3.0, delay=0.19) == 1
    assert level(chart, bandwidth=3.0, delay=0.21) == 2
    assert level(chart, bandwidth=9.0, delay=0.31) == 2
    assert level(chart, bandwidth=0.5, delay=0.0) == 3
    assert [row[0] for row in rating_charts(path).rows] == ["own"]


@pytest.mark.parametrize(
    ("old", "new", "match"),
    [
        ('title = "Bandwidth"', "", "a chart without title"),
        ("confirmed = true", 'confirmed = "yes"', "confirmed is neither"),
        (', unit = "s" }', " }", "quantities need label and unit"),
        ('axes = ["bandwidth", "delay"]', 'axes = ["bandwidth"]', "axes are two"),
        ("when = {}", "when = 1", "a case without when"),
        ("[[2, 0], [2, 0.1], [4, 0.3]]", "[[2, 0.1], [2, 0]]", "a boundary is pairs"),
        ("[[2, 0], [2, 0.1], [4, 0.3]]", "[[2, 0], 3]", "a boundary is pairs"),
        ("{ bandwidth = [1, inf] }", "{ bandwidth = [1] }", r"needs \[lowest, highest\]"),
        ("{ bandwidth = [1, inf] }", "{ bandwidth = [nan, 1] }", r"needs \[lowest, highest\]"),
        ("{ bandwidth = [1, inf] }", "{ width = [1, 2] }", "is none of its quantities"),
        ("[[chart.case]]", "[chart.case]", "its cases or its levels are missing"),
        ("[[chart]]", "[chart", "rating charts is no TOML"),
    ],
)
def test_files_that_are_none(old: str, new: str, match: str, tmp_path: Path) -> None:
    assert old in GOOD
    path = tmp_path / "own.toml"
    path.write_text(GOOD.replace(old, new))
    with pytest.raises(FileFormatError, match=match):
        rating_chart("own", path=path)


def test_a_file_that_is_missing_or_huge(tmp_path: Path) -> None:
    with pytest.raises(FileFormatError, match="not a chart file"):
        rating_charts(tmp_path / "none.toml")
    huge = tmp_path / "huge.toml"
    huge.write_bytes(b"#" * ((1 << 20) + 1))
    with pytest.raises(FileFormatError, match="more than 1048576 bytes"):
        rating_charts(huge)
