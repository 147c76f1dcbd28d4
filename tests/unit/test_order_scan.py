"""Scan of orders: ranking, agreement with full fits, refusals."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import lfilter

import flightid as fid
from flightid.errors import DataError, FitError, OptionError
from flightid.plot import polynomial as plot
from tests.closeness import assert_close
from tests.polynomial_records import ARMAX, flown

P = fid.PolynomialModel
RANGES = {"na": range(1, 4), "nb": range(1, 4), "nc": range(1, 3), "nk": range(1, 3)}


@pytest.fixture(scope="module")
def scan():
    return fid.scan_orders(
        flown(ARMAX, 0, n=1500, noise=0.3), flown(ARMAX, 1, n=800, noise=0.3), **RANGES
    )


def test_the_true_orders_are_found(scan):
    assert len(scan.trials) == 36
    assert scan.smallest("bic").structure.orders_text == "na 2, nb 2, nc 2, nk 1"
    simple = scan.simplest.structure
    assert (simple.na, simple.nb, simple.nk) == (2, (2,), (1,))
    errors = [t.free_run_rms for t in scan.trials if t.free_run_rms is not None]
    assert errors == sorted(errors)
    assert scan.best.structure.orders_text == scan.trials[0].structure.orders_text


def test_scanned_models_agree_with_full_fits(scan):
    trial = next(t for t in scan.trials if t.structure.orders_text == "na 2, nb 2, nc 2, nk 1")
    fit = fid.identify(trial.structure, flown(ARMAX, 0, n=1500, noise=0.3))
    errors = np.array([p.stderr for p in fit.parameters.values()])
    assert np.all(np.abs(trial.model.theta - fit.model.theta) < 0.3 * errors)
    assert_close(
        trial.criteria.loss, fit.details.criteria.loss, rtol=5e-3, why="other first samples"
    )


def test_the_free_run_of_the_scan_is_that_of_the_model(scan):
    trial = next(t for t in scan.trials if t.structure.orders_text == "na 2, nb 2, nc 1, nk 1")
    unseen = flown(ARMAX, 1, n=800, noise=0.3)
    made = fid.predict(trial.model, unseen)
    assert made.start == 80, "a tenth of the record tells the start of every structure"
    assert_close(trial.free_run_rms, made.rms_error["y"], rtol=1e-12, why="one protocol")
    # What is ranked is delivered: the best trial is the full fit's own free run.
    best = fid.predict(scan.best, unseen).rms_error["y"]
    assert_close(scan.trials[0].free_run_rms, best, rtol=1e-12, why="the same model")


def test_what_is_ranked_is_delivered_where_there_are_several_optima():
    """A resonance at a third of the power: few orders fit, and searches end in many places."""
    random = np.random.default_rng(3)
    records = []
    for _ in range(2):
        u, e = random.standard_normal((2, 300))
        y = lfilter([0, 1.0], [1, -1.6, 0.98], u) + 0.5 * lfilter([1.0], [1, -0.3, 0.9], u)
        y += lfilter([1, 0.9], [1, -0.95], 3.0 * e)
        records.append(
            fid.Record.from_arrays(np.arange(300) / 10, inputs={"u": u}, outputs={"y": y})
        )
    for kind in ("armax", "oe"):
        scan = fid.scan_orders(
            records[0], records[1], kind=kind, na=[2, 3], nb=[1, 2], nc=[1, 3], nf=[2, 3]
        )
        runs = fid.predict(scan.best, records[1], settle_s=3.0)
        assert_close(scan.trials[0].free_run_rms, runs.rms_error["y"], rtol=1e-12, why="one model")
        assert scan.trials[0].model == scan.best.model
        errors = [t.free_run_rms for t in scan.trials if t.free_run_rms is not None]
        assert errors == sorted(errors)


def test_the_table_marks_what_each_criterion_takes(scan):
    text = scan.summary(3).to_text()
    assert "BIC" in text
    assert "ranked by free run" in text
    values = scan.to_dict()
    assert values["schema"] == "flightid.order_scan/1"
    assert len(values["trials"]["rows"]) == 36
    assert "36 structures" in repr(scan)
    assert "<table" in scan._repr_html_()
    figure = plot.order_scan(scan)
    assert len(figure.data) == 6


def test_arx_with_two_inputs_and_delays():
    truth = P(("u", "v"), "y", 0.1, a=[1, -0.8], b=[[1.0], [0.5]], nk=(2, 2))
    scan = fid.scan_orders(
        flown(truth, 2, n=900, noise=0.2),
        flown(truth, 3, n=900, noise=0.2),
        kind="arx",
        na=[1, 2],
        nb=[1, 2],
        nk=[1, 2, 3],
    )
    assert scan.smallest("bic").structure.orders_text == "na 1, nb [1, 1], nk [2, 2]"


@pytest.mark.parametrize(("kind", "more"), [("oe", {}), ("bj", {"nc": 1, "nd": 1})])
def test_output_error_and_box_jenkins_are_scanned_one_by_one(kind, more):
    truth = P(("u",), "y", 0.1, b=[[1.0]], f=[[1, -0.8]], c=[1, 0.4], d=[1, -0.7])
    fitted, unseen = (flown(truth, seed, n=500, noise=0.1) for seed in (4, 5))
    scan = fid.scan_orders(fitted, unseen, kind=kind, nb=[1, 2], nf=[1, 2], **more)
    assert len(scan.trials) == 4
    assert scan.simplest.structure.nf == (1,)
    for trial in scan.trials[1:]:  # searched without statistics, to where fits end
        fit = fid.identify(trial.structure, fitted)
        assert_close(trial.model.theta, fit.model.theta, why="the same search", rtol=1e-12)
        assert_close(
            trial.criteria.bic, fit.details.criteria.bic, why="the same search", rtol=1e-12
        )


@pytest.mark.parametrize(("nk", "said"), [(1, True), (3, False), (range(1, 5), False)])
def test_a_delay_that_was_not_scanned_is_told_where_it_may_be_longer(nk, said):
    truth = P(("u",), "y", 0.1, a=[1, -0.8], b=[[1.0]], nk=(3,))
    fitted, unseen = (flown(truth, seed, n=400, noise=0.1) for seed in (0, 2))
    scan = fid.scan_orders(fitted, unseen, kind="arx", na=1, nb=3, nk=nk)
    told = [each.message for each in scan.findings if each.code == "delay-not-scanned"]
    assert bool(told) == said
    assert not said or "u (nk 1)" in told[0]


def test_edges_simpler_models_and_growth_are_told():
    scan = fid.scan_orders(
        flown(ARMAX, 6, n=900, noise=0.3),
        flown(ARMAX, 7, n=900, noise=0.3),
        kind="arx",
        na=[1, 2],
        nb=[1, 2],
    )
    assert "at-edge-of-scan" in {f.code for f in scan.findings}
    large = fid.scan_orders(
        flown(ARMAX, 6, n=900, noise=0.01),
        flown(ARMAX, 7, n=900, noise=0.01),
        kind="arx",
        na=[2, 6],
        nb=[2, 6],
    )
    assert large.simplest.structure.n_parameters <= large.trials[0].structure.n_parameters


def test_scans_that_cannot_be_made():
    record, unseen = flown(ARMAX, 8), flown(ARMAX, 9)
    with pytest.raises(OptionError, match="kind is not known"):
        fid.scan_orders(record, unseen, kind="arma")
    with pytest.raises(OptionError, match="nothing to try"):
        fid.scan_orders(record, unseen, na=[])
    with pytest.raises(OptionError, match="the scan is too large"):
        fid.scan_orders(record, unseen, na=range(1, 60), nb=range(1, 60), nc=range(1, 20))
    with pytest.raises(OptionError, match="records to validate on"):
        fid.scan_orders(record, [])
    with pytest.raises(DataError, match="too short for the scan"):
        fid.scan_orders(flown(ARMAX, 8, n=6), unseen)
    slow = fid.Record.from_arrays(
        np.arange(400) / 5, inputs={"u": unseen["u"]}, outputs={"y": unseen["y"]},
        units={"y": "rad"},
    )  # fmt: skip
    with pytest.raises(DataError, match="different sample times"):
        fid.scan_orders(record, slow)
    twice = fid.Record.from_arrays(
        record.time_s,
        inputs={"u": record["u"], "v": record["u"]},
        outputs={"y": record["y"]},
        units={"y": "rad"},
    )
    with pytest.raises(FitError, match="no structure of the scan could be fitted"):
        fid.scan_orders(twice, twice, na=1, nb=1, nc=1)
    both = fid.Record.from_arrays(
        record.time_s, inputs={"u": record["u"]}, outputs={"y": record["y"], "z": record["y"]}
    )
    with pytest.raises(OptionError, match="output to model is not said"):
        fid.scan_orders(both, both)


def test_every_kind_is_ranked_by_the_same_free_runs():
    random = np.random.default_rng(11)
    records = []
    for _ in range(2):
        u, y = np.repeat(random.uniform(-1.0, 1.0, 100), 4), np.zeros(400)
        for t in range(2, 400):
            y[t] = 1.2 * y[t - 1] - 0.5 * y[t - 2] + 0.3 * u[t - 1]
        y = y + 3.0 + 0.01 * random.standard_normal(400)
        records.append(
            fid.Record.from_arrays(np.arange(400) / 10, inputs={"u": u}, outputs={"y": y})
        )
    tried = {"na": [2], "nb": [1, 2], "nc": 1, "nd": 1, "nf": [2], "nk": 1}
    scan = fid.scan_orders(*records, kind="any", **tried)
    assert {each.kind for each in scan.trials} == {"ARX", "ARMAX", "OE", "BJ", "subspace", "NARX"}
    errors = [t.free_run_rms for t in scan.trials if t.free_run_rms is not None]
    assert errors == sorted(errors)
    for trial in scan.trials:
        if trial.model is not None and trial.free_run_rms is not None:
            made = fid.predict(trial.model, records[1], settle_s=scan.settle_s)
            assert_close(trial.free_run_rms, made.rms_error["y"], rtol=1e-12, why="one protocol")
            assert made.start == round(scan.settle_s * 10), "the same samples for every kind"
    # The rig is linear: what NARX delivers says so.
    assert {t.note for t in scan.trials if t.kind == "NARX"} == {
        "linear: no nonlinear model beats it"
    }
    best = fid.predict(scan.best, records[1], settle_s=scan.settle_s).rms_error["y"]
    assert_close(errors[0], best, rtol=1e-12, why="what is ranked is delivered")
    assert {row[0] for row in scan.summary(3).rows} == {each.kind for each in scan.trials}
    assert len(plot.order_scan(scan, scan.simplest.structure).data) == 4


def test_a_fit_that_fails_whole_makes_way_for_the_next(monkeypatch):
    truth = P(("u",), "y", 0.1, b=[[1.0]], f=[[1, -0.8]])
    fitted, unseen = (flown(truth, seed, n=400, noise=0.1) for seed in (4, 5))
    orders = {"kind": "oe", "nb": [1, 2], "nf": [1, 2]}
    first = fid.scan_orders(fitted, unseen, **orders).trials[0].structure

    def failing(structure, records):
        if structure == first:
            raise FitError("no statistics")
        return fid.identify(structure, records)

    monkeypatch.setattr("flightid.validation.order_scan.trials.identify", failing)
    scan = fid.scan_orders(fitted, unseen, **orders)
    assert "no statistics" in [trial.note for trial in scan.trials if trial.structure == first]
    assert scan.trials[0].structure != first
    assert scan.best.structure == scan.trials[0].structure
    assert scan.best.parameters
