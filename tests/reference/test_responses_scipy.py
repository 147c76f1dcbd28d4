"""Spectra, responses and coherences agree with SciPy's, bin for bin, and Parseval holds."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import signal

from flightid import Record, estimate_response
from flightid.responses.spectra import average_spectra
from flightid.responses.windows.halving import HALVED, STEPPED, halved_weights, stepped_weights
from flightid.responses.windows.transform import FoldedBasis, WindowPlan, frames, transform
from tests.closeness import assert_close

RATE_HZ = 50.0


def _arrays(n: int = 3000, seed: int = 1) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(seed)
    u = rng.standard_normal(n)
    y = signal.lfilter([0.2, 0.1], [1.0, -0.7], u) + 0.3 * rng.standard_normal(n)
    return u, y


def _weights_hold_what_is_said_of_them() -> None:
    for weights, highest, miss in (
        (halved_weights(), HALVED, 2e-13),
        (stepped_weights(), STEPPED, 5e-14),
    ):
        omega = np.linspace(0.0, highest, 4001)
        cosines = np.cos(np.multiply.outer(omega, 2.0 * np.arange(len(weights)) + 1.0))
        assert_close(2.0 * cosines @ weights, 1.0, atol=miss, why="places between, by both sides")


@pytest.mark.parametrize(("length", "shifts"), [(256, 2), (200, 5), (128, 1), (96, 4)])
@pytest.mark.parametrize("detrend", ["none", "mean", "line"])
def test_spectral_matrix_is_that_of_csd(length: int, shifts: int, detrend: str) -> None:
    u, y = _arrays()
    bins = np.arange(1, length // 2)
    basis = FoldedBasis.of(WindowPlan(length, shifts), 2 * np.pi * bins / length, detrend)
    ours = average_spectra([np.array([u, y])], basis, 1 / RATE_HZ).matrix
    options = {
        "fs": RATE_HZ,
        "window": "hann",
        "nperseg": length,
        "noverlap": length - length // shifts,
        "detrend": {"none": False, "mean": "constant", "line": "linear"}[detrend],
    }
    for a, first in enumerate((u, y)):
        for b, second in enumerate((u, y)):
            _, theirs = signal.csd(first, second, **options)
            assert_close(ours[:, a, b], theirs[bins], rtol=1e-9, atol=1e-14, why="same definition")


def test_coherence_and_response_are_those_of_scipy() -> None:
    u, y = _arrays()
    bins = np.arange(4, 100)
    omega = 2 * np.pi * bins * RATE_HZ / 256
    record = Record.from_arrays(np.arange(3000) / RATE_HZ, inputs={"u": u}, outputs={"y": y})
    ours = estimate_response(record, omega_rad_s=omega, window_s=256 / RATE_HZ)
    options = {"fs": RATE_HZ, "nperseg": 256, "noverlap": 128}
    _, uu = signal.welch(u, **options)
    _, uy = signal.csd(u, y, **options)
    _, gamma2 = signal.coherence(u, y, **options)
    assert_close(ours.response[0, 0], (uy / uu)[bins], rtol=1e-9, why="same definition")
    assert_close(ours.coherence[0, 0], gamma2[bins], rtol=1e-9, why="same definition")
    assert_close(ours.input_spectrum[0, 0].real, uu[bins], rtol=1e-9, why="same definition")


@pytest.mark.parametrize(
    ("length", "high"), [(64, 7.7), (1000, 7.7), (1000, 1.9), (1000, 4.0), (702, 3.0)]
)
def test_transform_between_bins_is_that_of_the_chirp_z_transform(length: int, high: float) -> None:
    # Below 2 Hz frequencies are slow: all of them, more than half, hardly any.
    u, _ = _arrays(1000)
    low, count = 0.31, 150
    plan = WindowPlan(length, 2)
    omega = 2 * np.pi * np.linspace(low, high, count) / RATE_HZ
    real, imaginary = transform(u[None], FoldedBasis.of(plan, omega))
    windows = frames(u[None], plan)[0] * plan.taper()
    theirs = signal.zoom_fft(windows, [low, high], m=count, fs=RATE_HZ, endpoint=True)
    from_start = np.exp(-0.5j * omega * length)[:, None] * (real + 1j * imaginary)[:, 0]
    assert_close(from_start, theirs.T, atol=1e-10 * np.abs(theirs).max(), why="both are exact")


@pytest.mark.parametrize("detrend", ["none", "mean", "line"])
@pytest.mark.parametrize(
    ("length", "high"),
    [(2940, 1.25), (1740, 1.5), (1022, 1.25), (600, 1.25), (130, 1.25), (2940, 0.05)],
)
def test_halved_rows_are_the_exact_transform(length: int, high: float, detrend: str) -> None:
    _weights_hold_what_is_said_of_them()
    # Records halved or not, rows halved often, once, never, or all of them; large levels.
    rng = np.random.default_rng(length)
    samples = rng.standard_normal((2, 7001)) + np.array([[0.0], [30.0]])
    plan, omega = WindowPlan(length, 2), np.geomspace(0.003, high, 200)
    basis = FoldedBasis.of(plan, omega, detrend)
    windows = frames(samples, plan, detrend) * plan.taper()
    time = np.arange(length) - length // 2
    exact = np.tensordot(np.exp(-1j * np.multiply.outer(omega, time)), windows, axes=(1, 2))
    real, imaginary = transform(samples, basis)
    limit = 1e-12 * np.abs(windows).sum(axis=2).max()
    assert_close(real + 1j * imaginary, exact, atol=limit, why="kernels miss 1e-12 of a sinusoid")


def test_groups_of_windows_make_no_difference(monkeypatch: pytest.MonkeyPatch) -> None:
    rng = np.random.default_rng(5)
    records = [rng.standard_normal((3, n)) for n in (4001, 1033, 700, 2600)]
    basis = FoldedBasis.of(WindowPlan(600, 2), np.geomspace(0.01, 1.0, 90), "mean")
    whole = average_spectra(records, basis, 0.01)
    monkeypatch.setattr("flightid.responses.spectra.MAXIMUM_CHUNK", 4000)
    monkeypatch.setattr("flightid.responses.windows.transform.ROWS_AT_ONCE", 4000)
    parts = average_spectra(records, basis, 0.01)
    assert (
        whole.n_windows
        == parts.n_windows
        == sum(WindowPlan(600, 2).count(n) for n in (4001, 1033, 700, 2600))
    )
    assert_close(parts.matrix, whole.matrix, rtol=1e-12, atol=1e-15, why="one sum in two orders")


def test_parseval() -> None:
    u, _ = _arrays(20000)
    length = 400
    bins = np.arange(1, length // 2)
    basis = FoldedBasis.of(WindowPlan(length, 2), 2 * np.pi * bins / length)
    density = np.real(average_spectra([u[None]], basis, 1 / RATE_HZ).matrix[:, 0, 0])
    power = np.sum(density) * RATE_HZ / length
    assert_close(power, np.var(u), rtol=0.02, why="one-sided spectrum integrates to the power")
