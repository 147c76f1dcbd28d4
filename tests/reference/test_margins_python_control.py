"""Margins of random loops against python-control's exact polynomial method."""

from __future__ import annotations

import control
import numpy as np
from hypothesis import given
from hypothesis import strategies as st

import flightid as fid
from flightid.control.margins.crossings import gain_crossings, phase_crossings
from flightid.control.margins.disk_geometry import gain_limits, phase_limit_deg
from flightid.control.margins.disk_margin import alphas_of
from flightid.control.margins.loop_metrics import loop_metrics
from tests.closeness import assert_close
from tests.examples import examples

OMEGA = np.geomspace(1e-3, 1e4, 15000)


def random_loop(seed, order):
    """Well-damped poles and zeros, so that the grid resolves every turn."""
    rng = np.random.default_rng(seed)

    def polynomial(n):
        found = np.ones(1)
        for _ in range(n // 2):
            natural, damping = np.exp(rng.uniform(-1, 3)), rng.uniform(0.2, 1.0)
            found = np.polymul(found, [1.0, 2 * damping * natural, natural**2])
        return np.polymul(found, [1.0, np.exp(rng.uniform(-1, 3))]) if n % 2 else found

    below = np.polymul(polynomial(order), [1.0, 0.0] if rng.random() < 0.5 else [1.0, 0.3])
    above = polynomial(max(order - 2, 0))
    gain = np.exp(rng.uniform(-1, 3)) * abs(np.polyval(below, 3j)) / abs(np.polyval(above, 3j))
    return control.tf(gain * above, below)


@examples(80)
@given(st.integers(0, 2**32 - 1), st.integers(1, 6))
def test_every_crossing_is_python_controls(seed, order):
    loop = random_loop(seed, order)
    values = loop(1j * OMEGA)
    gm, pm, _, w180, wc, _ = control.stability_margins(loop, returnall=True)
    inside = (w180 > OMEGA[0]) & (w180 < OMEGA[-1]) & (gm < 1e6)
    logs, rows = np.log(OMEGA), values[None, :]
    phases, gains = phase_crossings(logs, rows), gain_crossings(logs, rows)
    big = phases.kept(phases.value > np.log(1e-6))
    assert_close(big.omega, w180[inside], rtol=1e-4, why="phase crossings")
    assert_close(np.exp(-big.value), gm[inside], rtol=1e-4, why="gain margins")
    assert_close(gains.omega, wc, rtol=1e-5, why="gain crossings")
    assert_close(np.degrees(gains.value), pm, atol=0.01, why="phase margins")


@examples(80)
@given(st.integers(0, 2**32 - 1), st.integers(1, 6))
def test_worst_margins_are_python_controls(seed, order):
    loop = random_loop(seed, order)
    found = loop_metrics(OMEGA, loop(1j * OMEGA))
    poles = control.feedback(loop, 1).poles()
    stable = bool(np.all(poles.real < 0))
    if np.min(np.abs(poles.real)) > 1e-4:
        assert bool(found.is_stable) == stable
    gm, pm, sm, _, wc, wms = control.stability_margins(loop)
    if np.isfinite(pm):
        assert_close(abs(found.phase_margin_deg), abs(pm), atol=0.01, why="worst crossing")
        assert_close(found.crossover_rad_s, wc, rtol=1e-4, why="where")
    ours = np.array([found.gain_margin_db, found.gain_reduction_margin_db])
    if np.isfinite(gm) and gm < 1e6:
        nearest = np.nanmin(np.abs(ours))
        assert_close(nearest, abs(20 * np.log10(gm)), atol=0.003, why="nearest to one")
    if sm > 1e-3 and OMEGA[0] < wms < OMEGA[-1]:
        assert_close(found.modulus_margin, sm, rtol=1e-3, why="least distance from −1")


def test_published_example():
    # Seiler, Packard & Gahinet (2020), Example: L = 25/(s³ + 10s² + 10s + 10).
    loop = control.tf([25.0], [1.0, 10.0, 10.0, 10.0])
    found = loop_metrics(OMEGA, loop(1j * OMEGA))
    # Routh: 90 = 25 k at the limit, less the constant 10: k = 3.6.
    assert_close(found.gain_margin_db, 20 * np.log10(3.6), atol=1e-4, why="Routh's limit")
    gm, pm, *_ = control.stability_margins(loop)
    assert_close(found.phase_margin_deg, pm, atol=1e-3, why="exact polynomial")
    assert_close(gm, 3.6, rtol=1e-9, why="the peer knows it too")


@examples(25)
@given(st.integers(0, 2**32 - 1), st.integers(1, 5), st.sampled_from([-1.0, 0.0, 0.4, 1.0]))
def test_disk_margins_of_single_loops_are_python_controls(seed, order, skew):
    loop = control.ss(random_loop(seed, order))
    if np.any(control.feedback(loop, 1).poles().real > -1e-3):
        return
    omega = np.geomspace(1e-2, 1e3, 300)
    peer = control.disk_margins(loop, omega, skew=skew, returnall=True)
    ours = alphas_of(loop(1j * omega)[:, None, None], skew)
    assert_close(ours, peer[0], rtol=1e-6, why="one over a magnitude")
    for alpha, gain, phase in zip(ours[::10], peer[1][::10], peer[2][::10], strict=True):
        low, high = gain_limits(alpha, skew)
        if low > 0 and np.isfinite(high):
            both = 20 * np.log10(min(1 / low, high))
            assert_close(both, gain, rtol=1e-6, why="the nearer end")
            if np.isfinite(phase):
                assert_close(phase_limit_deg(alpha, skew), phase, rtol=1e-6, why="unit circle")


def test_disk_margin_of_the_published_two_loop_example():
    # Spinning body under a constant law: 0.3754 for both loops at once, 3.3 dB and 21.26°, in
    # python-control's tests. A search over the one scaling at zero frequency gives 0.37615, which
    # is exact for two loops: the published figure is the lower bound of a slacker search.
    plant = fid.LinearSystem(
        [[0.0, 10.0], [-10.0, 0.0]],
        np.eye(2),
        [[1.0, 10.0], [-10.0, 1.0]],
        np.zeros((2, 2)),
        ("u1", "u2"),
        ("y1", "y2"),
    )
    none = np.zeros((0, 0))
    law = fid.LinearSystem(
        none,
        np.zeros((0, 2)),
        np.zeros((2, 0)),
        [[1.0, -2.0], [0.0, 1.0]],
        ("y1", "y2"),
        ("u1", "u2"),
    )
    found = fid.disk_margin(plant, controller=law)
    assert_close(found.alpha.value, 0.3761521, rtol=1e-5, why="exact for two loops")
    assert_close(found.alpha.value, 0.3754, rtol=0.003, why="published lower bound")
    assert_close(found.gain_rise.value, 3.3, atol=0.06, why="published to two digits")
    assert_close(found.phase.value, 21.26, atol=0.06, why="published lower bound")
    omega = np.geomspace(1e-4, 1e3, 50)
    for at in ("outputs", "inputs"):
        other = fid.disk_margin(plant, controller=law, at=at)
        assert_close(other.alpha.value, found.alpha.value, rtol=1e-5, why="published as equal")
    assert np.all(np.interp(omega, other.omega_rad_s, other.alphas) >= found.alpha.value * 0.999)


def test_published_single_loop_disk():
    # Seiler, Packard & Gahinet (2020): 25/(s³ + 10s² + 10s + 10) has α = 0.46 at 1.94 rad/s.
    a = [[-10.0, -10.0, -10.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]
    loop = fid.LinearSystem(a, [[1.0], [0.0], [0.0]], [[0.0, 0.0, 25.0]], [[0.0]], ("e",), ("y",))
    found = fid.disk_margin(loop)
    assert_close(found.alpha.value, 0.46, atol=0.005, why="published to two digits")
    assert_close(found.frequency.value, 1.94, atol=0.02, why="published, found on a grid")
    assert_close(found.gain_rise.value, 4.05, atol=0.01, why="published")
    assert_close(found.phase.value, 25.8, atol=0.1, why="published")
