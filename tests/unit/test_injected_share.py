"""An injection that explains nothing of the rate carries no model, however coherent the loop is."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import flightid as fid
from flightid.conventions import Light
from flightid.inspection.carried import carried_axes
from flightid.inspection.usable_band import LOOP_ALONE
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
