"""Which structure a study takes of those that it tried."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
from scipy import signal

import flightid as fid
from flightid.conventions import Light
from flightid.evidence.evidence import GUIDELINES
from flightid.study import widened_scan
from flightid.study.structure_settings import StructureSettings
from flightid.study.structures import fit_structure, ranked
from flightid.study.widened_scan import EDGE, ROUNDS

T_S = 0.02


def rig() -> fid.Record:
    """A second-order rig by SciPy, white noise on its output; its input ends away from its mean."""
    rng = np.random.default_rng(1)
    u = np.repeat(np.sign(rng.standard_normal(300)), 10) * 0.5
    (b, a, _) = signal.cont2discrete(([64.0], [1.0, 8.0, 64.0]), T_S)
    y = signal.lfilter(b.ravel(), a, u) + 0.01 * rng.standard_normal(len(u))
    return fid.Record.from_arrays(
        np.arange(len(u)) * T_S, inputs={"u": u}, outputs={"y": y}, hold="zero"
    )


def test_an_offset_of_the_means_asks_for_no_pole() -> None:
    whole = rig()
    flown, unseen = whole.segment(0.0, 29.99), whole.segment(29.99, 44.98)
    orders = {"nb": (2, 3), "nf": (2, 3), "nk": (1,)}
    settings = StructureSettings(structure="oe", inputs=("u",), outputs=("y",), **orders)
    fit, scan = fit_structure(settings, ("u",), [flown], [unseen])
    first = ranked(scan, "balanced")[0]
    assert (first.structure.nb, first.structure.nf) == ((2,), (2,))
    assert (fit.structure.nb, fit.structure.nf) == ((2,), (2,))


def third_order(n: int = 1200) -> fid.Record:
    """A lightly damped mode behind a lag and four samples of delay, white noise."""
    rng = np.random.default_rng(3)
    u = np.repeat(np.sign(rng.standard_normal(n // 4)), 4)
    (b, a, _) = signal.cont2discrete(([90.0], np.polymul([1.0, 1.0, 9.0], [1.0, 10.0])), 0.05)
    y = signal.lfilter([*np.zeros(4), *b.ravel()], a, u) + 0.02 * rng.standard_normal(n)
    return fid.Record.from_arrays(0.05 * np.arange(n), inputs={"u": u}, outputs={"y": y})


def narrow_scan():
    """Orders of 1 and 2 and delays of 3 and 4 of three poles after five samples."""
    whole = third_order()
    orders = {"nb": (1, 2), "nf": (1, 2), "nk": (3, 4)}
    settings = StructureSettings(structure="oe", inputs=("u",), outputs=("y",), **orders)
    return fit_structure(settings, ("u",), [whole.segment(0.0, 39.9)], [whole.segment(39.9, 60.0)])


def test_a_scan_goes_on_past_its_edges() -> None:
    fit, scan = narrow_scan()
    assert fit.structure.nf[0] >= 3
    assert fit.structure.nb[0] + fit.structure.nk[0] >= 7, "what acts after five samples and later"
    assert EDGE not in {each.code for each in fit.findings}
    assert fit.covariance is not None
    assert len(scan.trials) <= 8 + ROUNDS * 8


def test_an_edge_that_stays_is_amber_without_intervals(monkeypatch) -> None:
    monkeypatch.setattr(widened_scan, "ROUNDS", 1)
    fit, _ = narrow_scan()
    (found,) = (each for each in fit.findings if each.code == EDGE)
    assert fit.covariance is None
    assert fit.evidence.check(GUIDELINES).light is Light.AMBER
    assert fit.evidence.check(GUIDELINES).what == found.message


@pytest.mark.parametrize(("gain", "doubted"), [(5.0, False), (7.0, True)])
def test_a_neighbour_beyond_the_edge_is_clearly_better_by_six(gain: float, doubted) -> None:
    inner, beyond = (fid.PolynomialModel.oe("u", "y", nb=nb, nf=2) for nb in (2, 3))
    trials = [
        SimpleNamespace(structure=each, criteria=SimpleNamespace(bic=bic), settled=True)
        for each, bic in ((inner, 100.0), (beyond, 100.0 - gain))
    ]
    found = widened_scan._better(inner, {"nb": 3}, SimpleNamespace(trials=trials))
    assert bool(found) is doubted
    assert all("beyond the scan's last nb" in each.message for each in found)
