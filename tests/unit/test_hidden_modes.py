"""By how much modes outside a band may move a response before the band would have shown them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from flightid.control.margins.hidden_modes import LEAST_DAMPING, most_moved_db
from flightid.control.margins.mode_slack import MOST_MOVED_DB
from flightid.control.tuning.wider_band import lower_sweep, times_louder
from flightid.identification.model_error import SHOWN, ModelErrorBound
from flightid.responses.injected_power import InjectedPower
from flightid.responses.pair import PairResponse

BAND = 1.0, 60.0
POINTS = np.geomspace(*BAND, 60)
LOOP = np.geomspace(0.05, 1000.0, 500)
BIN = 0.05
"""Half-width of the windows, rad/s: fine, so that light modes show."""
TRUE = np.array([42.0, 1.8, 0.02, 0.04])


def plant(values: np.ndarray, omega: np.ndarray) -> np.ndarray:
    """Gain, damping, lag and delay."""
    gain, damping, lag, delay = values
    s = 1j * omega
    return np.asarray(gain / (s + damping) / (lag * s + 1.0) * np.exp(-delay * s))


def slopes(omega: np.ndarray) -> np.ndarray:
    """Of each parameter, up and down, as corners of a fit are."""
    return np.array([
        plant(TRUE * (1.0 + step * row), omega) / plant(TRUE, omega) - 1.0
        for row in np.eye(4) for step in (0.02, -0.02)
    ])  # fmt: skip


def mode(omega: np.ndarray, at: float, damping: float, share: complex) -> np.ndarray:
    """Of a pole at a frequency, over the response without it, less one."""
    x = omega / at
    return np.asarray(share * x**2 / (1.0 - x**2 + 2j * damping * x))


@pytest.mark.parametrize("above", [True, False])
def test_no_mode_that_the_bound_holds_moves_the_response_by_more(above: bool) -> None:
    """Each mode is as large as the errors let it be, after parameters have made up for it."""
    draw = np.random.default_rng(5)
    seen_db, least_db = [], []
    blurred = POINTS - 1j * np.maximum(BIN, 0.036 * POINTS)
    for _ in range(20):
        ratio = float(draw.uniform(1.02, 1.5))
        at = BAND[1] * ratio if above else BAND[0] / ratio
        damping = float(np.exp(draw.uniform(np.log(LEAST_DAMPING), np.log(0.2))))
        unit = np.exp(1j * draw.uniform(0.0, 2.0 * np.pi))
        share = unit * 2.0 * damping * 10.0 ** (draw.uniform(0.0, 19.0) / 20.0)
        made = mode(blurred, at, damping, share)
        # What a fit of the gain, damping, lag and delay leaves of it.
        basis = np.vstack([np.ones_like(POINTS), slopes(POINTS)])
        real = np.concatenate([basis.real, basis.imag], axis=1).T
        answer = np.concatenate([made.real, made.imag])
        left = made - np.linalg.lstsq(real, answer, rcond=None)[0] @ basis
        flat = ModelErrorBound(POINTS, np.zeros(len(POINTS)))
        bound = ModelErrorBound(POINTS, np.abs(flat.averaged(left)) + 1e-3)
        if not above:
            bound = ModelErrorBound(POINTS, bound.bound / (1.0 + bound.bound))
        found = np.interp(at, LOOP, most_moved_db(LOOP, BAND, bound, slopes, BIN))
        own_db = 20.0 * np.log10(1.0 + abs(share) / (2.0 * damping))
        seen_db.append(own_db)
        least_db.append(found)
        assert found >= min(own_db, MOST_MOVED_DB) - 1.5, (at, damping, own_db)
    assert min(least_db) < MOST_MOVED_DB - 3.0, "the band does show some"


def test_small_errors_hide_small_modes_and_only_near_the_band() -> None:
    last = np.zeros(len(LOOP))
    outside = (BAND[0] > LOOP) | (BAND[1] < LOOP)
    for error in (0.01, 0.05, 0.2, SHOWN):
        bound = ModelErrorBound(POINTS, np.full(len(POINTS), error))
        moved = most_moved_db(LOOP, BAND, bound, slopes, BIN)
        assert np.all(moved[outside] >= last[outside] - 1e-9)
        assert np.all(moved[outside] <= MOST_MOVED_DB)
        assert np.all(moved[(BAND[0] / 4.0 > LOOP) | (4.0 * BAND[1] < LOOP)] == MOST_MOVED_DB)
        if error <= 0.05:
            near = np.interp([1.03 * BAND[1], 1.3 * BAND[1]], LOOP, moved)
            assert near[0] < near[1] - 3.0
        last = moved
    assert np.all(most_moved_db(LOOP, BAND)[outside] == MOST_MOVED_DB)
    assert np.all(most_moved_db(LOOP, None, bound, slopes) == MOST_MOVED_DB)


def test_coarser_windows_and_freer_parameters_hide_more() -> None:
    bound = ModelErrorBound(POINTS, np.full(len(POINTS), 0.05))
    fine, coarse = (most_moved_db(LOOP, BAND, bound, slopes, bins) for bins in (0.02, 0.36))
    below, above = BAND[0] > LOOP, BAND[1] < LOOP
    assert np.all(coarse[below] >= fine[below] - 1e-9)
    assert (coarse - fine)[below].max() > 3.0
    fixed = most_moved_db(LOOP, BAND, bound, lambda omega: slopes(omega)[:2], 0.02)
    assert np.all(fixed[above] <= fine[above] + 1e-9)
    assert (fine - fixed)[above].max() > 1.0


def test_what_lower_sweeps_need_is_told_or_that_none_brings_it() -> None:
    omega = np.geomspace(0.5, 50.0, 60)
    flown = InjectedPower(omega, 2.0 * np.pi / (omega * np.log(100.0)), 100.0)
    ones = np.ones(60)

    def seen(at: float) -> PairResponse:
        """Coherence that falls with the cube of frequency, in a logarithmic sweep."""
        coherence = 1.0 / (1.0 + (at / omega) ** 3)
        return PairResponse("p", "u", "1", omega, 1j * ones, coherence, 0.0 * ones, flown)

    told = times_louder(1.2, seen(0.9), 0.7, 0.5, 3.0)
    # Five times what a coherence of 0.6 needs; the new sweep has fewer octaves, of longer records.
    share = 20.0 * np.pi / 0.7
    denser = share / (share + 100.0) * np.log(100.0) / np.log(6.0)
    assert told == pytest.approx(np.sqrt(5.0 * 1.5 * (0.9 / 0.7) ** 3 / denser), rel=0.05)
    assert times_louder(1.0, replace(seen(0.9), coherence=0.0 * ones), 0.7, 0.5, 3.0) is None
    said = lower_sweep(0.9, 1.2, seen(0.9))
    start, each, together = 0.9 / 1.3**2, 8.0 * np.pi * 1.3 / 0.9, 20.0 * np.pi * 1.3 / 0.9
    assert f"from {start:.2g} to" in said
    assert f"of {5 * np.ceil(each / 5):.0f} s or more each" in said
    assert f"and {5 * np.ceil(together / 5):.0f} s or more together" in said
    assert "times the largest amplitude that flew, if it may turn as far" in said
    assert "no sweep brings it" in lower_sweep(0.0, 1.2, seen(0.9))
    assert "with the largest amplitude that flew" in lower_sweep(5.0, 5.5, seen(0.9))
