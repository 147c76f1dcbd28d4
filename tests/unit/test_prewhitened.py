"""Responses by a model of the noise: no loop bends them; their weights and errors."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from scipy.signal import lfilter

import flightid as fid
from flightid.errors import DataError
from flightid.responses.errors.prewhitened import NoiseModel, lag_blocks
from tests.closeness import assert_close
from tests.strangers import closed_loops
from tests.unit.test_feedback_bias import GAIN, POLE, _loop

OMEGA = np.array([0.1, 0.5, 1.5])
TRUTH = GAIN * np.exp(-1j * OMEGA) / (1.0 - POLE * np.exp(-1j * OMEGA))


def _record(n: int = 20_000) -> fid.Record:
    u, y = _loop(n)
    return fid.Record.from_arrays(np.arange(n), inputs={"u": u}, outputs={"y": y})


def _estimate(estimator: str) -> fid.FrequencyResponse:
    return fid.estimate_response(_record(), omega_rad_s=OMEGA, estimator=estimator)


def test_a_loop_bends_the_direct_estimate_and_not_this_one() -> None:
    found, direct = _estimate("prewhitened"), _estimate("composite")
    size = 3.0 * np.sqrt(2.0) * found.random_error[0, 0]
    assert np.all(np.abs(found.response[0, 0] / TRUTH - 1.0) < size)
    assert np.all(np.abs(direct.response[0, 0] / TRUTH - 1.0)[:2] > size[:2])


def test_the_weights_give_the_estimate_and_the_response_of_a_model() -> None:
    record, found = (
        _record(4000),
        fid.estimate_response(_record(4000), omega_rad_s=OMEGA, estimator="prewhitened"),
    )
    assert found.linear is not None
    y = record.matrix(["y"])
    centred = y - y.mean(axis=1, keepdims=True)
    assert_close(found.linear.apply([centred]), found.response, rtol=1e-8, why="linear in y")
    u = record.matrix(["u"])
    made = lfilter([0.0, GAIN], [1.0, -POLE], u - u.mean(axis=1, keepdims=True))
    assert_close(found.linear.apply([made])[0, 0], TRUTH, rtol=0.1, why="lags end at a cycle")


def test_errors_are_those_of_least_squares() -> None:
    """With white noise and one lag: the covariance of textbook least squares, by the delta rule."""
    u, e = np.random.default_rng(0).standard_normal((2, 1, 3000))
    y = 0.5 * np.concatenate([np.zeros((1, 1)), u[:, :-1]], axis=1) + e
    model = NoiseModel.of([u], [y], 1.0, 3.0, direct=False)
    (known,) = model.regressors
    assert_close(model.inverse, np.linalg.inv(known.T @ known), rtol=1e-6, why="rounding")
    step = 1e-6
    slopes = model.slopes(OMEGA)[0, 0]
    for place in range(len(model.coefficients)):
        moved = model.coefficients.copy()
        moved[place] += step
        other = NoiseModel(
            model.blocks, False, model.regressors, moved, model.inverse, model.innovations, 1.0
        )
        change = (other.response(OMEGA) - model.response(OMEGA))[0] / step
        assert_close(slopes[place], change, rtol=1e-4, atol=1e-4, why="differences")


def test_lags_cover_their_reach_once() -> None:
    blocks = lag_blocks(500, 99)
    assert blocks[0] == (1, 2)
    assert all(a[1] == b[0] for a, b in pairwise(blocks))
    assert blocks[-1][1] > 500
    assert len(blocks) < 40


def test_a_fit_of_a_piloted_sweep_has_intervals_that_hold() -> None:
    flown = closed_loops.record(1, feedback=closed_loops.PILOT)
    response = fid.estimate_response(flown, estimator="prewhitened", band_rad_s=(0.5, 10.0))
    assert response.loop is not None
    assert response.loop.source == "noise model"
    fit = fid.identify(closed_loops.model(), response)
    assert fit.provenance["estimator_bias"]["applied"]
    for name, truth in closed_loops.TRUTH.items():
        low, high = fit.parameters[name].interval95
        assert low < truth < high
    assert fit.parameters["Zcol"].stderr < 2.0


def test_records_too_short_for_a_noise_model_are_refused() -> None:
    rows = np.random.default_rng(0).standard_normal((2, 1, 20))
    with pytest.raises(DataError, match="too short for a model of the noise"):
        NoiseModel.of([rows[0]], [rows[1]], 1.0, 0.5, direct=True)
