"""One class for every estimated number, and one place for its quantiles."""

from __future__ import annotations

import numpy as np
import pytest

from flightid.errors import OptionError
from flightid.uncertainty.estimate import Estimate, estimate_table
from flightid.uncertainty.quantiles import half_width, interval_words, tails, two_sided_chance
from flightid.uncertainty.uncertain import Uncertain, uncertain_numbers
from flightid.uncertainty.uneven import DrawnEnds, LogarithmicEnds, drawn_estimate, turned
from tests.closeness import assert_close


def test_quantiles_are_those_of_the_tables() -> None:
    assert_close(half_width(0.95), 1.959963984540054, rtol=1e-14, why="normal table")
    assert_close(half_width(0.99), 2.575829303548901, rtol=1e-14, why="normal table")
    assert_close(half_width(0.95, 5.0), 2.570582, rtol=1e-6, why="Student's table, 5 degrees")
    assert half_width(0.95, float("inf")) == half_width(0.95)
    assert tails(0.95) == (0.025, 0.975)
    assert_close(two_sided_chance(-half_width(0.9)), 0.1, rtol=1e-12, why="inverse")
    assert interval_words(0.999) == "99.9 %"


@pytest.mark.parametrize("level", [0.0, 1.0, 95.0, float("nan")])
def test_a_level_is_a_probability(level: float) -> None:
    with pytest.raises(OptionError, match="level of an interval is a probability"):
        half_width(level)
    with pytest.raises(OptionError, match="level of an interval is a probability"):
        estimate_table("t", [Estimate("a", 1.0, "1", 0.1)], level=level)


def test_freedom_is_positive() -> None:
    with pytest.raises(OptionError, match="degrees of freedom"):
        half_width(0.95, 0.0)


def test_intervals_follow_level_and_freedom() -> None:
    even = Estimate("a", 10.0, "m", 1.0)
    assert_close(even.interval95, (8.040036, 11.959964), rtol=1e-6, why="z")
    assert_close(even.interval(0.99), (7.424171, 12.575829), rtol=1e-6, why="z")
    few = Estimate("a", 10.0, "m", 1.0, freedom=5.0)
    assert_close(few.half_width95, 2.570582, rtol=1e-6, why="Student")
    assert even.is_significant
    assert not Estimate("a", 1.0, "m", 1.0).is_significant
    assert Estimate("a", None, reason="no crossing").interval95 is None


def test_uneven_intervals_follow_the_level_too() -> None:
    rate = Estimate("rate", -2.0, "rad/s", 0.5)
    half = turned("time to half", "s", -np.log(2.0), rate, "no sign")
    low, high = rate.interval(0.8)
    assert_close(half.interval(0.8), (-np.log(2) / low, -np.log(2) / high), rtol=1e-12, why="1/x")
    assert_close(half.stderr, np.log(2) / 4 * 0.5, rtol=1e-12, why="first order")
    lost = turned("time", "s", 1.0, Estimate("rate", 1.0, "1/s", 0.6), "no sign")
    assert (lost.interval95, lost.reason) == (None, "no sign")
    drawn = drawn_estimate("x", 0.0, "1", np.linspace(-1.0, 1.0, 2001), "")
    assert_close(drawn.interval(0.5), (-0.5, 0.5), atol=1e-12, why="quartiles")
    endless = drawn_estimate("x", 0.0, "1", [0.0, np.inf, np.inf], "no end", "inverted_cdf")
    assert (endless.interval95, endless.reason) == (None, "no end")
    ends = LogarithmicEnds(2.0, 0.1)(0.95)
    assert_close(ends[0] * ends[1], 4.0, rtol=1e-12, why="even in the logarithm")


def test_scaling_keeps_what_is_known() -> None:
    known = Estimate("Lp", -5.0, "1/s", 0.1, freedom=8.0, status="free", cramer_rao_percent=2.0)
    turned_over = known.scaled(-2.0, name="Clp", unit="1")
    assert (turned_over.value, turned_over.stderr, turned_over.freedom) == (10.0, 0.2, 8.0)
    assert (turned_over.status, turned_over.cramer_rao_percent) == ("", None)
    uneven = Estimate("t", 1.0, "s", ends=DrawnEnds(np.linspace(0.0, 3.0, 2001)))
    low, high = uneven.scaled(-1.0).interval95
    assert_close((low, high), (-2.925, -0.075), rtol=1e-12, why="ends change places")
    fixed = Estimate("M", 1.0, status="fixed")
    assert fixed.as_reading().reason == "fixed"
    none = Estimate("margin", None, "dB", None, "no crossing").scaled(2.0, unit="1")
    assert (none.value, none.unit, none.reason) == (None, "1", "no crossing")


def test_plain_values_say_all() -> None:
    found = Estimate("Lp", -5.0, "1/s", 0.1, status="free", insensitivity_percent=1.5).to_dict()
    assert found["interval95"] == pytest.approx([-5.19599640, -4.80400360])
    assert (found["status"], found["insensitivity_percent"]) == ("free", 1.5)
    assert "status" not in Estimate("margin", 4.0).to_dict()


def test_tables_print_the_level() -> None:
    table = estimate_table("t", [Estimate("a", 1.0, "1", 0.1)], level=0.9)
    assert [c.name for c in table.columns if "90 %" in c.name] == ["90 % low", "90 % high"]
    assert table.rows[0][2:] == pytest.approx((0.835515, 1.164485), rel=1e-5)


def test_a_number_that_is_lost_stays_lost() -> None:
    """What one standard error makes undetermined leaves its mark on all that rests on it."""
    covariance = np.array([[0.04, np.nan], [np.nan, np.nan]])
    pair = uncertain_numbers([2.0, 3.0], covariance)
    found = pair.carried(lambda x: [x[0] * 2.0, x[0] + x[1]])
    assert_close(found.stderr[0], 0.4, rtol=1e-12, why="does not use the lost number")
    assert "within its uncertainty" in found.number(1, "sum").reason
    assert Uncertain.exact(3.0, "typed in").carried(lambda x: x).number(0, "x").reason == "typed in"
