"""The bias that a closed loop brings into a direct estimate, beside what it is in theory."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from scipy.signal import lfilter

import flightid as fid
from flightid.uncertainty.blocks import JointResiduals, RecordBlock
from flightid.uncertainty.coloured_residuals import residual_covariance
from flightid.uncertainty.fed_noise import fed_noise_spectrum
from tests.closeness import assert_close
from tests.strangers import closed_loops, loop_shifts

POLE, GAIN, FED = 0.9, 0.5, -0.3


def _loop(n: int, *, late: int = 1, direct: float = 0.0) -> tuple[np.ndarray, np.ndarray]:
    """y = (G + direct) u + v, G = 0.5 z⁻¹/(1 − 0.9 z⁻¹), v = e/(1 − 0.9 z⁻¹); u = r − 0.3 z⁻ˡ y.

    The controller answers `late` samples later.
    """
    fresh, e = np.random.default_rng(3).standard_normal((2, n))
    way, back = np.array([direct, GAIN - direct * POLE, 0.0]), np.eye(2)[late] * FED
    around = np.array([1.0, -POLE, 0.0]) - np.convolve(back, way[:2])
    y = lfilter(way, around, fresh) + lfilter([1.0], around, e)
    return fresh + lfilter(back, [1.0], y), y


@pytest.mark.parametrize(
    ("late", "direct"),
    [
        (1, 0.0),
        (0, 0.8),
        *(pytest.param(*each, marks=pytest.mark.nightly) for each in [(0, 0.0), (1, 0.8)]),
    ],
)
def test_the_spectrum_of_fed_noise_is_that_of_the_loop(late: int, direct: float) -> None:
    u, y = _loop(60_000, late=late, direct=direct)
    omega = np.array([0.1, 0.5, 1.5])
    known = np.array([[direct]])
    found = fed_noise_spectrum([u[None]], [y[None]], 1.0, omega, known)
    turn = np.exp(-1j * omega)
    noise = 1.0 / (1.0 - POLE * turn)
    response = GAIN * turn * noise + direct
    way = FED * turn**late
    reached = way * noise / (1.0 - way * response)
    truth = 2.0 * reached.conj() * noise
    assert found is not None
    assert np.all(np.abs(found[:, 0, 0] / truth - 1.0) < 0.1)


def test_an_open_loop_feeds_nothing() -> None:
    u, e = np.random.default_rng(0).standard_normal((2, 4000))
    y = lfilter([0.0, GAIN], [1.0, -POLE], u) + e
    found = fed_noise_spectrum([u[None]], [y[None]], 1.0, np.array([0.5]))
    assert found is not None
    assert not np.any(found)


def test_a_fit_claims_the_shift_that_is_there() -> None:
    """One of the counts of `tests/strangers/loop_shifts.py`, at its plainest parameter."""
    claimed, shift = loop_shifts.claimed_and_true(loop_shifts.heave, range(2))
    assert_close(claimed["Zw"], shift["Zw"], rtol=0.5, why="two flights' scatter")


@cache
def _swept(feedback: float) -> fid.FrequencyResponse:
    flown = closed_loops.record(1, feedback=feedback)
    return fid.estimate_response(flown, band_rad_s=(0.5, 10.0), n_omega=40)


@pytest.mark.parametrize("feedback", [0.0, closed_loops.PILOT])
def test_a_fit_names_what_the_pilot_bends(feedback: float) -> None:
    response = _swept(feedback)
    fit = fid.identify(closed_loops.model(), response)
    named = [each.message for each in fit.findings if each.code == "loop-bias"]
    assert len(named) == (feedback > 0.0)
    assert all("Zw" in message and "Lp" not in message for message in named)
    assert (fit.covariance is None) is (feedback > 0.0)


def test_a_joint_fit_names_what_the_pilot_bends_in_its_response() -> None:
    response = _swept(closed_loops.PILOT)
    beside = closed_loops.record(7, feedback=closed_loops.PILOT, duration_s=10.0)[0]
    fit = fid.identify(
        closed_loops.model(),
        [response, beside],
        band_rad_s=(0.5, 10.0),
        minimum_coherence=None,
        correct_bias=False,
    )
    (named,) = [each.message for each in fit.findings if each.code == "loop-bias"]
    assert "Zcol" in named
    assert fit.covariance is None


def test_bias_beside_records_moves_estimates_as_least_squares_do() -> None:
    """One parameter: 3 points that it moves by 1 of them, the record by information 6."""
    block = RecordBlock.of(np.full((1, 6, 1), 1.0), np.zeros((1, 6, 0)), np.zeros((1, 6)))
    other = JointResiduals(np.ones((3, 1)), np.ones((3, 1)), bias=np.full(3, 0.3))
    known = residual_covariance([block], other)
    assert other.bias is not None
    assert_close(known.white @ (other.slopes.T @ other.bias), 0.1, rtol=1e-9, why="0.9 of 9")
