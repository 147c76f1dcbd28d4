"""Intervals of output-error polynomials hold in coloured noise; the simulator is SciPy's."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.linalg import toeplitz
from scipy.signal import lfilter

import flightid as fid
from flightid import _native
from flightid.identification.prediction_error.coloured_errors import (
    answers,
    has_noise_model,
    noise_bias,
    output_error_covariance,
)
from flightid.models.sampled.channels import gather_channels
from tests.closeness import assert_close

STEP_S = 0.1
TRUTH = {"b1": 1.0, "b2": 0.5, "f1": -1.5, "f2": 0.7}


def _flight(seed: int, colour: float, share: float = 0.3, n: int = 600) -> fid.Record:
    random = np.random.default_rng(seed)
    u = np.repeat(random.standard_normal(n // 4), 4)
    white = random.standard_normal(n + 200)
    noise = lfilter([1.0], [1.0, -colour], white)[200:] * np.sqrt(1.0 - colour**2)
    clean = lfilter([0.0, 1.0, 0.5], [1.0, -1.5, 0.7], u)
    return fid.Record.from_arrays(
        np.arange(n) * STEP_S,
        inputs={"u": u},
        outputs={"y": clean + share * clean.std() * noise},
    )


def _fit(seed: int, colour: float) -> fid.Fit:
    return fid.identify(fid.PolynomialModel.oe("u", "y", nb=2, nf=2), _flight(seed, colour))


def test_sensitivities_are_those_of_the_errors() -> None:
    """Against central differences of the native errors, which fit what was before the record."""
    random = np.random.default_rng(3)
    u, v = random.standard_normal((2, 80))
    y = lfilter([0.0, 1.0, 0.5], [1.0, -1.5, 0.7], u)
    y += lfilter([0.0, 0.0, 0.0, -0.8], [1.0, -0.6], v) + 1e-3 * random.standard_normal(80)
    record = fid.Record.from_arrays(
        np.arange(80) * STEP_S, inputs={"u": u, "v": v}, outputs={"y": y}
    )
    structure = fid.PolynomialModel.oe(("u", "v"), "y", nb=(2, 1), nf=(2, 1), nk=(1, 3))
    data = gather_channels([record], "y", ("u", "v"), "mean")
    theta = np.array([1.0, 0.5, -0.8, -1.5, 0.7, -0.6])

    def errors(at: np.ndarray) -> np.ndarray:
        return np.asarray(
            _native.polynomial_errors(
                data.output, data.inputs, [80], structure.native, at, "unknown", [], True
            )[0]
        )

    slopes = np.array(
        [(errors(theta + step) - errors(theta - step)) / 2e-5 for step in 1e-5 * np.eye(6)]
    )
    found = output_error_covariance(structure, data, theta, errors(theta), 0)
    power = float(np.mean(errors(theta) ** 2))
    assert_close(
        np.sqrt(np.diag(found.white)),
        np.sqrt(power * np.diag(np.linalg.inv(slopes @ slopes.T))),
        rtol=5e-3,
        why="the slopes of a projection hold a little of the errors, too",
    )


def test_noise_bias_is_the_slope_of_the_restricted_likelihood() -> None:
    """Dense, with more impulses of the start than F reaches: samples dropped gave c1 ± 1."""
    structure = fid.PolynomialModel.bj("u", "y", nb=2, nc=1, nd=1, nf=2, nk=4)
    data = gather_channels([_flight(1, 0.9, n=200)], "y", ("u",), "mean")
    theta = np.array([1.0, 0.5, -0.6, -0.95, -1.5, 0.7])
    errors = np.random.default_rng(2).standard_normal(200)
    columns = answers(structure, data, theta, errors, 0)
    found = noise_bias(structure, theta, columns, np.eye(2))
    known = np.hstack(columns[0][:2])

    def half_log_determinant(c: float, d: float) -> float:
        white = toeplitz(lfilter([1.0, d], [1.0, c], np.eye(200)[0]), np.zeros(200)) @ known
        return 0.5 * float(np.linalg.slogdet(white.T @ white)[1])

    slopes = [
        (half_log_determinant(-0.6 + c, -0.95 + d) - half_log_determinant(-0.6 - c, -0.95 - d))
        / 2e-4
        for c, d in ((1e-4, 0.0), (0.0, 1e-4))
    ]
    assert_close(found, slopes, rtol=1e-5, why="the same differences by triangles")
    assert np.max(np.abs(found)) < 20.0  # of c1: 1e3 by what rounding leaves of a dependent start


def test_colour_widens_and_noise_models_keep_their_own_errors() -> None:
    plain = _fit(0, 0.0)
    assert "residuals-coloured" not in {each.code for each in plain.findings}
    coloured = _fit(0, 0.9)
    assert coloured.parameters["f1"].stderr > 1.2 * plain.parameters["f1"].stderr
    assert coloured.intervals_from == "coloured residuals"
    assert coloured.parameters["f1"].freedom != plain.parameters["f1"].freedom
    assert has_noise_model(fid.PolynomialModel.bj("u", "y", nb=2, nf=2, nc=1, nd=1))
    assert not has_noise_model(fid.PolynomialModel.arx("u", "y", na=0, nb=4))


@pytest.mark.parametrize(("colour", "told"), [(1.0, False), (0.9, True)])
def test_a_root_of_d_that_may_be_one_has_no_interval(colour: float, *, told: bool) -> None:
    """A random walk's D ends inside the circle: to first order 63 % held and all were green."""
    random = np.random.default_rng(4)
    u = np.repeat(random.standard_normal(150), 4)
    walk = lfilter([1.0], [1.0, -colour], 0.3 * random.standard_normal(u.size))
    y = lfilter([0.0, 1.0, 0.5], [1.0, -1.5, 0.7], u) + walk
    record = fid.Record.from_arrays(
        np.arange(u.size) * STEP_S, inputs={"u": u}, outputs={"y": y}, hold="zero"
    )
    structure = fid.PolynomialModel.bj("u", "y", nb=2, nc=0, nd=1, nf=2)
    found = fid.identify(structure, record, loop="open").parameters
    assert (found["d1"].stderr is not None) == told
    assert ("unit circle" in found["d1"].reason) != told
    assert found["f1"].stderr is not None


@pytest.mark.slow
@pytest.mark.parametrize("colour", [-0.5, 0.0, 0.5, 0.9])
def test_intervals_cover(colour: float) -> None:
    """With white residuals assumed 84.6 % at 0.9: 73 to 93 % by coefficient."""
    inside, apart, untold = [], [], 0
    for seed in range(250):
        parameters = _fit(seed, colour).parameters
        if any(parameters[name].interval95 is None for name in TRUTH):
            untold += 1  # residuals that a test of 1 % accuses by chance
            continue
        ends = [parameters[name].interval95 for name in TRUTH]
        values = np.array(list(TRUTH.values()))
        inside.append(
            [low <= value <= high for (low, high), value in zip(ends, values, strict=True)]
        )
        apart.append(
            [(parameters[n].value - value) / parameters[n].stderr for n, value in TRUTH.items()]
        )
    assert untold <= 10
    assert 0.93 < np.mean(inside) < 0.985
    assert_close(np.sqrt(np.mean(np.square(apart))), 1.0, rtol=0.08, why="1000 scores")


def test_bars_of_a_start_lose_the_samples_that_the_past_of_noise_takes() -> None:
    """A slow rig that is switched on: the noise's unknown past takes the sample that told of it.

    With that sample, bars were 0.6 of these and held 88.6 to 90.5 % in 1,480 intervals.
    """
    ratios = []
    for seed in range(6):
        random = np.random.default_rng(seed)
        u = 5.0 + np.repeat(random.choice((-1.0, 1.0), 60), 10)
        noise = 0.13 * lfilter([1.0], [1.0, -0.9], np.sqrt(0.19) * random.standard_normal(800))
        y = 20.0 + lfilter([0.0, 0.12], [1.0, -0.97], u) + noise[200:]
        record = fid.Record.from_arrays(
            np.arange(600) * STEP_S, inputs={"u": u}, outputs={"y": y}, hold="zero"
        )
        structure = fid.PolynomialModel.bj("u", "y", nb=1, nc=0, nd=1, nf=1)
        found = fid.identify(structure, record, loop="open").parameters["f1"]
        columns = np.array(
            [
                lfilter([0.0, 1.0], [1.0, -0.97], u),
                lfilter([0.0, 0.0, 0.12], np.poly([0.97, 0.97]), u),
                0.97 ** np.arange(600),
                np.ones(600),
            ]
        )
        white = columns[:, 1:] - 0.9 * columns[:, :-1]
        known = np.linalg.inv(white @ white.T)[1, 1] * 0.13**2 * 0.19
        ratios.append(found.stderr / np.sqrt(known))
    assert 0.85 < np.mean(ratios) < 1.25, ratios
