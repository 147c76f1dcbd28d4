"""ArduPilot's rate PID against a plain second implementation in single precision."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from flightid import _native
from flightid.vehicles import RateGains
from flightid.vehicles.flight import fly
from tests.closeness import assert_close
from tests.examples import examples

F = np.float32
DT = F(0.0025)


def _weight(cutoff_hz: float) -> np.float32:
    if cutoff_hz == 0:
        return F(1)
    rc = F(1) / (F(2) * F(np.pi) * F(cutoff_hz))
    return F(DT / (DT + rc))


def _run(
    gains: RateGains, target: np.ndarray, measured: np.ndarray, limited: np.ndarray
) -> np.ndarray:
    signals = (target.astype(float), measured.astype(float), limited)
    return _native.ardupilot_pid(gains.to_native(), 0.0025, *signals, None, 1.0, None, True)


def _plain(
    g: RateGains, target: np.ndarray, measured: np.ndarray, limited: np.ndarray
) -> np.ndarray:
    """Written from the description of AC_PID, line by line, without looking at the Rust."""
    rows = []
    filtered, error, slope, integral = target[0], F(target[0] - measured[0]), F(0), F(0)
    for k in range(len(target)):
        target_slope = F(0)
        if k > 0:
            old_target, old_error = filtered, error
            filtered = F(filtered + _weight(g.fltt) * F(target[k] - filtered))
            raw = F(filtered - measured[k])
            error = F(error + _weight(g.flte) * F(raw - error))
            slope = F(slope + _weight(g.fltd) * F(F(F(error - old_error) / DT) - slope))
            target_slope = F(F(filtered - old_target) / DT)
        if g.i == 0:
            integral = F(0)
        elif not limited[k] or F(integral * error) < 0:
            grown = F(integral + F(F(error * F(g.i)) * DT))
            integral = min(max(grown, F(-g.imax)), F(g.imax))
        p, d = F(error * F(g.p)), F(slope * F(g.d))
        size = abs(F(p + d))
        if g.pdmx > 0 and size > F(g.pdmx):
            scale = F(F(g.pdmx) / size)
            p, d = F(p * scale), F(d * scale)
        rows.append([filtered, error, p, integral, d, filtered * F(g.ff), target_slope * F(g.d_ff)])
    return np.array(rows, dtype=np.float32)


@examples(30)
@given(
    seed=st.integers(0, 2**32 - 1),
    flt=st.tuples(*[st.sampled_from([0.0, 2.5, 20.0])] * 3),
    pdmx=st.sampled_from([0.0, 0.05]),
    i=st.sampled_from([0.0, 0.1, 3.0]),
)
def test_agrees_with_a_plain_implementation(
    seed: int, flt: tuple[float, float, float], pdmx: float, i: float
) -> None:
    rng = np.random.default_rng(seed)
    gains = RateGains(0.12, i, 0.003, 0.05, 0.001, 0.1, pdmx, *flt)
    target = np.cumsum(rng.standard_normal(80) * 0.05).astype(F)
    measured = (0.7 * target + 0.01 * rng.standard_normal(80)).astype(F)
    limited = rng.random(80) < 0.1
    ours = _run(gains, target, measured, limited)
    theirs = _plain(gains, target, measured, limited)
    # The derivative divides differences by 2.5 ms, which magnifies the last bit.
    assert_close(ours[:, :7], theirs, atol=3e-6, rtol=1e-5, why="same arithmetic, single precision")


def test_controller_in_flight_is_that_pid() -> None:
    flight = fly(duration_s=5.0, seed=2)
    # The rate target that loop k uses is the one that loop k − 1 left behind.
    target = np.r_[0.0, flight["p_ref"][:-1]].astype(F)
    measured = flight["gyro_filtered_x"].astype(F)
    limited = np.r_[0.0, flight["limited"][:-1]] > 0
    terms = _run(flight.autopilot.rate[0], target, measured, limited)
    for column, name in enumerate(("target", "error", "p", "i", "d", "ff", "d_ff")):
        logged = flight[f"roll_pid_{name}"]
        assert_close(terms[:, column], logged, atol=1e-7, why=f"{name}: the same controller")


def test_continuous_equivalent_of_the_filters() -> None:
    # A step of error through FLTE alone rises with the time constant of its cut-off.
    gains = RateGains(1.0, 0.0, 0.0, fltt=0.0, flte=2.0, fltd=0.0)
    target = np.r_[0.0, np.ones(399)].astype(F)
    off = np.zeros(400, dtype=bool)
    terms = _run(gains, target, np.zeros(400, F), off)
    time_s = np.arange(400) * float(DT)
    exact = 1 - np.exp(-2 * np.pi * 2.0 * time_s)
    assert terms[200, 2] == pytest.approx(exact[200], abs=0.01)
