"""The covariance of a response is that of its errors: exactly, and over many noisy flights."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from itertools import product

import numpy as np
import pytest
from scipy import linalg, signal

from flightid import FrequencyResponse, Record, estimate_response
from flightid.errors import DataError
from flightid.responses.errors.local_errors import LocalErrors
from flightid.responses.errors.noise import NoiseSpectrum
from flightid.responses.errors.noise_kernels import basis_transform
from flightid.responses.windows.transform import WindowPlan, frames
from tests.closeness import assert_close

DT = 0.02
GRID = np.linspace(0.0, np.pi / DT, 4000)


def _density(kind: str) -> np.ndarray:
    """One-sided PSD of unit-innovation noise, white or through 1/(1 − 0.6 z⁻¹)."""
    pole = 0.0 if kind == "white" else 0.6
    return 2 * DT / np.abs(1 - pole * np.exp(-1j * GRID * DT)) ** 2


def _noise_matrix(kind: str, n: int) -> np.ndarray:
    pole = 0.0 if kind == "white" else 0.6
    return linalg.toeplitz(pole ** np.arange(n) / (1 - pole**2))


def _stack(response: np.ndarray) -> np.ndarray:
    return np.concatenate([response.real.ravel(), response.imag.ravel()])


def _records(n: int, n_inputs: int, count: int, loop: bool) -> list[dict[str, np.ndarray]]:
    rng = np.random.default_rng(3)
    sweep = signal.chirp(np.arange(n) * DT, 0.5, n * DT, 12.0)
    found = []
    for _ in range(count):
        inputs = rng.standard_normal((n_inputs, n))
        inputs[0] = sweep + 0.1 * inputs[0]
        if n_inputs > 1:
            inputs[1] += 0.5 * inputs[0]
        found.append({"r" if loop else f"u{k}": row for k, row in enumerate(inputs)})
    return found


def _fly(given: dict[str, np.ndarray], noise: np.ndarray, loop: bool) -> Record:
    """A flight with noise, shape (n,), or (k, n) for as many outputs alike, each with its own."""
    time_s = np.arange(noise.shape[-1]) * DT
    if not loop:
        y = sum(
            signal.lfilter([0, 0.3], [1, -0.7 + 0.2 * k], row)
            for k, row in enumerate(given.values())
        )
        outputs = {f"y{k}": y + row for k, row in enumerate(np.atleast_2d(noise))}
        return Record.from_arrays(time_s, inputs=given, outputs=outputs)
    # u = r − 0.5 y(t−1), y = 0.3 z⁻¹/(1 − 0.7 z⁻¹) u + v
    den = np.array([1.0, -0.7, 0.15])
    y = signal.lfilter([0, 0.3], den, given["r"]) + signal.lfilter([1, -0.7, 0], den, noise)
    u = given["r"] - 0.5 * np.concatenate([[0.0], y[:-1]])
    return Record.from_arrays(
        time_s, inputs={"u": u}, outputs={"y": y}, excitations={"r": given["r"]}
    )


CASES = {
    "one window": ({"window_s": 1.2}, 1, False),
    "80 % overlap, line removed": ({"window_s": 1.0, "overlap": 0.8, "detrend": "line"}, 1, False),
    "nothing removed": ({"window_s": 1.2, "detrend": "none"}, 1, False),
    "two inputs": ({"window_s": 1.2}, 2, False),
    "composite": ({"window_s": [1.6, 0.8]}, 1, False),
    "composite, two inputs": ({"window_s": [1.6, 0.8]}, 2, False),
    "instrument": ({"window_s": 1.2, "estimator": "instrument"}, 1, True),
    "local polynomial": ({"estimator": "local_polynomial"}, 1, False),
    "local polynomial, two inputs": ({"estimator": "local_polynomial"}, 2, False),
}


def _predicted(response: FrequencyResponse, kind: str) -> np.ndarray:
    """Covariance under the true noise spectrum in place of the estimated one."""
    errors = response.errors
    noise = NoiseSpectrum(GRID, _density(kind)[None])
    if isinstance(errors, LocalErrors):
        here = response.omega_rad_s
        errors = replace(errors, noise=NoiseSpectrum(here, noise.at(here)))
    else:
        errors = replace(errors, known_noise=noise)
    return replace(response, errors=errors).covariance_at(response.omega_rad_s)[0]


# Each estimator is in every run, the plain one with two inputs, which is harder.
NIGHTLY = {*CASES} - {"two inputs", "instrument", "local polynomial"}
IN_EVERY_RUN = [
    pytest.param(case, marks=pytest.mark.nightly if case in NIGHTLY else ()) for case in CASES
]
N_RECORDS = 2


def _samples(case: str) -> int:
    """Weights of a composite rest, and local polynomials bend, less with more samples."""
    if "instrument" in case:  # each bump is a flight of its own
        return 90
    return 200 if "composite" in case or "local" in case else 120


@cache
def _linear_map(case: str) -> tuple[FrequencyResponse, tuple[np.ndarray, ...]]:
    """A response, and the derivative of its stacked parts by every noise sample of each record."""
    options, n_inputs, loop = CASES[case]
    n_short = _samples(case)
    given = _records(n_short, n_inputs, N_RECORDS, loop)
    # A little fixed noise: coherence is not one and a composite's weights are at rest.
    base = 0.05 * np.random.default_rng(9).standard_normal((N_RECORDS, n_short))
    size = 1e-4

    def estimate(noise: np.ndarray, *, covariance: bool = False) -> FrequencyResponse:
        flown = [_fly(g, v, loop) for g, v in zip(given, noise, strict=True)]
        return estimate_response(
            flown, band_rad_s=(12.0, 50.0), n_omega=4, covariance=covariance, **options
        )

    response = estimate(base, covariance=True)
    start = _stack(response.response[0])
    # Bumped records are not looked at for spikes: each would be, afresh.
    quiet = pytest.MonkeyPatch()
    quiet.setattr("flightid.record.checks.entry_steps", lambda *_: ())
    # Outputs do not know of each other: many bumps fly at once. In a loop they move the input.
    together = 1 if loop else n_short // 4
    columns = np.empty((N_RECORDS, n_short, start.size))
    for place, first in product(range(N_RECORDS), range(0, n_short, together)):
        bumped = np.repeat(base[:, None], together, axis=1)
        bumped[place, range(together), range(first, first + together)] += size
        found = estimate(bumped[:, 0] if loop else bumped).response
        columns[place, first : first + together] = [(_stack(y) - start) / size for y in found]
    quiet.undo()
    return response, tuple(one.T for one in columns)


@pytest.mark.parametrize("kind", ["white", "coloured"])
@pytest.mark.parametrize("case", IN_EVERY_RUN)
def test_covariance_is_that_of_the_linear_map_from_noise(case: str, kind: str) -> None:
    response, maps = _linear_map(case)
    exact = sum(g @ _noise_matrix(kind, _samples(case)) @ g.T for g in maps)
    predicted = _predicted(response, kind)
    deviation = np.sqrt(np.diag(exact))
    error = (predicted - exact) / np.outer(deviation, deviation)
    # Direct and local polynomial estimates are linear in the noise; the instrument's is so about
    # its expectation. A composite's weights move with the noise, the more the fewer windows there
    # are (here 5 to 9). Coloured noise leaks a little into the third degree of local polynomials.
    tolerance = {"composite": 0.15, "composite, two inputs": 0.35, "instrument": 0.1}.get(
        case, 1e-6
    )
    if "local" in case and kind == "coloured":
        tolerance = 0.1
    assert np.abs(error).max() < tolerance
    assert_close(np.mean(np.diag(error)), 0.0, atol=0.1, why="variances are right on average")


@pytest.mark.parametrize("detrend", ["none", "mean", "line"])
def test_closed_form_of_the_basis(detrend: str) -> None:
    length, omega, angle = 24, np.array([0.3, 0.9]), np.array([-2.0, -0.3, 0.0, 0.01, 1.1])
    plan = WindowPlan(length, 2)
    distance = np.arange(length) - length // 2
    tapered = plan.taper() * np.exp(-1j * np.outer(omega, distance))
    detrended = [frames(part, plan, detrend)[:, 0] for part in (tapered.real, tapered.imag)]
    direct = (detrended[0] + 1j * detrended[1]) @ np.exp(-1j * np.outer(distance, angle))
    assert_close(
        basis_transform(length, omega, angle, detrend), direct, atol=1e-11, why="closed form"
    )


def test_the_noise_spectrum_is_unbiased_and_free_of_leakage() -> None:
    n, flights = 3000, 15
    sweep = signal.chirp(np.arange(n) * DT, 0.2, n * DT, 8.0)
    omega = np.geomspace(2.0, 30.0, 12)
    ratios = []
    for seed in range(flights):
        noise = np.random.default_rng(seed).standard_normal(n)
        y = 30.0 * signal.lfilter([0, 0.3], [1, -0.7], sweep) + noise
        record = Record.from_arrays(np.arange(n) * DT, inputs={"u": sweep}, outputs={"y": y})
        response = estimate_response(record, omega_rad_s=omega, window_s=8.0)
        ratios.append(response.errors.noise.at(omega)[0] / (2 * DT))
    # 15 flights x about 7 groups x 9 degrees of freedom: 3.3 % standard error.
    assert_close(np.mean(ratios), 1.0, atol=0.07, why="two standard errors")


def test_covariance_follows_selection_and_is_refused_when_huge() -> None:
    given = _records(600, 2, 1, False)[0]
    record = _fly(given, np.random.default_rng(0).standard_normal(600), False)
    response = estimate_response(record, band_rad_s=(8.0, 40.0), n_omega=6, window_s=1.2)
    whole = response.covariance
    part = response.select(inputs=["u1"], omega_rad_s=response.omega_rad_s[[1, 4]])
    rows = [7, 10, 19, 22]
    assert_close(part.covariance[0], whole[0][np.ix_(rows, rows)], rtol=1e-9, why="same errors")
    assert np.linalg.eigvalsh(whole[0]).min() > 0
    without = estimate_response(
        record, band_rad_s=(8.0, 40.0), n_omega=6, window_s=1.2, covariance=False
    )
    assert without.covariance is None
    fine = estimate_response(record, band_rad_s=(8.0, 40.0), n_omega=2000, window_s=1.2)
    with pytest.raises(DataError, match="too large to build"):
        _ = fine.covariance


def test_a_record_too_short_for_a_noise_spectrum_says_so() -> None:
    given = _records(30, 1, 1, False)[0]
    record = _fly(given, np.zeros(30), False)
    response = estimate_response(record, omega_rad_s=[40.0, 60.0], window_s=0.2)
    assert response.errors is None
    assert "no-covariance" in {finding.code for finding in response.findings}
    with pytest.raises(DataError, match="too short for local polynomials"):
        estimate_response(record, omega_rad_s=[40.0], estimator="local_polynomial")


def _loop_over_flights(case: str, kind: str, flights: int) -> tuple[np.ndarray, np.ndarray]:
    options, n_inputs, loop = CASES[case]
    options = {**options, "band_rad_s": (6.0, 40.0), "n_omega": 8}
    if "window_s" in options:
        options["window_s"] = 3.0 * np.asarray(options["window_s"])
    n = 2000
    given = _records(n, n_inputs, 2, loop)
    rng = np.random.default_rng(11)
    pole = 0.0 if kind == "white" else 0.6

    def filtered() -> np.ndarray:
        return signal.lfilter([0.2], [1, -pole], rng.standard_normal(n + 100))[100:]

    errors, predicted = [], []
    for flight in range(flights):
        flown = [_fly(g, filtered(), loop) for g in given]
        response = estimate_response(flown, **options)
        errors.append(_stack(response.response[0]))
        if flight < 30:
            predicted.append(response.covariance_at(response.omega_rad_s)[0])
    return np.array(errors), np.mean(predicted, axis=0)


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["white", "coloured"])
@pytest.mark.parametrize("case", CASES)
def test_scatter_over_flights_is_the_covariance_that_is_printed(case: str, kind: str) -> None:
    flights = 300
    errors, predicted = _loop_over_flights(case, kind, flights)
    scatter = np.cov(errors.T)
    # 300 flights give a variance to 8 %; the mean over frequencies is far tighter.
    ratio = np.diag(scatter) / np.diag(predicted)
    assert_close(np.mean(ratio), 1.0, atol=0.12, why="mean variance over frequencies and parts")
    assert ratio.min() > 0.6
    assert ratio.max() < 1.6
    scale = np.sqrt(np.diag(predicted))
    difference = (scatter - predicted) / np.outer(scale, scale)
    assert np.sqrt(np.mean(difference**2)) < 0.12, "correlations across frequencies"


def test_local_polynomials_take_another_noise_at_their_own_frequencies() -> None:
    """A spectrum on another grid was read by places: bars of red noise were 1.4 times as long."""
    u, e = np.random.default_rng(3).standard_normal((2, 2000))
    record = Record.from_arrays(
        np.arange(2000.0), inputs={"u": u}, outputs={"y": np.convolve(u, [0.5, 0.5])[:2000] + e}
    )
    omega = np.geomspace(0.2, 2.0, 9)
    linear = estimate_response(record, omega_rad_s=omega, estimator="local_polynomial").linear
    assert linear is not None
    grid = np.linspace(0.1, 2.5, 40)

    every, one, found = np.arange(len(omega)), np.arange(1), []
    for density in (np.exp(-2.0 * grid), np.ones_like(grid)):
        errors = linear.errors_with(NoiseSpectrum(grid, density[None]))
        found.append(np.diag(errors.covariance(one, one, every)[0])[: len(omega)])
    ratio = found[0] / found[1]
    assert_close(ratio, np.exp(-2.0 * omega), rtol=1e-9, why="log-linear between points")
