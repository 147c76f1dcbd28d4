"""Monte Carlo: 95 % intervals of polynomial fits cover the truth, over 500 runs."""

from __future__ import annotations

import numpy as np
import pytest

import flightid as fid
from tests.polynomial_records import ARMAX, flown

P = fid.PolynomialModel
RUNS = 500
MOST_UNTOLD = 0.04
BOX = P(("u",), "y", 0.1, b=[[1.0, 0.5]], f=[[1, -1.5, 0.7]], c=[1, 0.4], d=[1, -0.8])
OUTPUT_ERROR = P(("u",), "y", 0.1, b=[[1.0, 0.5]], f=[[1, -1.5, 0.7]])
REGRESSION = P(("u",), "y", 0.1, a=[1, -1.5, 0.7], b=[[1.0, 0.5]])
CASES = {
    "arx": (REGRESSION, P.arx("u", "y", na=2, nb=2)),
    "armax": (ARMAX, P.armax("u", "y", na=2, nb=2, nc=2)),
    "oe": (OUTPUT_ERROR, P.oe("u", "y", nb=2, nf=2)),
    "bj": (BOX, P.bj("u", "y", nb=2, nc=1, nd=1, nf=2)),
    "iv4": (BOX, P.arx("u", "y", na=2, nb=2, method="iv4")),
    "armax backcast": (ARMAX, P.armax("u", "y", na=2, nb=2, nc=2, backcast=True)),
}


def coverage(case: str, runs: int, n: int = 600) -> dict[str, float]:
    """Share of runs whose intervals hold the truth: coefficients, modes, gain."""
    truth, structure = CASES[case]
    mode = truth.modes()["y/u"][0]
    gain = truth.gains()["y/u"]
    plant = structure.method == "iv4"
    theta = np.array([-1.5, 0.7, 1.0, 0.5]) if plant else truth.theta
    inside: dict[str, list[bool]] = {"coefficients": [], "frequency": [], "damping": [], "gain": []}
    untold = 0
    for seed in range(runs):
        warm_up = 0 if structure.backcast else 300
        record = flown(truth, seed, n=n, noise=0.5, warm_up=warm_up)
        fit = fid.identify(structure, record)
        if any(each.interval95 is None for each in fit.parameters.values()):
            untold += 1  # by a test of residuals that was a false alarm, or a root that may be one
            continue
        for parameter, wanted in zip(fit.parameters.values(), theta, strict=True):
            low, high = parameter.interval95
            inside["coefficients"].append(low < wanted < high)
        pole = fit.details.modes[0]
        for key, item, wanted in (
            ("frequency", pole.natural_frequency, mode.natural_frequency_rad_s),
            ("damping", pole.damping, mode.damping),
            ("gain", fit.details.gains["y/u"], gain),
        ):
            low, high = item.interval95
            inside[key].append(low < wanted < high)
    assert untold <= MOST_UNTOLD * runs
    return {key: float(np.mean(values)) for key, values in inside.items()}


@pytest.mark.slow
@pytest.mark.parametrize("case", CASES)
def test_intervals_cover_the_truth(case):
    found = coverage(case, RUNS)
    for key, share in found.items():
        # Three standard errors of a share of 500 runs, since 24 shares are judged.
        assert 0.92 <= share <= 0.98, found | {"which": key}
