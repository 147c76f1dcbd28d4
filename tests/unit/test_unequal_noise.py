"""Noise that grows with the signal: bars of the power where the estimate looks, coloured or not."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import signal
from scipy.stats import norm, rankdata

import flightid as fid
from flightid.conventions import Light
from flightid.uncertainty import unequal_noise
from flightid.uncertainty.blocks import RecordBlock
from flightid.uncertainty.coloured_residuals import ResidualCovariance, residual_covariance
from flightid.uncertainty.residual_colour import IN_DOUBT, UNEQUAL, WORTH_A_WORD, colour_findings
from flightid.uncertainty.residual_noise import Autoregression
from flightid.uncertainty.slow_drift import Drift
from flightid.uncertainty.unequal_noise import Innovations, _whitener, unequal_outputs
from tests.closeness import assert_close
from tests.strangers.output_error import STEP_S, TRUTH, model

Array = np.ndarray
SAMPLES = 8000


def _gain() -> tuple[Array, Array]:
    """A signal of 40 periods, and what least squares makes of an error for its gain."""
    shape = np.sin(2.0 * np.pi * 40.0 * np.arange(SAMPLES) / SAMPLES)
    return shape, shape / float(shape @ shape)


def _known(shape: Array, error: Array) -> ResidualCovariance:
    """The covariance of that gain."""
    left = error - shape * float(shape @ error) / float(shape @ shape)
    none = np.zeros((1, SAMPLES, 0))
    return residual_covariance([RecordBlock.of(shape[None, :, None], none, left[None])])


@pytest.mark.parametrize("pole", [0.0, 0.9])
def test_the_variance_of_a_gain_is_that_of_its_scores(pole: float) -> None:
    """A recursion driven by noise of power 0.1 + s²: the variance is the sum of power times the
    square of what the estimate answers to each innovation."""
    shape, answer = _gain()
    power = 0.1 + shape**2
    made = np.random.default_rng(5).standard_normal(SAMPLES) * np.sqrt(power)
    error = signal.lfilter([1.0], [1.0, -pole], made)
    heard = signal.lfilter([1.0], [1.0, -pole], answer[::-1])[::-1]
    truth = float(heard**2 @ power)
    even = float(heard**2 @ np.full(SAMPLES, power.mean()))
    found = _known(shape, error)
    assert_close(found.covariance[0, 0], truth, rtol=0.1, why="8000 samples")
    assert found.growth is not None
    assert_close(found.growth[0], np.sqrt(truth / even), rtol=0.05, why="8000 samples")
    assert_close(found.colour.growth, found.growth[0], rtol=1e-12, why="one parameter")


def test_noise_of_one_power_and_noise_that_falls_change_nothing() -> None:
    shape, _ = _gain()
    white = np.random.default_rng(6).standard_normal(SAMPLES)
    assert _known(shape, white).growth is None
    assert _known(shape, white * np.sqrt(1.1 - shape**2)).growth is None


def test_white_noise_is_said_to_grow_in_one_of_a_hundred() -> None:
    """Five of 200 at the most."""
    random, said = np.random.default_rng(7), 0
    shape = np.sin(np.arange(200) / 7.0)
    for _ in range(200):
        error = random.standard_normal(200)
        left = error - shape * float(shape @ error) / float(shape @ shape)
        block = RecordBlock.of(shape[None, :, None], np.zeros((1, 200, 0)), left[None])
        said += residual_covariance([block]).growth is not None
    assert said <= 5


def test_a_note_up_to_twice_and_amber_from_there() -> None:
    assert colour_findings(1.0, 1.0, 0.99 * WORTH_A_WORD) == []
    for growth, light in ((0.99 * IN_DOUBT, Light.GREEN), (1.01 * IN_DOUBT, Light.AMBER)):
        (said,) = colour_findings(1.0, 1.0, growth)
        assert (said.code, said.light) == (UNEQUAL, light)
        assert "the intervals allow for it" in said.message
        (bare,) = colour_findings(1.0, 1.0, growth, has_bars=False)
        assert "would be" in bare.message
    codes = [each.code for each in colour_findings(1.0, 3.0, 1.5)]
    assert codes == ["residuals-coloured", UNEQUAL]


def _rolled(swell_rad_s: float) -> fid.Record:
    """A roll axis, its rate measured to 1 % of its spread and 15 % of itself."""
    time_s = np.arange(600) * STEP_S
    moved = 0.05 * np.sin(2.0 * time_s + 0.1 * time_s**2)
    moved *= np.sin(swell_rad_s * time_s) if swell_rad_s else 1.0
    decay = np.exp(TRUTH["Lp"] * STEP_S)
    gain = TRUTH["Lda"] * (decay - 1.0) / TRUTH["Lp"]
    rate = signal.lfilter([0.0, gain], [1.0, -decay], moved)
    noise = np.random.default_rng(8).standard_normal(rate.size)
    return fid.Record.from_arrays(
        time_s,
        inputs={"da": moved},
        outputs={"p": rate + (0.01 * rate.std() + 0.15 * np.abs(rate)) * noise},
        units={"da": "rad", "p": "rad/s"},
        hold="zero",
    )


@pytest.mark.parametrize("method", ["output_error", "filter_error", "equation_error"])
def test_fits_say_it_in_their_residuals(method: str) -> None:
    fit = fid.identify(model(), _rolled(0.3), method=method)
    (told,) = [each for each in fit.findings if each.code == UNEQUAL]
    assert "residuals grow with the signal: standard errors are up to 1." in told.message


def test_a_sine_tells_as_much_where_it_is_quiet_and_is_not_said() -> None:
    """Damping is told at the zeros of what tells the control's effect: bars are as they were."""
    fit = fid.identify(model(), _rolled(0.0), method="equation_error")
    assert UNEQUAL not in [each.code for each in fit.findings]


def _block(seed: int, growth: float, *, ties: bool = False) -> RecordBlock:
    random = np.random.default_rng(seed)
    slow = np.cumsum(random.standard_normal((400, 2)), axis=0)
    slow /= np.linalg.norm(slow, axis=0)
    noise = random.standard_normal(400) * (1.0 + growth * 20.0 * np.abs(slow[:, 1]))
    noise = np.round(noise, 1) if ties else noise
    return RecordBlock.of(slow[None], np.zeros((1, 400, 0)), noise[None])


WHITE = [Autoregression(np.ones(1), np.empty(0), 400, 0)]


def test_noise_of_one_power_needs_no_correlations_of_long_rows_nor_sorted_signals(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    ranked, made = list[np.ndarray](), unequal_noise.ranks

    def counted(row: np.ndarray) -> np.ndarray:
        ranked.append(row)
        return made(row)

    def refused(_: np.ndarray) -> np.ndarray:
        raise AssertionError("a bound has told it")

    monkeypatch.setattr("flightid.uncertainty.unequal_noise._correlations", refused)
    monkeypatch.setattr(unequal_noise, "ranks", counted)
    blocks = [_block(4, 0.0), _block(5, 0.0)]
    assert not unequal_outputs(WHITE, blocks, np.eye(2))
    for row, block in zip(ranked, blocks, strict=True):
        assert_close(row, np.abs(Innovations.of(WHITE[0], block, 0).errors), rtol=1e-12, why="same")


def test_noise_with_a_drift_is_foretold_by_its_last_forty_samples_at_most() -> None:
    """The normal equations written out; fewer where a record is short."""
    drift = Drift(0.5, 0.01)
    for n, order in ((4000, 40), (800, 40), (799, 39), (60, 3)):
        noise = Autoregression(np.array([1.0, 0.6]), np.array([0.6]), n, 2 * n, drift)
        weights, lags = _whitener(noise), noise.autocovariance(order + 1)
        assert weights.shape == (order,)
        among = lags[np.abs(np.subtract.outer(np.arange(order), np.arange(order)))]
        assert_close(among @ weights, lags[1:], rtol=1e-9, why="rounding")
    assert _whitener(Autoregression(np.ones(2), np.array([0.6]), 60, 128)).tolist() == [0.6]


@pytest.mark.parametrize("ties", [False, True])
@pytest.mark.parametrize("growth", [0.0, 0.15, 0.3, 1.0])
def test_a_bound_changes_no_answer(growth: float, *, ties: bool) -> None:
    """Scores written out, by SciPy's ranks."""
    for seed in range(0, 12, 2):
        blocks = [_block(seed, growth, ties=ties), _block(seed + 1, growth, ties=ties)]
        known = []
        for block in blocks:
            told = block.of_output(0)[1].T ** 2
            together = np.sum(told / told.mean(axis=1, keepdims=True), axis=0)
            errors = Innovations.of(WHITE[0], block, 0).errors
            rows = [np.abs(errors), *told, together]
            ranks = np.array([rankdata(row) for row in rows])
            ranks -= ranks.mean(axis=1, keepdims=True)
            ranks /= ranks.std(axis=1, keepdims=True)
            lags = np.arange(1, 50)
            met = [[row[:-k] @ row[k:] / 400.0 for k in lags] for row in ranks]
            slow = np.array(met) * (1.0 - lags / 50.0)
            counted = 400.0 / np.maximum(1.0, 1.0 + 2.0 * slow[1:] @ slow[0])
            known.append((ranks[1:] @ ranks[0] / 400.0, counted))
        total = sum(counted for _, counted in known)
        score = sum(together * counted for together, counted in known) / np.sqrt(total)
        limit = norm.ppf(1.0 - 0.01 / 3.0)
        assert bool(unequal_outputs(WHITE, blocks, np.eye(2))) == bool(np.max(score) > limit)
