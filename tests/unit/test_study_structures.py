"""Which structure a study takes of those that it tried."""

from __future__ import annotations

from collections.abc import Callable
from types import SimpleNamespace

import numpy as np
import pytest
from scipy import signal

import flightid as fid
from flightid.conventions import Light
from flightid.evidence.evidence import GUIDELINES
from flightid.study import widened_scan
from flightid.study.structure_settings import StructureSettings
from flightid.study.structures import fit_structure, ranked, runs_as_well
from flightid.study.widened_scan import ROUNDS
from flightid.validation.order_scan import trials
from flightid.validation.order_scan.edges import EDGE
from flightid.validation.order_scan.trials import OrderTrial
from tests.closeness import assert_close

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


def test_a_richer_structure_must_be_clearly_better() -> None:
    def trial(n_parameters: int, aicc: float, rms: float = 1.0) -> SimpleNamespace:
        criteria = SimpleNamespace(aicc=aicc)
        return SimpleNamespace(
            structure=None,
            likelihood=criteria,
            settled=True,
            free_run_rms=rms,
            errors=(),
            n_parameters=n_parameters,
        )

    trials = [
        trial(9, 100.0),
        trial(4, 105.0),
        trial(5, 104.0),
        trial(3, 107.0),
        trial(2, 99.0, 2.0),
    ]
    taken = ranked(SimpleNamespace(trials=trials), "balanced")
    assert [each.n_parameters for each in taken] == [4, 5, 9, 3]


@pytest.mark.parametrize("pole", [0.0, 0.8])
def test_free_runs_are_compared_by_errors_that_share_their_noise(pole: float) -> None:
    """A ratio of variances told 2 % of misses of 0.33 of the noise, at 5 %; pairs tell 90 %."""
    random = np.random.default_rng(5)
    n = round(400 * (1.0 + pole) / (1.0 - pole))

    def coloured() -> np.ndarray:
        made = signal.lfilter([1.0], [1.0, -pole], random.standard_normal(n + 100))
        return np.sqrt(1.0 - pole**2) * made[100:]

    def ran(*misses: float) -> list[OrderTrial]:
        noise = coloured()
        errors = [noise + miss * coloured() if miss else noise for miss in misses]
        sizes = [float(np.sqrt(np.mean(each**2))) for each in errors]
        return [
            OrderTrial(fid.PolynomialModel.oe("u", "y", nb=1, nf=1), None, None, size, 90.0,
                       errors=(each,))
            for size, each in zip(sizes, errors, strict=True)
        ]  # fmt: skip

    told = [not runs_as_well(*ran(0.4, 0.0)) for _ in range(100)]
    by_chance = [not runs_as_well(*ran(0.4, 0.4)) for _ in range(100)]
    assert np.mean(told) > 0.75
    assert np.mean(by_chance) < 0.12


def drifting() -> fid.Record:
    """A second-order rig by SciPy whose output drifts off its level, slower than a run is long."""
    random = np.random.default_rng(7)
    u = np.repeat(np.sign(random.standard_normal(250)), 3)
    y = signal.lfilter([0.0, 0.0, 0.1, 0.08], [1.0, -1.3, 0.45], u)
    drift = signal.lfilter([0.1], [1.0, -0.995], random.standard_normal(1250))[500:]
    y += 0.1 * np.sqrt(1.0 - 0.995**2) * np.std(y) * drift
    return fid.Record.from_arrays(
        np.arange(750) * 0.1, inputs={"u": u}, outputs={"y": y}, hold="zero"
    )


def test_a_level_that_drifted_asks_for_no_slow_mode() -> None:
    """A pole slower than the run takes its level of the first stretch: chance that ran ahead."""
    whole = drifting()
    orders = {"nb": (2, 3), "nf": (2, 3, 4), "nk": (2,)}
    settings = StructureSettings(structure="oe", inputs=("u",), outputs=("y",), **orders)
    fit, scan = fit_structure(
        settings, ("u",), [whole.segment(0.0, 50.0)], [whole.segment(50.05, 80.0)]
    )
    slowest = max(abs(np.roots(fit.model.f[0])))
    assert -0.1 / np.log(slowest) < 0.3, "seconds: the rig has a pole of 0.25 s and no slower one"
    assert EDGE not in {each.code for each in fit.findings}
    assert scan.trials[0].structure.nf[0] > 2, "the free run alone would have taken the slow one"


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
        SimpleNamespace(structure=each, likelihood=SimpleNamespace(bic=bic), settled=True)
        for each, bic in ((inner, 100.0), (beyond, 100.0 - gain))
    ]
    found = widened_scan._better(inner, {"nb": 3}, trials)
    assert bool(found) is doubted
    assert all("beyond the scan's last nb" in each.message for each in found)


def test_an_order_by_subspace_goes_on_past_the_largest() -> None:
    whole = third_order()
    settings = StructureSettings(
        structure="subspace", inputs=("u",), outputs=("y",), options={"maximum_order": 3}
    )
    fit, scan = fit_structure(settings, ("u",), [whole.segment(0.0, 39.9)], [])
    assert scan is None
    assert fit.structure.maximum_order > fit.model.order > 3
    assert EDGE not in {each.code for each in fit.findings}


def test_an_order_by_subspace_that_stays_at_the_edge_is_amber(monkeypatch) -> None:
    monkeypatch.setattr(widened_scan, "ROUNDS", 1)
    settings = StructureSettings(
        structure="subspace", inputs=("u",), outputs=("y",), options={"maximum_order": 2}
    )
    fit, _ = fit_structure(settings, ("u",), [third_order().segment(0.0, 39.9)], [])
    (found,) = (each for each in fit.findings if each.code == EDGE)
    assert "last order" in found.message
    assert fit.covariance is None


def nonlinear(seed: int, n: int = 400) -> fid.Record:
    """Two lags of the output and three of the input behind a hyperbolic tangent."""
    random = np.random.default_rng(seed)
    u, y = random.uniform(-1, 1, n), 0.02 * random.standard_normal(n)
    for t in range(3, n):
        y[t] += 0.9 * np.tanh(y[t - 1]) - 0.5 * y[t - 2] + u[t - 3 : t] @ [0.6, 0.4, 0.3]
    return fid.Record.from_arrays(0.2 * np.arange(n), inputs={"u": u}, outputs={"y": y})


@pytest.mark.parametrize(("rounds", "stays"), [(ROUNDS, False), (1, True)])
def test_lags_of_a_nonlinear_model_go_on_past_the_edge(monkeypatch, rounds, stays) -> None:
    monkeypatch.setattr(widened_scan, "ROUNDS", rounds)
    settings = StructureSettings(
        structure="narx", inputs=("u",), outputs=("y",), output_lags=2, input_lags=(1, 2),
        options={"kernel": None, "degree": 3, "maximum_terms": 8},
    )  # fmt: skip
    fit, search = fit_structure(settings, ("u",), [nonlinear(0)], [nonlinear(1)])
    assert fit.structure.input_lags >= 3
    assert (EDGE in {each.code for each in fit.findings}) is stays
    assert len({each.structure for each in search.trials}) == len(search.trials)
    if stays:
        assert fit.covariance is None


def _once(fitted: Callable[..., OrderTrial]) -> Callable[..., OrderTrial]:
    """A second scan of the same records finds what the first one fitted."""
    known: dict[object, OrderTrial] = {}

    def trial(structure: object, *data: object) -> OrderTrial:
        if structure not in known:
            known[structure] = fitted(structure, *data)
        return known[structure]

    return trial


def test_of_any_kind_the_one_that_is_taken_goes_on(monkeypatch) -> None:
    whole = third_order(800)
    orders = {"na": 1, "nb": (1, 2), "nc": 1, "nd": 1, "nf": (1, 2), "nk": (4, 5)}
    settings = StructureSettings(structure="any", inputs=("u",), outputs=("y",), **orders)
    parts = [whole.segment(0.0, 26.6)], [whole.segment(26.6, 40.0)]
    monkeypatch.setattr(trials, "_fitted_trial", _once(trials._fitted_trial))
    fit, scan = fit_structure(settings, ("u",), *parts)
    kinds = {each.kind for each in scan.trials}
    assert {"ARX", "ARMAX", "OE", "BJ", "subspace", "NARX"} <= kinds
    assert EDGE not in {each.code for each in fit.findings}
    monkeypatch.setattr(widened_scan, "ROUNDS", 0)
    told, _ = fit_structure(settings, ("u",), *parts)
    assert EDGE in {each.code for each in told.findings}
    assert told.covariance is None


def slow_errors(seed: int, sample_time_s: float, low_hz: float = 0.05) -> fid.Record:
    """A minute of a rising sweep of s² + 1.2 s + 5.76 after 0.08 s, by SciPy, and slow noise."""
    random = np.random.default_rng(seed)
    fine = sample_time_s / 50
    time_s = sample_time_s * np.arange(round(60.0 / sample_time_s))
    u = signal.chirp(time_s, low_hz, 60.0, 3.0, method="logarithmic")
    late = round(0.08 / fine)
    held = np.concatenate([np.zeros(late), np.repeat(u, 50)])[: 50 * len(u)]
    num, den, _ = signal.cont2discrete(([5.76], [1.0, 1.2, 5.76]), fine)
    y = signal.lfilter(num.ravel(), den, held)[::50]
    noise = signal.lfilter([1.0], [1.0, -0.9], random.standard_normal(len(u)))
    y += 0.05 * np.std(y) / np.std(noise) * noise
    return fid.Record.from_arrays(time_s, inputs={"u": u}, outputs={"y": y}, hold="zero")


@pytest.mark.parametrize("choose", ["free_run", "balanced"])
def test_what_its_own_fit_doubts_is_left_for_another(choose: str) -> None:
    """15 s of slow motion run best with what its own fit refutes: so it is passed over."""
    whole = slow_errors(2, 0.05)
    flown, unseen = whole.segment(30.0, 59.95), whole.segment(15.0, 30.0)
    orders = {"nb": (1, 2, 3), "nf": (2, 3), "nk": (1, 2, 3)}
    settings = StructureSettings(
        structure="oe", inputs=("u",), outputs=("y",), choose=choose, **orders
    )
    fit, scan = fit_structure(settings, ("u",), [flown], [unseen])
    first = trials.fit_of(ranked(scan, choose)[0], [flown])
    assert first.covariance is None, "what either rule takes first"
    assert fit.covariance is not None
    known = [abs(mode.eigenvalue) for mode in fid.modes(fit).modes if mode.eigenvalue is not None]
    assert_close(
        min(known, key=lambda omega: abs(omega - 2.4)), 2.4, rtol=0.02, why="the mode of the rig"
    )
