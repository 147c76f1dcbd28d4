"""A fit takes nothing of a loop above what was injected, however coherent it is there."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import flightid as fid
from flightid.responses.injected_span import injected_span
from flightid.responses.store import read_response, write_response

LOW_HZ, TOP_HZ, STEP_S = 0.3, 6.0, 0.01


def _looped(loop: str | None = None) -> fid.Record:
    """A rate that a loop steers, swept to `TOP_HZ`, without noise: all of it is coherent."""
    t = np.arange(0.0, 40.0, STEP_S)
    growth = np.log(TOP_HZ / LOW_HZ) / t[-1]
    fade = np.minimum(1.0, np.minimum(t, t[-1] - t))
    swept = 0.1 * fade * np.sin(2.0 * np.pi * LOW_HZ * (np.exp(growth * t) - 1.0) / growth)
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
    ends = 2.0 * np.pi * np.array([LOW_HZ, TOP_HZ])
    assert response.injected_rad_s == pytest.approx(ends, rel=0.15)
    assert response.injected_rad_s[1] == pytest.approx(ends[1], rel=0.1)
    fit = fid.identify(fid.load_model("rate_first_order", axis="roll"), response)
    assert fit.responses[0].omega_rad_s[-1] <= 1.1 * 2.0 * np.pi * TOP_HZ
    if estimator == "instrument":
        # Below it one point, 4.5 dB off, made a fit's cost 49 in place of .3.
        assert response.omega_rad_s[0] < 0.99 * response.injected_rad_s[0]
        assert fit.responses[0].omega_rad_s[0] >= 0.99 * response.injected_rad_s[0]
    if estimator == "prewhitened":
        return  # which has no coherence outside
    above = response.omega_rad_s > 1.1 * 2.0 * np.pi * TOP_HZ
    assert np.any(response.coherence[0, 0, above] > 0.9), "there is nothing to be taken in by"
    # Who gives a band is taken at his word.
    wide = (2.0, 50.0)
    own = fid.identify(fid.load_model("rate_first_order", axis="roll"), response, band_rad_s=wide)
    assert own.responses[0].omega_rad_s[-1] > 45.0


@pytest.mark.parametrize(("low_hz", "top_hz"), [(0.4, 5.0), (0.25, 11.0), (0.1, 3.0)])
def test_a_window_does_not_widen_what_was_injected(low_hz: float, top_hz: float) -> None:
    """A sweep from 0.25 Hz was said to begin at 0.17: what its window spreads was taken for it."""
    t = np.arange(0.0, 60.0, STEP_S)
    growth = np.log(top_hz / low_hz) / t[-1]
    swept = np.sin(2.0 * np.pi * low_hz * (np.exp(growth * t) - 1.0) / growth)
    swept *= np.minimum(1.0, np.minimum(t, t[-1] - t))
    made = fid.Record.from_arrays(t, inputs={"u": swept}, excitations={"i": swept})
    span = injected_span([made])
    assert span is not None
    low, high = np.array(span) / (2.0 * np.pi)
    assert abs(low - low_hz) <= 1.5 / 24.0, "one and a half lines of its windows of 24 s"
    assert abs(high - top_hz) <= 0.15 * top_hz


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
