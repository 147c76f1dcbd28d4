"""Lights of strangers' records: what nobody takes bears witness, ends off a minimum rank last."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

import flightid as fid
from flightid.conventions import Light
from flightid.findings import Finding
from flightid.record.checks import record_findings
from flightid.study.stages import NOT_TESTED, examine_residuals
from flightid.validation.order_scan.result import OrderTrial, rank_of
from flightid.validation.verification.of_the_fit import gust_errors, weighed
from tests.closeness import assert_close

TIME_S = np.arange(600) / 50.0


@pytest.mark.parametrize(("taken", "wrong"), [("p", True), ("phi", True), ("p", False)])
def test_a_channel_that_nobody_takes_tells_the_units(
    tmp_path: Path, taken: str, *, wrong: bool
) -> None:
    rate = np.cos(2.0 * TIME_S) * (180.0 / np.pi if wrong else 1.0)
    rows = np.column_stack([TIME_S, np.sin(TIME_S), rate, 0.5 * np.sin(2.0 * TIME_S)])
    heading = "time [s],da [rad],p [rad/s],phi [rad]"
    np.savetxt(tmp_path / "roll.csv", rows, "%.9g", ",", header=heading, comments="")
    (record,) = fid.read_records(tmp_path / "roll.csv", "da", taken)
    said = [each.code for each in record_findings(record, ["da", taken])]
    assert ("units-swapped" in said) is wrong


def test_a_fit_that_ended_at_no_minimum_ranks_behind_all_others() -> None:
    asked = fid.PolynomialModel.oe("u", "y", nb=1, nf=1)
    stalled = OrderTrial(asked, None, None, 0.1, 90.0, settled=False)
    settled = OrderTrial(asked, None, None, 0.2, 80.0)
    failed = OrderTrial(asked, None, None, None, None, "diverged")
    assert sorted([failed, stalled, settled], key=rank_of) == [settled, stalled, failed]


@pytest.mark.parametrize(
    ("error", "own", "light"),
    [(1.1, {"y": 1.0}, Light.AMBER), (1.3, {"y": 1.0}, Light.RED), (1.1, {}, Light.RED)],
)
def test_a_prediction_as_good_as_the_fit_is_not_red(
    error: float, own: dict[str, float], light: Light
) -> None:
    found = weighed({"y": Finding("theil", Light.RED, "y", "look")}, {"y": error}, own)
    assert found["y"].light is light


def test_too_few_samples_for_residual_tests_end_no_study() -> None:
    u, noise = np.random.default_rng(0).standard_normal((2, 30))
    record = fid.Record.from_arrays(
        TIME_S[:30], inputs={"u": u}, outputs={"y": 0.1 * noise + np.roll(u, 1)}
    )
    fit = fid.identify(fid.PolynomialModel.arx("u", "y", na=1, nb=1), record)
    found = examine_residuals(fit)
    assert isinstance(found, Finding)
    assert (found.code, found.light) == (NOT_TESTED, Light.UNKNOWN)


def test_process_noise_of_a_fit_is_known_to_its_free_runs() -> None:
    lag = fid.StateSpaceModel(
        states={"p": "rad/s"},
        input_units={"u": "rad"},
        measurements={"p": fid.Output("p", "rad/s")},
        equations={"p'": "Lp*p + Lu*u"},
        parameters=fid.Parameters(
            [fid.Parameter("Lp", -2.0, "1/s"), fid.Parameter("Lu", 1.0, "1/s^2")]
        ),
    )
    fit = SimpleNamespace(provenance={"process_noise": {"p": 0.3}, "gust": None})
    # dp = -2 p dt + 0.3 dw: the variance 0.0225 (1 - exp(-4 t)), averaged over 5 s.
    mean = 0.0225 * (1.0 - (1.0 - np.exp(-20.0)) / 20.0)
    found = gust_errors(fit, lag, [5.0, 5.0])["p"]
    assert_close(found, np.sqrt(mean), rtol=5e-3, why="a hundred steps")
    assert gust_errors(SimpleNamespace(provenance={}), lag, [5.0]) == {}
    # Each run counts by its own length: that of 1 ms has no time to leave its start.
    both = gust_errors(fit, lag, [5.0, 0.001])["p"]
    assert_close(both, found, rtol=1e-3, why="by time")
    # A run that grows is excused as one that grows by e: 0.09 (exp(0.4 t) - 1)/0.4 over 5 s.
    grown = gust_errors(fit, lag.with_values({"Lp": 0.5}), [5.0])["p"]
    mean = 0.225 * ((np.exp(2.0) - 1.0) / 2.0 - 1.0)
    assert_close(grown, np.sqrt(mean), rtol=2e-2, why="a hundred steps")
    # A gust of 0.5 rad/s and 2 s, felt as p is: variance 0.25 * 2 / (2 + 1/2).
    gust = {"state": "p", "deviation": 0.5, "time_s": 2.0, "outputs": []}
    fit.provenance.update(process_noise={}, gust=gust)
    felt = gust_errors(fit, lag, [1000.0])["p"]
    assert_close(felt, np.sqrt(0.2), rtol=1e-3, why="the start's transient")
