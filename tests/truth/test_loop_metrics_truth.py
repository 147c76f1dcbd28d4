"""Margins of many loops against closed forms, eigenvalues and their own laws."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from flightid.control.margins.loop_metrics import loop_metrics
from flightid.errors import DataError, ShapeError
from tests.closeness import assert_close
from tests.examples import examples

OMEGA = np.geomspace(1e-2, 1e3, 4000)
S = 1j * OMEGA
FINE = 2e-5


def test_integrator_with_delay():
    gain, delay = 4.0, 0.1
    found = loop_metrics(OMEGA, gain * np.exp(-S * delay) / S)
    crossing = 0.5 * np.pi / delay
    assert_close(found.crossover_rad_s, gain, rtol=1e-9, why="k/ω = 1 is a straight line")
    assert_close(found.phase_margin_deg, 90 - np.degrees(gain * delay), rtol=FINE, why="90 − ωτ")
    assert_close(found.gain_margin_db, 20 * np.log10(crossing / gain), rtol=FINE, why="ω_180/k")
    assert_close(found.phase_crossover_rad_s, crossing, rtol=FINE, why="π/2τ")
    assert_close(found.delay_margin_s, 0.5 * np.pi / gain - delay, rtol=FINE, why="π/2k − τ")
    assert np.isnan(found.gain_reduction_margin_db)
    assert found.is_stable


def test_second_order_closed_loop():
    # L = ωn²/(s(s + 2ζωn)): T is the standard second-order system, with known peaks.
    zeta, natural = 0.3, 5.0
    found = loop_metrics(OMEGA, natural**2 / (S * (S + 2 * zeta * natural)))
    root = np.sqrt(np.sqrt(4 * zeta**4 + 1) - 2 * zeta**2)
    assert_close(found.crossover_rad_s, natural * root, rtol=FINE, why="closed form")
    assert_close(
        found.phase_margin_deg, np.degrees(np.arctan2(2 * zeta, root)), rtol=FINE, why="closed form"
    )
    peak = 1 / (2 * zeta * np.sqrt(1 - zeta**2))
    assert_close(found.complementary_peak, peak, rtol=1e-6, why="resonant peak")
    place = natural * np.sqrt(1 - 2 * zeta**2)
    assert_close(found.complementary_peak_rad_s, place, rtol=1e-4, why="resonant frequency")
    assert np.isnan(found.gain_margin_db)
    # |S|² = r at x = (ω/ωn)²: x² + 4ζ²x = r((1 − x)² + 4ζ²x).
    r = 10**-0.3
    roots = np.roots([1 - r, 4 * zeta**2 * (1 - r) + 2 * r, -r])
    expected = natural * np.sqrt(roots[roots > 0].min())
    assert_close(found.disturbance_bandwidth_rad_s, expected, rtol=FINE, why="quadratic in ω²")
    x = np.linspace(0, 4, 400_001)
    top = np.sqrt(np.max((x**2 + 4 * zeta**2 * x) / ((1 - x) ** 2 + 4 * zeta**2 * x)))
    assert_close(found.sensitivity_peak, top, rtol=1e-6, why="dense search")
    assert_close(found.disturbance_peak_db, 20 * np.log10(top), rtol=1e-5, why="the same in dB")
    assert_close(found.modulus_margin, 1 / top, rtol=1e-6, why="its inverse")


def test_double_integrator_with_lead():
    # Lead centred on crossover by design: PM = asin((a − 1)/(a + 1)).
    a, crossover = 9.0, 3.0
    lead = (np.sqrt(a) * S + crossover) / (S / np.sqrt(a) + crossover)
    found = loop_metrics(OMEGA, crossover**2 / np.sqrt(a) * lead / S**2)
    expected = np.degrees(np.arcsin((a - 1) / (a + 1)))
    assert_close(found.crossover_rad_s, crossover, rtol=FINE, why="by design")
    assert_close(found.phase_margin_deg, expected, rtol=FINE, why="by design")
    assert found.is_stable
    assert np.isnan(found.gain_margin_db)


def test_unstable_plant_has_a_gain_reduction_margin():
    # k/(s − 1) e^{−τs}: stable for 1 < k < about π/(2τ); the lower limit lies at zero frequency.
    gain, delay = 4.0, 0.05
    found = loop_metrics(OMEGA, gain * np.exp(-S * delay) / (S - 1), unstable_poles=1)
    assert found.is_stable
    assert_close(found.gain_reduction_margin_db, 20 * np.log10(gain), rtol=1e-4, why="k > 1")
    crossover = np.sqrt(gain**2 - 1)
    lag = np.arctan(crossover) - delay * crossover
    assert_close(found.phase_margin_deg, np.degrees(lag), rtol=1e-4, why="−180 + atan ω − ωτ")
    assert found.gain_margin_db > 0
    low = loop_metrics(OMEGA, 0.5 * np.exp(-S * delay) / (S - 1), unstable_poles=1)
    assert not low.is_stable
    assert_close(low.gain_reduction_margin_db, 20 * np.log10(0.5), rtol=1e-3, why="must rise")


def test_unstable_plant_under_integral_action():
    # k(s + z)/(s(s − p)): closed loop s² + (k − p)s + kz, stable for k > p.
    pole, zero, gain = 2.0, 1.0, 6.0
    found = loop_metrics(OMEGA, gain * (S + zero) / (S * (S - pole)), unstable_poles=1)
    assert found.is_stable
    assert_close(found.gain_reduction_margin_db, 20 * np.log10(gain / pole), rtol=FINE, why="k/p")
    assert_close(found.gain_reduction_rad_s, np.sqrt(pole * zero), rtol=FINE, why="√(pz)")
    low = loop_metrics(OMEGA, 1.0 * (S + zero) / (S * (S - pole)), unstable_poles=1)
    assert low.unstable_poles == 2
    assert_close(low.gain_reduction_margin_db, -20 * np.log10(2.0), rtol=FINE, why="must rise")
    assert low.phase_margin_deg < 0
    assert low.delay_margin_s < 0


def test_the_worst_of_several_crossings_counts():
    # A lightly damped mode beyond crossover lifts the gain over one again.
    mode = 1 + 40.0 * S / (S**2 + 0.4 * S + 400.0)
    loop = 2.0 / S * mode * np.exp(-0.02 * S)
    found = loop_metrics(OMEGA, loop)
    gain = np.abs(loop)
    places = np.flatnonzero((gain[1:] - 1) * (gain[:-1] - 1) < 0)
    assert len(places) == 3
    phases = np.abs((np.degrees(np.angle(loop[places])) + 360) % 360 - 180)
    assert_close(found.crossover_rad_s, OMEGA[places[phases.argmin()]], rtol=3e-3, why="worst one")
    assert_close(np.abs(found.phase_margin_deg), phases.min(), atol=1.0, why="worst one")
    assert found.crossover_rad_s > 10.0


def test_rows_do_not_mix_and_shapes_are_kept():
    gains = np.array([[0.5, 1.0, 2.0], [4.0, 8.0, 40.0]])
    loops = gains[..., None] * np.exp(-0.05 * S) / S
    found = loop_metrics(OMEGA, loops)
    for place in np.ndindex(gains.shape):
        alone = loop_metrics(OMEGA, loops[place])
        for name in vars(alone):
            np.testing.assert_array_equal(getattr(found, name)[place], getattr(alone, name))
    assert found.is_stable.tolist() == [[True, True, True], [True, True, False]]
    assert repr(found).startswith("LoopMetrics(6 loops, 5 stable, worst sensitivity peak")


def test_no_crossing_is_not_a_number():
    found = loop_metrics(OMEGA, 0.3 / (S + 1))
    for name in ("crossover_rad_s", "phase_margin_deg", "gain_margin_db", "delay_margin_s"):
        assert np.isnan(getattr(found, name)), name
    assert np.isnan(found.disturbance_bandwidth_rad_s)
    assert found.is_stable


@st.composite
def loops(draw):
    """State-space loops of order 1 to 5, some unstable, some with an integrator."""
    seed = draw(st.integers(0, 2**32 - 1))
    rng = np.random.default_rng(seed)
    n = draw(st.integers(1, 5))
    a = rng.standard_normal((n, n)) * 3.0 + draw(st.sampled_from([-6.0, -3.0, 0.0])) * np.eye(n)
    b, c = rng.standard_normal((n, 1)), rng.standard_normal((1, n))
    if draw(st.booleans()):
        a = np.block([[a, b], [np.zeros((1, n + 1))]])
        b = np.vstack([np.zeros((n, 1)), np.ones((1, 1))])
        c = np.hstack([c, np.zeros((1, 1))])
    return a, b, c * draw(st.sampled_from([1.0, 5.0, 30.0]))


def response(a, b, c, omega):
    solved = np.linalg.solve(1j * omega[:, None, None] * np.eye(len(a)) - a, b + 0j)
    return (c @ solved)[:, 0, 0]


WIDE = np.geomspace(1e-3, 1e4, 8000)


@examples(100)
@given(loops())
def test_nyquist_verdict_equals_eigenvalues(loop):
    a, b, c = loop
    poles, closed = np.linalg.eigvals(a), np.linalg.eigvals(a - b @ c)
    # A pole near the imaginary axis is a resonance that no grid resolves.
    if np.min(np.abs(closed.real)) < 0.02 or np.any(
        (np.abs(poles.real) < 0.02) & (poles.imag != 0)
    ):
        return
    if np.any((np.abs(poles) < 0.05) & (np.abs(poles) > 1e-12)):
        return
    unstable = int(np.count_nonzero(poles.real > 1e-9))
    found = loop_metrics(WIDE, response(a, b, c, WIDE), unstable_poles=unstable)
    assert found.unstable_poles == np.count_nonzero(closed.real > 0)


@examples(60)
@given(loops(), st.floats(0.2, 5.0))
def test_gain_moves_gain_margins_and_nothing_else(loop, gain):
    a, b, c = loop
    values = response(a, b, c, WIDE)
    poles = int(np.count_nonzero(np.linalg.eigvals(a).real > 1e-9))
    one = loop_metrics(WIDE, values, unstable_poles=poles)
    two = loop_metrics(WIDE, gain * values, unstable_poles=poles)
    shift = 20 * np.log10(gain)
    if one.is_stable and two.is_stable and not np.isnan(one.gain_margin_db):
        # The crossing that bounds the first still bounds the second, or a nearer one does.
        assert two.gain_margin_db <= one.gain_margin_db - shift + 1e-6
    if one.is_stable and two.is_stable and not np.isnan(one.gain_reduction_margin_db):
        assert two.gain_reduction_margin_db <= one.gain_reduction_margin_db + shift + 1e-6
    at = one.crossover_rad_s
    if not np.isnan(at) and one.is_stable and 0 < one.delay_margin_s < 1.0:
        late = values * np.exp(-1j * WIDE * 0.5 * one.delay_margin_s)
        left = loop_metrics(WIDE, late, unstable_poles=poles).delay_margin_s
        assert_close(
            left, 0.5 * one.delay_margin_s, rtol=1e-3, why="delay margin is spent by delay"
        )


@examples(60)
@given(st.floats(0.3, 8.0), st.floats(0.0, 0.08), st.floats(0.5, 2.0))
def test_gain_margin_shifts_by_the_gain(gain, delay, factor):
    loop = gain * np.exp(-S * (delay + 0.01)) / (S * (0.02 * S + 1))
    one, two = loop_metrics(OMEGA, loop), loop_metrics(OMEGA, factor * loop)
    shift = 20 * np.log10(factor)
    assert_close(two.gain_margin_db, one.gain_margin_db - shift, atol=1e-9, why="same crossing")
    lag = np.radians(one.phase_margin_deg) / one.crossover_rad_s
    assert_close(one.delay_margin_s, lag, rtol=1e-12, why="PM/ω")


def test_what_is_no_loop_is_refused():
    with pytest.raises(ShapeError, match="loops and frequencies do not fit"):
        loop_metrics(OMEGA, np.ones(5))
    with pytest.raises(ShapeError, match="loops and frequencies do not fit"):
        loop_metrics([1.0, 2.0], np.ones(2))
    with pytest.raises(DataError, match="frequencies must be positive and increase"):
        loop_metrics([0.0, 1.0, 2.0], np.ones(3))
    with pytest.raises(DataError, match="zero or not finite"):
        loop_metrics([1.0, 2.0, 3.0], [1.0, 0.0, 1.0])
    with pytest.raises(ShapeError, match="unstable_poles does not fit"):
        loop_metrics(OMEGA, np.ones((2, len(OMEGA))), unstable_poles=[1, 2, 3])


def test_delay_takes_the_long_way_where_phase_leads():
    # Both crossovers lie at phases between 0 and 20°: delay has to turn them by 200° to −180°.
    loop = 2.65 * S**2 / (S + 1) ** 3
    found = loop_metrics(OMEGA, loop)
    assert -180.0 < -found.phase_margin_deg < -150.0
    crossings = np.flatnonzero(np.diff(np.sign(np.abs(loop) - 1.0)))
    assert len(crossings) == 2
    phase = 180.0 + np.degrees(np.angle(loop[crossings]))
    assert np.all(phase > 180.0)
    expected = np.min(np.radians(phase) / OMEGA[crossings])
    assert_close(found.delay_margin_s, expected, rtol=3e-3, why="(180° + φ)/ω")
    for share, stable in ((0.98, True), (1.02, False)):
        late = loop * np.exp(-S * share * found.delay_margin_s)
        assert bool(loop_metrics(OMEGA, late).is_stable) == stable
