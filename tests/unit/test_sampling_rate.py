"""Sampling rate judged by the place of poles: a known lag, sampled as it should be and not."""

from __future__ import annotations

import numpy as np
import pytest

import flightid as fid
from flightid.conventions import Light
from flightid.identification.prediction_error.roots import FittedRoot
from flightid.identification.prediction_error.sampling_rate import sampling_findings

STRUCTURES = {
    "output error": fid.PolynomialModel.general(("u",), "y", nb=1, nf=1, nk=1),
    "subspace": fid.InnovationsModel.subspace(("u",), ("y",), order=1),
}


def flown(step_s: float, lag_s: float, n: int = 1500) -> fid.Record:
    rng = np.random.default_rng(5)
    clock = max(1, round(lag_s / step_s / 2))
    u = np.repeat(rng.choice([-1.0, 1.0], n // clock + 1), clock)[:n]
    lag = fid.LinearSystem([[-1 / lag_s]], [[1 / lag_s]], [[1.0]], [[0.0]], ("u",), ("y",))
    run = fid.simulate(lag, fid.Record.from_arrays(step_s * np.arange(n), inputs={"u": u},
                                                   hold="zero"))  # fmt: skip
    return run.replace({"y": run["y"] + 1e-3 * rng.standard_normal(n)})


@pytest.mark.parametrize("kind", STRUCTURES)
@pytest.mark.parametrize(
    ("step_s", "lag_s", "code", "light", "words"),
    [
        (0.001, 1.0, "sampled-fast", Light.GREEN, "about 1.6 Hz"),
        (0.1, 0.5, "sampling-rate", Light.GREEN, "sampled at 31."),
        (1.0, 0.2, "sampled-slowly", Light.AMBER, "1.59 Hz or faster"),
    ],
)
def test_the_rate_is_ten_times_the_bandwidth(
    kind: str, step_s: float, lag_s: float, code: str, light: Light, words: str
) -> None:
    fit = fid.identify(STRUCTURES[kind], flown(step_s, lag_s))
    (found,) = [each for each in fit.findings if each.code.startswith("sampl")]
    assert (found.code, found.light) == (code, light)
    assert words in str(found)


def test_advice_says_it_before_a_fit() -> None:
    codes = [each.code for each in fid.advise(flown(0.1, 0.5)).findings]
    assert "sampling-rate" in codes
    assert "sampled-slowly" in [each.code for each in fid.advise(flown(1.0, 0.2)).findings]


def test_integrators_and_alternating_poles_have_no_bandwidth() -> None:
    roots = [FittedRoot("y/u", "pole", complex(z), None, None, None) for z in (1.0, -0.6)]
    assert sampling_findings(roots, 0.1) == ()
    assert sampling_findings([], 0.1) == ()
