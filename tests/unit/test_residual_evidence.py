"""Residuals against intervals: what inputs foretell of them, and inputs that tell nothing."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import chirp, lfilter

import flightid as fid
from flightid.uncertainty.blocks import RecordBlock
from flightid.uncertainty.coloured_residuals import residual_covariance
from flightid.uncertainty.fitted_correlation import LAGS
from tests.closeness import assert_close
from tests.strangers import closed_loops, false_lights, noises
from tests.strangers.output_error import COLOURS, flight, late, model

N = 4000


def _tested(shared: np.ndarray, residual: np.ndarray, u: np.ndarray) -> object:
    block = RecordBlock.of(shared[None], np.zeros((1, N, 0)), residual[None])
    (found,) = residual_covariance([block], inputs=[u[None]]).correlations
    return found


def test_without_influence_of_the_fit_errors_are_those_of_independent_series() -> None:
    random = np.random.default_rng(0)
    u, e, other = random.standard_normal((3, N))
    found = _tested(other[:, None], e, u)
    assert found.degrees == LAGS + 1
    assert_close(found.errors, np.full(LAGS + 1, N**-0.5), rtol=0.03, why="a sample of N(0, 1)")
    wanted = np.array([u[: N - k] @ e[k:] for k in range(LAGS + 1)]) / np.sqrt((u @ u) * (e @ e))
    assert_close(found.values, wanted, atol=1e-3, why="means of finite samples")


def test_correlations_are_of_the_whole_input_where_a_lag_loses_its_end() -> None:
    random = np.random.default_rng(3)
    u, e, other = random.standard_normal((3, N))
    u[-1] = 60.0
    found = _tested(other[:, None], e, u)
    left = np.array([np.sqrt(u[: N - k] @ u[: N - k]) for k in range(LAGS + 1)])
    wanted = left / left[0] * N**-0.5
    assert_close(found.errors, wanted, rtol=0.05, why="a sample of N(0, 1)")


def test_lags_that_the_fit_takes_out_carry_no_evidence() -> None:
    random = np.random.default_rng(1)
    u, e = random.standard_normal((2, N))
    u -= u.mean()
    shared = np.column_stack([u, np.r_[0.0, u[:-1]]])
    left = e - shared @ np.linalg.lstsq(shared, e)[0]
    found = _tested(shared, left, u)
    assert found.degrees == LAGS - 1
    assert_close(found.errors[:2], np.zeros(2), atol=1e-3, why="orthogonal but for means")


@pytest.mark.parametrize(("seed", "colour"), [(76, "white"), (42, "AR(1) 0.9")])
def test_a_short_lag_that_is_missing_shows_at_the_first_lags(seed: int, colour: str) -> None:
    """10 ms, at 50 Hz beside a tenth of noise: 26 lags together hid it."""
    record = late(seed, 0.01, 0.1, COLOURS[colour])
    assert fid.identify(model(), record, method="output_error").covariance is None


@pytest.mark.parametrize("colour", COLOURS)
def test_a_true_model_keeps_its_bars_in_every_colour(colour: str) -> None:
    fit = fid.identify(model(), flight(1, COLOURS[colour]), method="output_error")
    assert fit.covariance is not None
    test = fid.residual_tests(fit, loop="open").test("uε", "p", "da")
    assert str(test.verdict) == "pass"
    assert test.p_value == fit.input_correlations[0].p_value
    assert test.lags[0] == 0


def test_a_delayed_input_that_begins_with_a_jump_is_named_beside_missing_dynamics() -> None:
    """At rest before the record, as a simulation begins: nothing is missing but what was before."""
    n, late_by, step_s = 4000, 6, 0.01
    u = 0.3 * chirp(np.arange(n) * step_s, 0.1, 40.0, 8.0, "logarithmic")
    u += 0.1 * np.sign(np.sin(0.44 * np.arange(n) * step_s + 1.0))
    keep = np.exp(-1.4 * step_s)
    y = lfilter([0.0, 5.2 / 1.4 * (1.0 - keep)], [1.0, -keep], np.r_[np.zeros(late_by), u])[:n]
    y = y + 0.014 * np.random.default_rng(1).standard_normal(n)
    made = fid.StateSpaceModel.from_dict(
        {
            "name": "yaw",
            "states": {"r": "rad/s"},
            "inputs": {"ped": "1"},
            "outputs": {"r": "r"},
            "parameters": {
                "Nr": {"value": -1.0, "unit": "1/s"},
                "Nped": {"value": 4.0, "unit": "1/s^2"},
                "tau": {"value": 0.05, "min": 0.0, "max": 0.4, "unit": "s"},
            },
            "equations": {"r'": "Nr*r + Nped*ped"},
            "delays": {"ped": "tau"},
        }
    )
    fits = []
    for first in (0, 10):
        record = fid.Record.from_arrays(
            np.arange(n - first) * step_s,
            inputs={"ped": u[first:]},
            outputs={"r": y[first:]},
            units={"ped": "1", "r": "rad/s"},
            hold="zero",
        )
        fits.append(fid.identify(made, record, loop="open"))
    (said,) = [each for each in fits[0].findings if each.code == "inputs-in-errors"]
    assert "or a delayed input was another before its record began" in said.message
    assert "cut off as much as its delay" in said.action
    low, high = fits[1].parameters["tau"].interval95 or (0.0, 0.0)
    assert low <= late_by * step_s <= high, "what is advised gives bars that hold"


def test_a_missing_lag_has_no_bars_and_says_why() -> None:
    fit = fid.identify(model(), late(0, 0.04, 0.1, noises.white), method="output_error")
    (said,) = [each for each in fit.findings if each.code == "inputs-in-errors"]
    assert "dynamics are missing" in said.message
    assert "lag" in said.action
    assert fit.covariance is None
    assert fit.parameters["Lp"].reason == said.message


@pytest.mark.parametrize("method", ["output_error", "equation_error", "fourier_output_error", None])
def test_noise_alone_has_no_bars(method: str | None) -> None:
    random = np.random.default_rng(0)
    record = fid.Record.from_arrays(
        np.arange(1500) * 0.02,
        inputs={"da": 0.05 * random.standard_normal(1500)},
        outputs={"p": 0.01 * random.standard_normal(1500)},
        units={"da": "rad", "p": "rad/s"},
        hold="zero",
    )
    if method is None:
        fit = fid.identify(fid.PolynomialModel.oe("da", "p", nb=1, nf=1), record, loop="open")
    else:
        fit = fid.identify(model(), record, method=method, loop="open")
    assert all(each.stderr is None for each in fit.parameters.values())
    assert str(fit.evidence.light) == "red"
    assert "nothing-told" in [each.code for each in fit.findings]


def test_what_stays_mostly_unexplained_has_no_bars() -> None:
    flown, *beside = (
        closed_loops.record(k, feedback=closed_loops.PILOT, duration_s=60.0) for k in range(2)
    )
    response = fid.estimate_response(flown, estimator="prewhitened", band_rad_s=(0.5, 10.0))
    fit = fid.identify(closed_loops.model(), [response, *beside[0]])
    assert str(fit.evidence.light) == "red"
    assert fit.covariance is None
    assert "of its variance is left" in (fit.parameters["Zw"].reason or "")


def test_slow_smooth_noise_denies_no_response_that_is_there() -> None:
    """99 % explained is not chance, however few samples of such noise are independent."""
    random = np.random.default_rng(2)
    u = np.repeat(random.choice([-1.0, 1.0], 300), 5)
    moved = np.convolve(u, 0.8 ** np.arange(60))[: u.size]
    record = fid.Record.from_arrays(
        np.arange(u.size) * 0.1,
        inputs={"u": u},
        outputs={"y": moved + 0.1 * moved.std() * noises.ar2(random, u.size, 0.98, 0.05)},
        hold="zero",
    )
    asked = fid.PolynomialModel.oe("u", "y", nb=1, nf=1, nk=0)
    assert fid.identify(asked, record).covariance is not None
    noise = {"y": noises.ar2(random, u.size, 0.98, 0.05)}
    barren = fid.Record.from_arrays(record.time_s, inputs={"u": u}, outputs=noise, hold="zero")
    assert fid.identify(asked, barren).covariance is None


def test_samples_that_nobody_measured_have_no_bars_and_spikes_have() -> None:
    bars = {}
    for name in ("wrong units", "dead sensor", "spikes"):
        columns = false_lights.BARREN_FLIGHTS[name](np.random.default_rng([0, 12]))
        record = false_lights.one_record(columns)
        fit = fid.identify(model(), record, method="output_error")
        assert str(fit.evidence.light) == "red"
        bars[name] = fit.covariance is not None
        if not bars[name]:
            (found,) = [each for each in fit.evidence.checks if each.name == "samples"]
            assert {each.reason for each in fit.parameters.values()} == {found.what}
    assert bars == {"wrong units": False, "dead sensor": False, "spikes": True}
    columns = false_lights.BARREN_FLIGHTS["wrong units"](np.random.default_rng([0, 12]))
    structure = fid.PolynomialModel.oe("da", "p", nb=1, nf=1, nk=1)
    fit = fid.identify(structure, false_lights.one_record(columns))
    made = [*fit.details.gains.values(), fit.details.modes[0].natural_frequency]
    assert [each.interval95 for each in made] == [None, None]
    assert fit.model.covariance is None
