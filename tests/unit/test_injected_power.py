"""What was injected at each frequency, and how much louder a new sweep has to be by it."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import flightid as fid
from flightid.control.tuning.wider_band import lower_sweep, times_louder
from flightid.responses.injected_power import InjectedPower, injected_power
from flightid.responses.pair import PairResponse
from flightid.responses.store import read_response, write_response

STEP_S = 0.01
OMEGA = np.geomspace(0.1, 60.0, 120)


def _swept(low_hz: float, top_hz: float, long_s: float) -> np.ndarray:
    t = np.arange(0.0, long_s, STEP_S)
    growth = np.log(top_hz / low_hz) / long_s
    return np.asarray(np.sin(2.0 * np.pi * low_hz * np.expm1(growth * t) / growth))


def _record(values: np.ndarray, into: str = "u") -> fid.Record:
    t = np.arange(len(values)) * STEP_S
    noise = 0.1 * np.random.default_rng(1).standard_normal((3, len(values)))
    inputs = {name: noise[k] + (name == into) * values for k, name in enumerate("uv")}
    return fid.Record.from_arrays(
        t, inputs=inputs, outputs={"y": noise[2]}, excitations={"injected": values}
    )


def test_power_of_sweeps_is_that_of_their_ends_length_and_amplitude() -> None:
    """1/(f ln(f₂/f₁)) of each, over the time of all: one of 3 × the amplitude counts nine times."""
    wide, slow = _swept(0.4, 12.0, 60.0), 3.0 * _swept(0.04, 0.3, 120.0)
    of = injected_power([_record(wide), _record(slow)], ["u"])["u"]
    assert of.seconds == pytest.approx(180.0)
    for hertz, each in ((1.0, 60.0 / np.log(30.0) / 9.0), (0.1, 120.0 / np.log(7.5))):
        near = 2.0 * np.pi * hertz * np.geomspace(0.8, 1.25, 9)
        told = of.at(near) * near / (2.0 * np.pi)
        assert np.mean(told) == pytest.approx(each / 180.0, rel=0.15)
    assert not np.any(of.is_swept(2.0 * np.pi * np.array([0.02, 0.35, 20.0])))
    assert np.all(of.is_swept(2.0 * np.pi * np.array([0.06, 0.2])))


def test_each_sweep_counts_for_the_input_that_it_moves() -> None:
    first, other = _swept(0.4, 12.0, 30.0), _swept(0.2, 2.0, 30.0)
    both = injected_power([_record(first, "u"), _record(other, "v")], ["u", "v"])
    assert both["u"].is_swept(np.array([40.0]))[0]
    assert not both["v"].is_swept(np.array([40.0]))[0]
    assert not both["u"].is_swept(np.array([2.0]))[0]
    assert injected_power([_record(0.0 * first)], ["u"]) == {}


def test_responses_keep_what_was_injected(tmp_path: Path) -> None:
    response = fid.estimate_response(_record(_swept(0.4, 12.0, 30.0)), inputs="u", outputs="y")
    again = read_response(write_response(response, tmp_path / "y.nc"))
    for each in (response, again, response.select(n_omega=9)):
        assert each.pair("y", "u").injected.at(OMEGA) == pytest.approx(
            response.injected["u"].at(OMEGA)
        )


def _seen(sweeps: list[tuple[float, float, float, float]], strength: float = 0.1) -> PairResponse:
    """What a loop that leaves ω³ of an injection shows after sweeps (from, to, s, amplitude)."""
    largest, long_s = max(s[3] for s in sweeps), sum(s[2] for s in sweeps)
    power = np.zeros_like(OMEGA)
    for low, top, seconds, size in sweeps:
        within = (low <= OMEGA) & (top >= OMEGA)
        share = (size / largest) ** 2 * seconds / long_s
        power += within * share * 2.0 * np.pi / (OMEGA * np.log(top / low))
    ratio = strength * largest**2 * power * OMEGA**3
    coherence = ratio / (1.0 + ratio)
    known = InjectedPower(OMEGA, power, long_s)
    return PairResponse(
        "p", "u", "1", OMEGA, np.ones_like(OMEGA) * 1j, coherence, OMEGA * 0.0, injected=known
    )


def test_a_second_round_asks_for_about_what_the_first_did() -> None:
    """Coherence below a sweep's start, where nothing was injected, told 236 times the amplitude."""
    target, start, top = 0.6, 0.46, 6.0
    seen = _seen([(2.0, 120.0, 120.0, 1.0)])
    first = times_louder(2.4, seen, target, start, top)
    # The truth: five times the power that makes 0.6 of γ².
    long_s = 20.0 * np.pi / target
    density = long_s / (long_s + 120.0) * 2.0 * np.pi / (target * np.log(top / start))
    needed = np.sqrt(5.0 * 1.5 / (0.1 * density * target**3))
    assert first == pytest.approx(needed, rel=0.05)
    flown = [(2.0, 120.0, 120.0, 1.0), (start, top, long_s, first)]
    second = times_louder(0.7, _seen(flown), target, start, top)
    # Over the largest that flew, which the first asked for; old records dilute new ones more now.
    shares = long_s / (long_s + 120.0), long_s / (2.0 * long_s + 120.0)
    assert second is not None
    assert second == pytest.approx(np.sqrt(shares[0] / shares[1]), rel=0.1)


def test_what_the_swept_band_does_not_tell_is_not_said() -> None:
    seen = _seen([(2.0, 120.0, 120.0, 1.0)], strength=50.0)
    assert np.count_nonzero(seen.coherence < 0.97) > 10, "coherence falls where nothing was swept"
    then = "with the amplitude that flew, then see"
    for each in (seen, replace(seen, injected=None)):
        assert times_louder(2.4, each, 0.6, 0.46, 6.0) is None
        assert then in lower_sweep(0.8, 2.4, each)
    assert then in lower_sweep(0.8, 2.4, None)


def test_more_than_may_fly_is_told_as_what_it_is() -> None:
    said = lower_sweep(0.2, 2.4, _seen([(2.0, 120.0, 120.0, 1.0)]))
    assert "add records that sweep from" in said
    assert "times the largest that flew, which may not fly" in said
    assert "may leave more" in said
    assert "no sweep" not in said
