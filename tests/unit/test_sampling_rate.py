"""Sampling rate judged by the place of poles: a known lag, sampled as it should be and not."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import cont2discrete, lfilter

import flightid as fid
from flightid.conventions import Light
from flightid.identification.prediction_error.roots import fitted_roots
from flightid.identification.prediction_error.sampling_rate import sampling_findings
from flightid.models.polynomial.model import PolynomialModel
from tests.closeness import assert_close

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
        (0.005, 0.1, "sampled-fast", Light.GREEN, "resample to about 1"),
        (0.1, 0.5, "sampling-rate", Light.GREEN, "sampled at about 31 "),
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


@pytest.mark.parametrize(
    ("rate_hz", "code", "words"),
    [
        (250.0, "sampled-fast", "resample to about 16 Hz (resample_to_s=0.062)"),
        (50.0, "sampling-rate", "fastest mode, at 1.6 Hz, is kept by ten times that"),
    ],
)
def test_advice_keeps_a_mode_beyond_the_bandwidth(rate_hz: float, code: str, words: str) -> None:
    """A lag of 0.23 Hz ahead of a pair at 1.6 Hz: ten times the bandwidth, 2.3 Hz, loses it."""
    random, omega = np.random.default_rng(8), 2.0 * np.pi * 1.6
    n, clock = round(120.0 * rate_hz), round(0.15 * rate_hz)
    u = np.repeat(random.choice([-1.0, 1.0], n // clock + 1), clock)[:n]
    lag = 2.0 * np.pi * 0.23
    plant = cont2discrete(
        ([lag * omega**2], np.polymul([1.0, lag], [1.0, 0.3 * omega, omega**2])), 1.0 / rate_hz
    )
    y = lfilter(plant[0].ravel(), plant[1], u)
    structure = fid.PolynomialModel.general(("u",), "y", nb=3, nf=3, nk=1)
    record = fid.Record.from_arrays(
        np.arange(n) / rate_hz, inputs={"u": u}, hold="zero",
        outputs={"y": y + 1e-4 * random.standard_normal(n)},
    )  # fmt: skip
    fit = fid.identify(structure, record)
    (found,) = [each for each in fit.findings if each.code.startswith("sampl")]
    assert found.code == code
    assert words in str(found)


def test_advice_says_it_before_a_fit() -> None:
    codes = [each.code for each in fid.advise(flown(0.1, 0.5, n=500)).findings]
    assert "sampling-rate" in codes
    assert "sampled-slowly" in [each.code for each in fid.advise(flown(1.0, 0.2, n=500)).findings]


def test_poles_that_fit_noise_do_not_move_the_bandwidth() -> None:
    """y = 0.9 y₋₁ + 0.1 u₋₇ under noise: the usual order has spurious poles."""
    clock = np.random.default_rng(0)
    u = np.repeat(clock.choice([-1.0, 1.0], 301), 5)[:1500]
    y = lfilter([0.1], [1.0, -0.9], np.concatenate([np.zeros(7), u[:-7]]))
    noisy = {"y": y + 0.2 * clock.standard_normal(1500)}
    record = fid.Record.from_arrays(
        0.02 * np.arange(1500), inputs={"u": u}, outputs=noisy, hold="zero"
    )
    (found,) = [each for each in fid.advise(record).findings if each.code.startswith("sampl")]
    times = float(found.message.split()[3])
    # |ln 0.9| is 1/60 of the sampling rate.
    assert_close(times, 2 * np.pi / -np.log(0.9), rtol=0.2, why="3 dB of a fit under noise")


def test_nothing_is_said_of_what_has_no_bandwidth() -> None:
    """An integrator, a response that rises to Nyquist, and no pole."""
    for above, below in (
        ([0.1], [-1.0]), ([1.0, -0.5], [0.6])
    ):  # fmt: skip
        structure = fid.PolynomialModel.general(("u",), "y", nb=len(above), nf=len(below), nk=1)
        model = PolynomialModel.from_theta(structure, np.array([*above, *below]), 0.1)
        roots = fitted_roots(model, 100)
        assert sampling_findings(model, roots, 60.0) == ()
        assert sampling_findings(model, [], 60.0) == ()
