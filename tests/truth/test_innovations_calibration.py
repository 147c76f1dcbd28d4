"""Monte Carlo: 95 % intervals of innovations fits cover the truth, over 500 runs."""

from __future__ import annotations

import numpy as np
import pytest

import flightid as fid
from tests.innovations_records import SINGLE, flown

RUNS = 500


def coverage(runs, *, feedback=0.0, n=500):
    """Share of runs whose intervals hold frequency, damping and gain.

    A sound run in fifty shows none, where a test says by chance that dynamics are missing.
    """
    mode, gain = SINGLE.modes()[0], SINGLE.gains()["y/u"]
    method = "pbsid" if feedback else "moesp"
    structure = fid.InnovationsModel.subspace("u", "y", 2, method=method, offsets="none")
    inside, without = {"frequency": [], "damping": [], "gain": []}, 0
    for seed in range(runs):
        record = flown(SINGLE, seed, n=n, noise=0.5, feedback=feedback)
        fit = fid.identify(structure, record)
        pole = fit.details.modes[0]
        if pole.natural_frequency.interval95 is None:
            without += 1
            continue
        for key, item, wanted in (
            ("frequency", pole.natural_frequency, mode.natural_frequency_rad_s),
            ("damping", pole.damping, mode.damping),
            ("gain", fit.details.gains["y/u"], gain),
        ):
            low, high = item.interval95
            inside[key].append(low < wanted < high)
    assert without <= 0.05 * runs
    return {key: float(np.mean(values)) for key, values in inside.items()}


@pytest.mark.slow
@pytest.mark.parametrize("feedback", [0.0, 0.2])
def test_intervals_cover_the_truth(feedback):
    found = coverage(RUNS, feedback=feedback)
    for share in found.values():
        # Three standard errors of a count of 500 below 0.94, which PBSID's gain in a loop holds.
        assert 0.915 <= share <= 0.97, found
