"""NARX models beside the linear ones of a rig: where they are tried, taken, and give no gains."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
from scipy import signal

import flightid as fid
from flightid.errors import DataError
from flightid.study import run_study, tuning
from flightid.study.proposal import nonlinear, propose_study, structures_of
from flightid.study.proposal.nonlinear import nonlinear_choice, what_inputs_foretell
from flightid.study.proposal.stretches import Group, Segments, Stretch
from flightid.study.proposal.structures_of import GroupScans
from flightid.validation.order_scan.result import OrderTrial
from flightid.validation.order_scan.trials import ScanRecords, fitted_trials

STEP_S = 0.5


def moved(seed: int, curvature: float, n: int) -> tuple[np.ndarray, np.ndarray]:
    """A valve that is bent, by SciPy: its square drives two poles; slow noise of 3 %."""
    random = np.random.default_rng(seed)
    u = np.repeat(random.uniform(-1.0, 1.0, n // 8), 8)
    y = signal.lfilter(*signal.butter(2, 0.12), u + curvature * u**2)
    noise = signal.lfilter([0.6], [1.0, -0.8], random.standard_normal(u.size))
    return u, y + 0.03 * np.std(y) * noise


class Scans:
    """Parts of a flown rig, as a proposal has them."""

    def __init__(self, curvature: float, loop: str | None = "open") -> None:
        self.records = []
        for seed in range(2):
            u, y = moved(seed, curvature, 800)
            time_s = np.arange(u.size) * STEP_S
            channels = {"inputs": {"u": u}, "outputs": {"y": y}}
            made = fid.Record.from_arrays(time_s, **channels, hold="zero")
            self.records.append(made if loop is None else made.declare(loop=loop))

    def flown(self, *_: object) -> fid.Record:
        return self.records[0]

    def narx(self, structures: list[fid.NarxStructure], settle_s: float) -> list[OrderTrial]:
        return fitted_trials(
            structures, ScanRecords(self.records[:1], self.records[1:], settle_s), ""
        )


@pytest.mark.parametrize(
    ("curvature", "lags", "taken", "said"),
    [
        (0.6, (2,), True, "NARX taken, tried for "),
        (0.0, (2,), False, "NARX not taken"),
        (0.6, (), None, ""),
    ],
    ids=["bent", "straight", "too costly"],
)
def test_it_is_taken_where_it_runs_better_beyond_chance(
    monkeypatch: pytest.MonkeyPatch, curvature: float, lags: object, *, taken: object, said: str
) -> None:
    monkeypatch.setattr(nonlinear, "LAGS", lags)
    scans = Scans(curvature)
    scan = fid.scan_orders(*scans.records, kind="arx", na=2, nb=2, nk=range(2))
    found = nonlinear_choice(scans, scan.best, scan.trials[0], 0, scan.settle_s)
    assert (None if found is None else found.is_better) is taken
    if found is None:
        return
    assert found.said.startswith(said)
    if not taken:
        return
    assert "more than chance makes" in found.said
    assert "output_lags = 2" in found.lines
    assert found.error < 0.6 * scan.trials[0].free_run_rms
    # A rival that errs as little is told from it by nothing.
    again = nonlinear_choice(scans, scan.best, found.trial, 0, scan.settle_s)
    assert not again.is_better
    assert again.said.startswith("NARX not taken")


def test_none_is_tried_along_a_loop_and_one_that_answers_at_once_is_red() -> None:
    """Bent residuals of a loop asked for NARX models, which found the controller turned round."""
    scans = Scans(0.6, "closed")
    scan = fid.scan_orders(*scans.records, kind="arx", na=2, nb=2, nk=range(2))
    found = nonlinear_choice(scans, scan.best, scan.trials[0], 0, scan.settle_s)
    assert found is not None
    assert (found.trial, found.is_better, found.lines) == (None, False, [])
    assert found.said.startswith("NARX not tried (")
    assert found.said.endswith("loop closed, as declared")
    for delay, light in ((0, "red"), (1, "amber")):
        asked = fid.NarxStructure(("u",), "y", 2, 2, delay, kernel=None, degree=2)
        loop = fid.identify(asked, scans.records[0]).evidence.check("loop")
        assert loop is not None
        assert loop.light == light, loop


def test_none_is_tried_where_a_loop_may_be_and_what_would_have_it_tried_is_said() -> None:
    """An unknown loop's best NARX model was the controller's inverse, for all that runs tell."""
    scans = Scans(0.6, None)
    scan = fid.scan_orders(*scans.records, kind="arx", na=2, nb=2, nk=range(2))
    found = nonlinear_choice(scans, scan.best, scan.trials[0], 0, scan.settle_s)
    assert found is not None
    assert (found.trial, found.is_better) == (None, False)
    assert "whether a loop is closed cannot be told" in found.said
    assert "declare --loop open" in found.said


def test_a_narx_model_gives_no_gains_and_says_what_would() -> None:
    scans = Scans(0.6)
    asked = fid.NarxStructure(("u",), "y", 2, 2, kernel=None, degree=2, focus="simulation")
    fit = fid.identify(asked, scans.records[0])
    with pytest.raises(DataError, match="other margins at every level") as refused:
        fid.tune_controller(fit, nominal=True, band_rad_s=(0.1, 1.0))
    assert "record steps about that point" in str(refused.value)


@pytest.mark.parametrize(("stops", "found"), [(0.4, True), (9.0, False)], ids=["at", "inside"])
def test_stops_that_squares_do_not_see_are_seen_by_cubes(stops: float, *, found: bool) -> None:
    random = np.random.default_rng(2)
    u = np.repeat(random.uniform(-1.0, 1.0, 150), 8)
    y = signal.lfilter(*signal.butter(2, 0.12), np.clip(u, -stops, stops))
    y += 0.02 * np.std(y) * random.standard_normal(u.size)
    time_s = np.arange(u.size) * STEP_S
    record = fid.Record.from_arrays(time_s, inputs={"u": u}, outputs={"y": y}, hold="zero")
    fit = fid.identify(fid.PolynomialModel.oe("u", "y", nb=3, nf=2, nk=0), record)
    why = what_inputs_foretell(fit)
    assert (why is not None and why.startswith("uε: y, u³ of OE")) is found
    codes = {each.code for each in fid.residual_tests(fit).findings if each.light == "red"}
    assert not codes, "the report's own tests see nothing"


def test_gains_rest_on_the_linear_model_beside(monkeypatch: pytest.MonkeyPatch) -> None:
    scans = Scans(0.6)
    asked = fid.NarxStructure(("u",), "y", 2, 2, kernel=None, degree=2, focus="simulation")
    linear = fid.PolynomialModel.arx("u", "y", na=2, nb=2)
    fits = [fid.identify(each, scans.records[0]) for each in (asked, linear)]
    tried: list[str] = []

    def refused(fit: fid.Fit, **_: object) -> None:
        tried.append(fit.structure.kind)
        raise DataError("no band")

    monkeypatch.setattr(tuning, "tune_controller", refused)
    known = [(fit, ()) for fit in fits]
    with pytest.raises(DataError, match="no band"):
        tuning._controllers(known, fid.ControllerOptions(), tuning.TuneSettings())
    assert tried == ["ARX"], "the nonlinear one comes last, and its loop is known by then"


def test_a_linear_model_that_is_not_red_stands_beside(monkeypatch: pytest.MonkeyPatch) -> None:
    class Rig(Scans):
        def driving(self, *_: object) -> tuple[str, ...]:
            return ("u",)

        def scan(self, kind: str, output: str, orders: object, inputs: object) -> fid.OrderScan:
            return fid.scan_orders(*self.records, kind=kind, na=2, nb=2, nc=1, nd=1, nf=2, nk=1)

    monkeypatch.setattr(nonlinear, "LAGS", (2,))
    scans = Rig(0.6)
    record = scans.records[0]
    group = Group(("u",), (Stretch(record, Path("rig.csv")),))
    segments = Segments((), "fitted", "choice", ("unseen",), ((0.0, 1.0), (1.0, 2.0)))
    for light, names in ((False, ["y from u", "y from u, linear"]), (True, ["y from u"])):
        monkeypatch.setattr(structures_of._Linear, "is_red", light)
        scans.outputs = ("y",)
        found, missed = structures_of.structures_of(GroupScans(group, segments, scans))
        assert not missed
        assert [each.name for each in found] == names
        assert 'structure = "narx"' in found[0].lines
        assert not any(line.startswith("band_rad_s") for line in found[0].lines)
        assert re.search(r"oe [0-9.]+\. NARX taken", found[0].tried), "a unit of 1 is not said"


@pytest.mark.slow
def test_a_bent_valve_is_a_narx_model_from_the_file_to_the_answer(tmp_path: Path) -> None:
    u, y = moved(3, 0.6, 1600)
    rows = np.column_stack([np.arange(u.size) * STEP_S, u, y])
    path = tmp_path / "valve.csv"
    np.savetxt(path, rows, "%.7g", ",", header="time [s],u,y", comments="")
    known: dict[str, object] = {}
    made = propose_study(
        [path], folder=tmp_path, cache=known, inputs=["u"], outputs=["y"], hold="zero", loop="open"
    )
    assert any(said.startswith("NARX taken, tried for ") for said in made.said)
    study = run_study(made.write(tmp_path / "valve-study.toml"), cache=known)
    item = study.identified[0]
    assert item.settings.structure.structure == "narx"
    assert "NARX taken" in item.settings.tried
    assert min(next(iter(item.on_unseen.values())).fit_percent.values()) > 90.0
    assert str(item.fit.evidence.light) != "red"
