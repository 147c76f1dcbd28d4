"""Minima of output error under slow noise: rigs of `tests.strangers.rig_lights` by seed."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import freqz

import flightid as fid
from flightid.identification.prediction_error.findings import CONVERGED
from tests.strangers import noises
from tests.strangers.rig_lights import STEP_S, Rig, injected


def in_slow_noise(seed: int) -> tuple[Rig, fid.Record]:
    """A multisine through a rig, AR(1) 0.98 of a fifth of its output beside it."""
    random = np.random.default_rng([seed, 66])
    rig = Rig(random)
    u = injected(random, "multisine", 2000, rig.omega)
    y = rig.answer(u)
    noise = noises.ar1(random, y.size, 0.98)
    y = y + 0.2 * y.std() * noise / noise.std()
    time_s = np.arange(y.size) * STEP_S
    return rig, fid.Record.from_arrays(time_s, inputs={"u": u}, outputs={"y": y}, hold="zero")


def fitted(rig: Rig, record: fid.Record) -> fid.Fit:
    orders = {"nb": rig.order, "nf": rig.order, "nk": rig.delay + 1}
    return fid.identify(fid.PolynomialModel.oe("u", "y", **orders), record, loop="open")


@pytest.mark.parametrize(("seed", "before", "tolerance"), [(3003, 0.09, 0.03), (3011, 0.05, 0.04)])
def test_colour_tells_which_minimum_of_slow_noise_is_the_rig(seed, before, tolerance):
    rig, record = in_slow_noise(seed)
    fit = fitted(rig, record)
    omega = np.geomspace(rig.omega / 8, 4 * rig.omega, 15) * STEP_S
    truth = freqz(rig.b, rig.a, omega)[1]

    def off(values):
        theta, n = np.array(list(values.values())), rig.order
        b = np.concatenate([np.zeros(rig.delay + 1), theta[:n]])
        found = freqz(b, np.concatenate([[1.0], theta[n:]]), omega)[1]
        return np.linalg.norm(found - truth) / np.linalg.norm(truth)

    least = min(fit.minima, key=lambda each: each.objective)
    assert least.objective < fit.minima[0].objective
    assert off(least.values) > before
    assert off(fit.minima[0].values) < tolerance
    assert fit.objective == fit.minima[0].objective
    (said,) = (each.message for each in fit.findings if each.code == "local-minima")
    assert "above another, which chance explains" in said
    assert fit.covariance is not None


def test_start_from_whitened_data_finds_the_rig_where_the_others_stall():
    rig, record = in_slow_noise(4019)
    fit = fitted(rig, record)
    assert fit.termination in CONVERGED
    assert fit.objective < 300.0
    assert max(each.objective for each in fit.minima) > 600.0
