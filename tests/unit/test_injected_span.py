"""A fit takes nothing of a loop above what was injected, however coherent it is there."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import flightid as fid
from flightid.responses.injected_span import injected_span
from flightid.responses.store import read_response, write_response

TOP_HZ, STEP_S = 6.0, 0.01


def _looped(loop: str | None = None) -> fid.Record:
    """A rate that a loop steers, swept to `TOP_HZ`, without noise: all of it is coherent."""
    t = np.arange(0.0, 40.0, STEP_S)
    growth = np.log(TOP_HZ / 0.3) / t[-1]
    fade = np.minimum(1.0, np.minimum(t, t[-1] - t))
    swept = 0.1 * fade * np.sin(2.0 * np.pi * 0.3 * (np.exp(growth * t) - 1.0) / growth)
    pole, u, p = np.exp(-3.0 * STEP_S), np.zeros(t.size), np.zeros(t.size)
    gust = 1e-4 * np.random.default_rng(0).standard_normal(t.size)
    for k in range(t.size - 1):
        u[k] = swept[k] - 0.1 * p[k]
        p[k + 1] = pole * p[k] + 20.0 * (1.0 - pole) * u[k] + gust[k]
    told = {} if loop is None else {"loop": loop}
    return fid.Record.from_arrays(
        t, inputs={"tau_phi": u}, outputs={"p": p}, excitations={"injected": swept},
        units={"p": "rad/s", "tau_phi": "1"}, hold="zero", **told,
    )  # fmt: skip


@pytest.mark.parametrize("estimator", ["instrument", "composite", "prewhitened"])
def test_a_fit_ends_with_what_was_injected(estimator: str) -> None:
    response = fid.estimate_response(
        _looped(), inputs="tau_phi", outputs="p", estimator=estimator, n_omega=60
    )
    assert response.injected_rad_s is not None
    assert response.injected_rad_s[1] == pytest.approx(2.0 * np.pi * TOP_HZ, rel=0.1)
    fit = fid.identify(fid.load_model("rate_first_order", axis="roll"), response)
    assert fit.responses[0].omega_rad_s[-1] <= 1.1 * 2.0 * np.pi * TOP_HZ
    if estimator == "prewhitened":
        return  # which has no coherence outside
    above = response.omega_rad_s > 1.1 * 2.0 * np.pi * TOP_HZ
    assert np.any(response.coherence[0, 0, above] > 0.9), "there is nothing to be taken in by"
    # Who gives a band is taken at his word.
    wide = (2.0, 50.0)
    own = fid.identify(fid.load_model("rate_first_order", axis="roll"), response, band_rad_s=wide)
    assert own.responses[0].omega_rad_s[-1] > 45.0


def test_of_an_open_loop_all_that_is_coherent_counts() -> None:
    response = fid.estimate_response(_looped("open"), inputs="tau_phi", outputs="p", n_omega=60)
    fit = fid.identify(fid.load_model("rate_first_order", axis="roll"), response)
    assert fit.responses[0].omega_rad_s[-1] > 1.3 * 2.0 * np.pi * TOP_HZ


def test_a_stored_response_knows_its_injection(tmp_path: Path) -> None:
    response = fid.estimate_response(
        _looped(), inputs="tau_phi", outputs="p", estimator="instrument"
    )
    again = read_response(write_response(response, tmp_path / "p.nc"))
    assert again.injected_rad_s == response.injected_rad_s
    t = np.arange(0.0, 1.0, STEP_S)
    still = fid.Record.from_arrays(t, inputs={"u": t}, outputs={"y": t}, excitations={"i": 0 * t})
    assert injected_span([still]) is None
