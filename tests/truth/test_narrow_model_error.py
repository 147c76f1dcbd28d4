"""A light mode that a structure lacks: its error bound reaches it, though short windows smooth it.

The truth is a transfer function in SciPy; records are of its exact answer to a sweep in straight
lines, with white noise.
"""

from __future__ import annotations

import numpy as np
import pytest
from scipy import signal

import flightid as fid
from flightid.identification.model_error import ModelErrorBound, reaching
from flightid.responses.estimators.by_window import NarrowResidual
from tests.closeness import assert_close

STEP_S, RECORD_S = 0.02, 60.0
MODE, ZETA, SHARE = 3.25, 0.1, 0.05
RIGID = np.array([90.0]), np.array([0.05, 1.15, 3.0])


def with_mode() -> tuple[np.ndarray, np.ndarray]:
    """A damped rate behind a lag, moved by a mode: two zeros just below two poles."""
    beside = MODE * np.sqrt(1.0 + SHARE)
    zeros, poles = ([1.0 / w**2, 2.0 * ZETA / w, 1.0] for w in (MODE, beside))
    return np.polymul(RIGID[0], zeros), np.polymul(RIGID[1], poles)


def flown(seed: int, truth: tuple[np.ndarray, np.ndarray]) -> fid.Record:
    time_s = np.arange(round(RECORD_S / STEP_S)) * STEP_S
    u = 0.1 * signal.chirp(time_s, 0.15, RECORD_S, 6.0, method="logarithmic")
    u *= np.clip(np.minimum(time_s, RECORD_S - time_s) / 2.0, 0.0, 1.0)
    y = signal.lsim(truth, u, time_s)[1]
    y += 0.02 * np.random.default_rng(seed).standard_normal(len(y))
    return fid.Record.from_arrays(
        time_s, inputs={"tau_phi": u}, outputs={"p": y}, units={"p": "rad/s"}, hold="first"
    ).declare(loop="open")


def errors_of(method: str, truth: tuple[np.ndarray, np.ndarray]) -> tuple[fid.Fit, ModelErrorBound]:
    records = [flown(seed, truth) for seed in (1, 2)]
    model = fid.load_model("rate_motor_lag", axis="roll")
    if method == "output_error":
        fit = fid.identify(model, records, method=method)
    else:
        fit = fid.identify(model, fid.estimate_response(records, inputs="tau_phi", outputs="p"))
    return fit, fit.model_errors["p/tau_phi"]


@pytest.mark.parametrize("method", ["frequency_domain", "output_error"])
def test_the_bound_holds_what_a_narrow_mode_does_to_the_response(method: str) -> None:
    truth = with_mode()
    fit, bound = errors_of(method, truth)
    omega = np.linspace(0.8 * MODE, 1.25 * MODE, 40)
    model = fit.model.frequency_response(omega)[0, 0]
    true = np.abs(signal.freqresp(truth, omega)[1] / model - 1.0)
    assert np.max(true) > 0.1, "the mode is worth a test"
    assert np.all(bound.at(omega) > true), "nowhere nearer than the truth"


def test_without_a_mode_single_windows_add_little() -> None:
    fit, bound = errors_of("frequency_domain", RIGID)
    each = fit.left.narrow["p/tau_phi"]
    assert len(each) == 3
    inside = (bound.omega_rad_s > 2.0) & (bound.omega_rad_s < 30.0)
    assert np.max(bound.bound[inside]) < 0.1


def test_a_bound_reaches_what_stands_out_of_the_noise_alone() -> None:
    omega = np.array([1.0, 2.0, 2.1, 4.0])
    bound = ModelErrorBound(omega, np.full(4, 0.1))
    one = NarrowResidual(24.0, omega[1:], np.array([0.3j, 0.1, 0.2]), np.array([0.05, 0.05, 0.1]))
    found = reaching(bound, [one]).bound
    assert_close(found, [0.1, 0.4, 0.2, 0.1], rtol=1e-12, why="and what lies within its bin")
