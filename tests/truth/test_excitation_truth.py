"""Designed inputs against closed forms: phases, energy spectra, autocorrelation, Parseval."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.signal import correlate

from flightid import _native, excitation
from flightid.excitation.multistep import MULTISTEPS
from flightid.excitation.phases import Lines, relative_peak_factor, schroeder_phases
from flightid.excitation.sweep import sweep_phase
from tests.closeness import assert_close

# Settings of the published rig flight; values computed for it independently.
CHIRP_SPOTS = [
    (1.0, 0.004426275, 0.05),
    (5.0, 0.15, 0.05),
    (60.0, -0.149803391, 0.139127970),
    (100.0, 0.068238868, 1.077217345),
    (129.0, -0.010752534, 4.750592537),
]


@pytest.mark.parametrize("single", [True, False])
def test_ardupilot_chirp_meets_its_spot_values(single: bool) -> None:
    times, values, hertz = map(np.array, zip(*CHIRP_SPOTS, strict=True))
    found, omega = _native.ardupilot_chirp(times, 0.15, 0.05, 5.0, 130.0, 5.0, 5.0, None, single)
    # 622 rad of phase in single precision carry about 1e-4 rad of rounding.
    tolerance = 3e-5 if single else 6e-10
    assert_close(found, values, atol=tolerance, why="values are given to nine digits")
    assert_close(omega / (2 * np.pi), hertz, rtol=1e-6 if single else 1e-9, why="same digits")


def test_sweep_phase_is_the_integral_of_its_frequency() -> None:
    low, high, hold_s, duration_s = 0.5, 20.0, 25.0, 90.0

    def omega(t: float) -> float:
        return float(
            sweep_phase(np.array([t]), low, high, hold_s=hold_s, duration_s=duration_s)[1][0]
        )

    for end_s in (10.0, 40.0, 90.0):
        phase, _ = sweep_phase(np.array([end_s]), low, high, hold_s=hold_s, duration_s=duration_s)
        expected, _ = quad(omega, 0.0, end_s, points=[hold_s], limit=200)
        assert_close(phase, expected, rtol=1e-10, why="closed form against quadrature")
    assert omega(10.0) == low
    assert_close(omega(90.0), high, rtol=3e-3, why="C2 (exp C1 - 1) is 1.0023")


# Peak and half-energy edges, in units of the step (computed independently).
BANDS = [
    (MULTISTEPS["doublet"][:2], 1.14, 2.331, 3.65, 0.0),
    (((1.0, 2.0, 1.0), (1.0, -1.0, 1.0)), 1.15, 1.803, 2.44, 0.0),
    (MULTISTEPS["3211"][:2], 0.28, None, 2.65, 1.0),
    (MULTISTEPS["modified_3211"][:2], 0.31, 1.584, 2.76, 0.0),
]


@pytest.mark.parametrize(("shape", "low", "peak", "high", "mean"), BANDS)
def test_multistep_bands(
    shape: tuple[tuple[float, ...], tuple[float, ...]],
    low: float,
    peak: float | None,
    high: float,
    mean: float,
) -> None:
    widths, levels = shape
    step_s = 0.25
    found = excitation.multistep_band(widths=widths, levels=levels, step_s=step_s)
    assert_close(found[0] * step_s, low, atol=0.005, why="given to two digits")
    assert_close(found[2] * step_s, high, atol=0.006, why="read off a grid to two digits")
    if peak is not None:
        assert_close(found[1] * step_s, peak, atol=0.0006, why="given to three digits")
    zero = excitation.multistep_energy(0.0, widths=widths, levels=levels, step_s=1.0)
    assert_close(np.sqrt(zero), mean, atol=1e-12, why="the sum of width times level")


def test_doublet_energy_is_the_textbook_formula() -> None:
    x = np.linspace(0.1, 12.0, 50)
    found = excitation.multistep_energy(x, widths=[1, 1], levels=[1, -1], step_s=1.0)
    assert_close(found, 16 * np.sin(x / 2) ** 4 / x**2, atol=1e-13, why="closed form")


def test_sampled_multistep_has_the_exact_energy_spectrum() -> None:
    made = excitation.modified_3211(amplitude=1.2, step_s=0.2, sample_rate_hz=50.0)
    omega = np.array([0.5, 3.0, 8.0, 20.0, 60.0])
    dt = made.sample_time_s
    raw = np.exp(-1j * np.outer(omega, made.time_s)) @ made.signals[0]
    # A held sample adds the transform of its rectangle: then nothing is approximate.
    held = np.abs(dt * np.sinc(omega * dt / (2 * np.pi)) * raw) ** 2
    exact = excitation.multistep_energy(
        omega,
        widths=MULTISTEPS["modified_3211"].widths,
        levels=MULTISTEPS["modified_3211"].levels,
        step_s=0.2,
    )
    assert_close(held, exact, rtol=1e-10, atol=1e-14, why="same piecewise constant signal")


@pytest.mark.parametrize("order", range(2, 13))
def test_prbs_autocorrelation_has_two_values(order: int) -> None:
    made = excitation.prbs(order=order, clock_hz=10.0, amplitude=2.0, sample_rate_hz=10.0)
    transform = np.fft.fft(made.signals[0])
    found = np.real(np.fft.ifft(np.abs(transform) ** 2)) / made.n_samples
    expected = np.full(made.n_samples, -4.0 / made.n_samples)
    expected[0] = 4.0
    assert_close(found, expected, atol=1e-11, why="a sequence of maximal length")


def test_prbs_spectrum_follows_its_sinc() -> None:
    made = excitation.prbs(order=9, clock_hz=5.0, amplitude=1.0, sample_rate_hz=500.0)
    spectrum = made.spectrum()
    lines = slice(1, 511)
    expected = excitation.held_density(
        spectrum.omega_rad_s[lines], clock_hz=5.0, mean_square=1.0 + 1.0 / 511
    )
    assert_close(
        spectrum.density[0, lines], expected, rtol=1e-3, why="held at 500 Hz, not continuously"
    )
    half = excitation.held_density(
        2 * np.pi * 0.443 * 5.0, clock_hz=5.0, mean_square=1.0
    ) / excitation.held_density(0.0, clock_hz=5.0, mean_square=1.0)
    assert_close(half, 0.5, atol=1e-3, why="half-power frequency to three digits")


def test_uniform_noise_has_the_density_of_held_levels() -> None:
    made = excitation.uniform_noise(
        clock_hz=4.0, amplitude=1.0, duration_s=20000.0, sample_rate_hz=40.0, seed=3
    )
    omega = np.array([1.0, 5.0, 12.0])
    expected = excitation.held_density(omega, clock_hz=4.0, mean_square=1 / 3)
    assert_close(
        made.smoothed_spectrum(omega).density[0],
        expected,
        rtol=0.05,
        why="several hundred bins are averaged",
    )


def test_density_sums_to_the_mean_square() -> None:
    for rate in (49.0, 50.0):
        made = excitation.sweep(
            band_rad_s=(0.5, 20.0), amplitude=0.3, duration_s=60.0, sample_rate_hz=rate
        )
        assert_close(made.spectrum().mean_square(), made.rms**2, rtol=1e-12, why="Parseval")


def test_multisine_lines_lie_where_they_were_dealt() -> None:
    made = excitation.multisine(
        band_rad_s=(2 * np.pi * 0.2, 2 * np.pi * 5.0),
        amplitude=1.0,
        period_s=10.0,
        sample_rate_hz=100.0,
        names=("a", "b", "c"),
        starts=1,
    )
    amplitude = 2 * np.abs(np.fft.rfft(made.signals, axis=1)) / made.n_samples
    for index in range(3):
        lines = np.flatnonzero(amplitude[index] > 1e-9)
        assert lines.tolist() == list(range(2 + index, 51, 3))
        assert_close(
            amplitude[index, lines], amplitude[index, lines[0]], rtol=1e-9, why="flat power"
        )


@pytest.mark.parametrize(
    ("n_lines", "spacing", "starts"),
    [(20, 1, 4), *(pytest.param(20 * k, k, 8, marks=pytest.mark.nightly) for k in (1, 2, 3))],
)
def test_multisine_beats_schroeder_and_the_usual_bar(
    n_lines: int, spacing: int, starts: int
) -> None:
    lines = Lines(2 + spacing * np.arange(n_lines), np.ones(n_lines))
    plain = relative_peak_factor(lines.wave(schroeder_phases(lines), lines.fine()))
    made = excitation.multisine(
        band_rad_s=(2 * np.pi * 2, 2 * np.pi * (2 + spacing * n_lines - 1)),
        amplitude=1.0,
        period_s=1.0,
        sample_rate_hz=2048.0,
        names=tuple(f"u{index}" for index in range(spacing)),
        starts=starts,
    )
    assert np.max(made.peak_factor) < min(plain, 1.12)


def test_schroeder_phases_of_a_flat_spectrum_are_the_published_ones() -> None:
    n = np.arange(1, 17)
    found = schroeder_phases(Lines(n, np.ones(16)))
    expected = -np.pi * n * (n - 1) / 16
    assert_close(np.exp(1j * found), np.exp(1j * expected), atol=1e-12, why="-pi n (n - 1) / N")


def test_two_parts_of_a_prbs_are_apart_by_half_a_period() -> None:
    made = excitation.prbs(
        order=8, clock_hz=10.0, amplitude=1.0, sample_rate_hz=10.0, names=("a", "b")
    )
    circular = correlate(np.tile(made.signals[0], 2)[:-1], made.signals[1], mode="valid")
    assert np.flatnonzero(np.isclose(circular, 255)).tolist() == [255 - 127]
