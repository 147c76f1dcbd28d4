"""Fits in a closed loop beside the excitations that were injected into it; NumPy's flights."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import flightid as fid
from flightid.identification.loop_judged import excitation_tests, with_loop_judged
from tests.strangers import gains

STEP_S, POLE, EFFECT, LATE = 0.02, -3.0, 40.0, 2


def _flown(seed: int, *, lag_s: float = 0.0, n: int = 3000) -> fid.Record:
    """A rate behind a held controller that feeds the sensor's noise back; exact between samples."""
    random, time_s = np.random.default_rng(seed), np.arange(n) * STEP_S
    sweep = 0.1 * np.sin(2.0 * np.pi * (0.1 + 1.95 * time_s / time_s[-1]) * time_s)
    decay = np.exp(POLE * STEP_S)
    slow = np.exp(-STEP_S / lag_s) if lag_s else 0.0
    rate, behind, queue = 0.0, 0.0, [0.0] * LATE
    rows = np.zeros((2, n))
    for k in range(n):
        seen = rate + 0.02 * random.standard_normal()
        rows[:, k] = sweep[k] - 0.02 * seen, seen
        queue.append(float(rows[0, k]))
        behind = slow * behind + (1.0 - slow) * queue.pop(0)
        rate = decay * rate + EFFECT * (decay - 1.0) / POLE * behind
    return fid.Record.from_arrays(
        time_s, inputs={"u": rows[0]}, outputs={"p": rows[1]}, excitations={"e": sweep},
        units={"u": "1", "p": "rad/s"}, hold="zero",
    )  # fmt: skip


def _model() -> fid.TransferFunctionModel:
    known = [
        fid.Parameter("K", 30.0, "rad/s^2"),
        fid.Parameter("Lp", -2.0, "1/s"),
        fid.Parameter("tau", 0.03, "s", minimum=0.0),
    ]
    path = fid.TransferFunction("p", "u", "K", denominator=("s - Lp",), delay="tau")
    return fid.TransferFunctionModel((path,), fid.Parameters(known), units={"u": "1", "p": "rad/s"})


@pytest.mark.parametrize("seed", range(3))
def test_a_right_model_keeps_its_intervals(seed: int) -> None:
    fit = fid.identify(_model(), _flown(seed), loop="closed")
    assert all(each.interval95 is not None for each in fit.parameters.values())
    assert (excitation_tests(fit).independent or 0.0) > 0.01


def test_an_excitation_refutes_a_model_that_feedback_biased() -> None:
    """A hover in gusts that its loop feeds back: 26 % off at 23 rad/s, where bars said 6 %."""
    fit = gains.fitted(gains.drawn(5001), 5001)
    (said,) = (each for each in fit.findings if each.code == "excitation-refutes")
    assert str(said.light) == str(fit.evidence.light) == "red"
    assert "instrument" in said.action
    assert fit.covariance is None
    assert all(each.interval95 is None for each in fit.parameters.values())
    assert "misses a part of the answer to what was injected" in fit.withheld


def test_open_loops_are_judged_by_their_inputs() -> None:
    fit = fid.identify(_model(), _flown(0, lag_s=0.1), loop="closed")
    bars = replace(fit, covariance=np.eye(len(fit.names)))
    assert with_loop_judged(bars, "open") is bars
    assert with_loop_judged(bars, "closed").covariance is None


@pytest.mark.nightly
def test_one_right_model_in_a_hundred_is_refused_at_most() -> None:
    refused = [
        "excitation-refutes" in [each.code for each in fid.identify(_model(), flown).findings]
        for flown in map(_flown, range(100, 180))
    ]
    assert sum(refused) <= 4


def test_a_model_that_answers_within_the_sample_of_a_loop_is_red() -> None:
    """A controller turned round: gain -196 = -1 / K of a rig whose own is positive, amber."""
    flown = _flown(0)
    record = fid.Record.from_arrays(
        flown.time_s, inputs={"u": flown["u"]}, outputs={"p": flown["p"]}, hold="zero"
    )
    for nk, light in ((0, "red"), (1, "amber")):
        structure = fid.PolynomialModel.oe("u", "p", nb=2, nf=1, nk=nk)
        fit = fid.identify(structure, record, loop="closed")
        assert str(fit.evidence.check("loop").light) == light
