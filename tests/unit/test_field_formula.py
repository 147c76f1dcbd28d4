"""Formulas of a log's fields: the grammar of studies, on the stamps of the log."""

from __future__ import annotations

import numpy as np
import pytest

import flightid as fid
from flightid.errors import FlightidError
from flightid.logs import Log
from flightid.logs.field_formula import field_formula
from flightid.logs.field_plot import field_plot
from tests.sweep_log import SweepFlight


@pytest.fixture(scope="module")
def log(tmp_path_factory: pytest.TempPathFactory) -> Log:
    flight = SweepFlight(sweep_s=4.0, rate_hz=50.0)
    return fid.read_log(flight.write(tmp_path_factory.mktemp("log")))


def test_a_formula_is_worked_out_on_the_stamps_of_its_first_field(log: Log) -> None:
    rates, motors = log.table("RATE"), log.table("RCOU")
    made = field_formula(log, "RATE.R - 2*RATE.RDes")
    np.testing.assert_array_equal(made.values, rates["R"] - 2.0 * rates["RDes"])
    assert made.unit == rates.unit("R")
    assert made.fields == ("RATE.R", "RATE.RDes")
    # Another message is read by straight lines between its samples, never beyond them.
    mixed = field_formula(log, "where(RATE.R > 0, RCOU.C1, RCOU.C2)")
    between = np.interp(rates.time_s, motors.time_s, motors["C1"], left=np.nan, right=np.nan)
    up = (rates["R"] > 0.0) & np.isfinite(mixed.values)
    assert up.any()
    np.testing.assert_allclose(mixed.values[up], between[up])
    # What is no number is a gap.
    assert np.isnan(field_formula(log, "RATE.R / (RATE.R - RATE.R)").values).all()


@pytest.mark.parametrize(
    ("formula", "said"),
    [
        ("RATE.R +", "this is no formula of fields"),
        ("roll + 1", "names its fields with their message"),
        ("1 + 2", "found no field"),
        ("NONE.R", "the log holds no such message"),
        ("RATE.Nothing", "Nothing"),
        ("RATE.R + RCOU.C1", "does not have one unit"),
        ("RATE.R + " * 100 + "1", "letters"),
    ],
)
def test_what_cannot_be_plotted_says_why(log: Log, formula: str, said: str) -> None:
    with pytest.raises(FlightidError, match=said):
        field_formula(log, formula)


def test_figures_of_a_field_have_six_digits(log: Log) -> None:
    values = log.table("RATE")["R"]
    said = field_plot(log, ["RATE.R"]).summary().to_text()
    figures = values.min(), values.mean(), values.max(), np.sqrt(np.mean(values**2))
    for figure in figures:
        assert f"{figure:.6g}" in said
