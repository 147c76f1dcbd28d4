"""An injection that explains nothing of the rate carries no model, however coherent the loop is."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import flightid as fid
from flightid.conventions import Light
from flightid.inspection.carried import carried_axes
from flightid.inspection.excitation_found import FoundExcitation
from flightid.inspection.injected import InjectedShare, injected_share
from flightid.inspection.signals import Signal
from flightid.inspection.usable_band import LOOP_ALONE
from tests.handmade_log import HandmadeLog
from tests.strangers import inspected_logs


@pytest.mark.parametrize("seed", [0, 9])
def test_gusts_that_the_loop_answers_are_no_band(seed: int, tmp_path: Path) -> None:
    random = np.random.default_rng([seed, 1215])
    change = inspected_logs.BARREN["injection within gusts"]
    weak = replace(inspected_logs.sound(random), **change)  # type: ignore[arg-type]
    inspected_logs.write(weak, random, tmp_path / "weak.bin")
    found = fid.inspect_log(tmp_path / "weak.bin")
    assert found.verdict is Light.RED
    assert carried_axes(found) == ()
    (roll,) = (each for each in found.bands if each.axis == "roll")
    assert roll.reason == LOOP_ALONE
    assert roll.largest_coherence is not None
    assert roll.injected_coherence is not None
    assert roll.injected_coherence < roll.largest_coherence
    said = next(each.message for each in found.findings if each.code == "no-usable-band")
    told = f"of the rate with what was injected: roll {roll.injected_coherence:.2f}"
    assert told in said, "not the coherence of 0.99 that a loop makes"
    assert roll.largest_coherence > 0.9, "command and rate hang together all the same"


def test_a_sweep_beyond_the_gusts_is(tmp_path: Path) -> None:
    random = np.random.default_rng([0, 1215])
    inspected_logs.write(inspected_logs.sound(random), random, tmp_path / "swept.bin")
    assert carried_axes(fid.inspect_log(tmp_path / "swept.bin")) == ("roll",)


STEP_S = 0.02


def _share(injected: np.ndarray, rate: np.ndarray, **asked: float) -> InjectedShare | None:
    """Of a run of 100 s, logged for longer."""
    stamps = 5.0 + STEP_S * np.arange(injected.size)
    log = HandmadeLog("ardupilot").with_table("SIDD", stamps, Targ=injected)
    runs = [
        FoundExcitation(kind, axis, 10.0, 10.0 + asked.get("long_s", 100.0), "")
        for kind, axis in (("sid", "roll"), ("sweep", "pitch"), ("sid", "yaw"))
    ]
    motion = Signal("p", stamps, rate, "rad/s", "R")
    return injected_share(log.log, "roll", runs, motion, asked.get("highest", np.inf))


def test_a_rate_is_coherent_where_the_injection_moves_it() -> None:
    """White noise is injected, of which the rate holds what lies below 3 Hz, and noise above."""
    random = np.random.default_rng(4)
    injected, other = random.standard_normal((2, 6000))
    hertz = np.fft.rfftfreq(6000, STEP_S)
    both = np.where(hertz < 3.0, np.fft.rfft(injected), np.fft.rfft(other))
    rate = np.fft.irfft(both, 6000)
    lowest = 2.0 / 25.0  # Two cycles in a quarter of the run.
    found = _share(injected, rate)
    assert found is not None
    assert found.width == pytest.approx(3.0 / lowest, rel=0.15)
    assert 0.95 < found.largest <= 1.0
    cut = _share(injected, rate, highest=2.0 * np.pi * 1.0)
    assert cut is not None
    assert cut.width == pytest.approx(1.0 / lowest, rel=0.01)
    alone = _share(injected, other)
    assert alone is not None
    assert alone.largest < 0.6
    assert alone.width == 1.0
    # Nothing injected tells nothing; a rate that rests tells that it was not moved.
    assert _share(0.0 * injected, rate) is None
    still = _share(injected, 0.0 * rate)
    assert still is not None
    assert (still.width, still.largest) == (1.0, 0.0)
    assert _share(injected, rate, highest=0.5) is None
    assert _share(injected, rate, long_s=62.9 * STEP_S, highest=99.0) is None
