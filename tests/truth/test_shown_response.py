"""The one estimate that is shown, of sweeps that end at full amplitude, against exact responses."""

from __future__ import annotations

from functools import cache
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from numpy.typing import NDArray
from scipy import signal

import flightid as fid
from flightid.cli.program import program
from flightid.plot.response import response_figure
from flightid.record.record import Record
from flightid.responses.bands import COHERENT, usable_band
from flightid.responses.errors.local_information import local_spread
from flightid.responses.response import FrequencyResponse

Array = NDArray[np.float64]
STEP_S = 0.02
NUMERATOR, DENOMINATOR = signal.cont2discrete(
    ([0.3 * 16.0, 16.0], np.polymul([1.0, 1.6, 16.0], [0.05, 1.0])), STEP_S, "zoh"
)[:2]


def flown(*, fades: bool, noise: float = 0.01) -> tuple[Array, Array]:
    """Sweep from .4 to 20 rad/s in 40 s from rest, and what a second-order vehicle makes of it."""
    t = np.arange(round(40.0 / STEP_S)) * STEP_S
    rate = np.log(20.0 / 0.4) / 40.0
    sweep = np.sin(0.4 / rate * np.expm1(rate * t))
    if fades:
        ends = np.minimum(1.0, np.minimum(t, t[-1] - t) / 4.0)
        sweep *= np.sin(0.5 * np.pi * ends) ** 2
    quiet = np.zeros(round(4.0 / STEP_S))
    u = np.concatenate([quiet, sweep, quiet])
    y = signal.lfilter(NUMERATOR.ravel(), DENOMINATOR, u)
    return u, y + noise * y.std() * np.random.default_rng(3).standard_normal(len(y))


def record(u: Array, y: Array) -> Record:
    time = np.arange(len(u)) * STEP_S
    return fid.Record.from_arrays(time, inputs={"u": u}, outputs={"y": y})


def stretch(start_s: float, end_s: float) -> Record:
    """A part of the flight, in the middle of its motion."""
    part = slice(round(start_s / STEP_S), round(end_s / STEP_S))
    u, y = flown(fades=True)
    return record(u[part], y[part])


@cache
def estimated(start_s: float, end_s: float) -> FrequencyResponse:
    return fid.estimate_response(stretch(start_s, end_s))


def truth(omega: Array) -> NDArray[np.complex128]:
    return np.asarray(signal.freqz(NUMERATOR.ravel(), DENOMINATOR, omega * STEP_S)[1])


STRETCHES = [(14.0, 24.0), (20.0, 36.0), (8.0, 30.0)]


@pytest.mark.parametrize("span", STRETCHES)
def test_the_line_lies_within_its_own_bars(span: tuple[float, float]) -> None:
    drawn: dict[str, list[Array]] = {"y": [], "y2": []}
    for each in response_figure(estimated(*span)).data:
        if each.yaxis in drawn:
            drawn[each.yaxis].append(np.asarray(each.y, dtype=float))
    for lines in drawn.values():
        assert len(lines) == 3, "one line, and a band of two edges"
        *_, line = rows = np.stack(lines)
        assert np.all((rows.min(axis=0) <= line) & (line <= rows.max(axis=0)))
        assert np.array_equal(np.median(rows, axis=0), line)


@pytest.mark.parametrize("span", STRETCHES)
def test_what_is_usable_of_a_stretch_is_true(span: tuple[float, float]) -> None:
    shown = estimated(*span).shown
    usable = shown.coherence[0, 0] >= COHERENT
    assert np.count_nonzero(usable) >= 5
    error = np.abs(shown.response[0, 0] / truth(shown.omega_rad_s) - 1.0)
    assert np.max(error[usable]) < 0.2
    band = fid.response_band(estimated(*span), "u", "y")
    assert band is not None
    true = np.abs(truth(band.omega_rad_s))
    holds = (band.gain[0] <= true) & (true <= band.gain[1])
    assert np.mean(holds) >= 0.93
    assert np.mean(holds[usable]) >= 0.85, "neighbours err together: some twenty points are few"


def test_windows_alone_call_leakage_coherent() -> None:
    given = estimated(14.0, 24.0)
    wrong = np.abs(given.response[0, 0] / truth(given.omega_rad_s) - 1.0) > 0.5
    assert np.any(given.coherence[0, 0, wrong] > 0.9), "else this flight shows nothing"
    assert np.all(given.shown.coherence[0, 0, wrong] <= given.coherence[0, 0, wrong])
    (found,) = [each for each in given.shown.findings if each.code == "leakage"]
    assert "fade out" in found.action


def flown_in_a_loop() -> Record:
    """The fading sweep as command: the loop brings noise of the output into the input."""
    command, _ = flown(fades=True)
    noise = 0.02 * np.random.default_rng(9).standard_normal(len(command))
    ahead = np.zeros(len(DENOMINATOR) - 1)
    u, y = np.zeros_like(command), np.zeros_like(command)
    for k, value in enumerate(command):
        y[k] = ahead[0] + noise[k]  # nothing passes within a sample
        u[k] = value - 0.2 * y[k]
        ahead = signal.lfilter(NUMERATOR.ravel(), DENOMINATOR, [u[k]], zi=ahead)[1]
    t = np.arange(len(u)) * STEP_S
    return fid.Record.from_arrays(t, inputs={"u": u}, outputs={"y": y}, excitations={"r": command})


def test_beyond_its_excitation_a_loop_tells_nothing() -> None:
    given = fid.estimate_response(flown_in_a_loop(), estimator="instrument")
    shown, band = given.shown, fid.response_band(given, "u", "y")
    assert band is not None
    true = np.abs(truth(band.omega_rad_s))
    holds = (band.gain[0] <= true) & (true <= band.gain[1])
    beyond = band.omega_rad_s > 30.0
    assert np.count_nonzero(beyond) > 5
    assert np.mean(holds[beyond]) >= 0.9
    assert np.mean(holds[~beyond]) >= 0.9
    assert np.all(shown.coherence[0, 0, beyond] < COHERENT)


def test_a_sound_sweep_keeps_its_band() -> None:
    given = fid.estimate_response(record(*flown(fades=True)))
    before, after = (
        usable_band(each.omega_rad_s, each.coherence[0, 0]) for each in (given, given.shown)
    )
    assert before is not None
    assert after is not None
    assert np.log(after[1] / after[0]) > 0.98 * np.log(before[1] / before[0])
    assert not any(each.code == "leakage" for each in given.shown.findings)


def test_usable_points_have_bars_that_tell_something() -> None:
    """Coherent by three windows, points had bars of ±60 % in gain and of all directions."""
    u, y = flown(fades=True, noise=0.6)
    given = fid.estimate_response(record(u[500:1300], y[500:1300]), band_rad_s=(1.5, 15.0))
    band, shown = fid.response_band(given, "u", "y"), given.shown
    assert band is not None
    wide = np.ptp(band.gain, axis=0) / (2.0 * np.abs(band.centre)) > 0.6
    wide |= np.ptp(band.phase_rad, axis=0) / 2.0 > np.radians(40.0)
    coherent = given.coherence[0, 0] >= COHERENT
    assert np.count_nonzero(coherent & wide) > 5, "else this flight shows nothing"
    assert not np.any((shown.coherence[0, 0] >= COHERENT) & wide)


def test_coherence_is_no_more_than_errors_allow() -> None:
    shown = estimated(14.0, 24.0).shown
    most = 1.0 / (1.0 + 10.0 * shown.random_error**2)
    assert np.all(shown.coherence <= most * (1.0 + 1e-12))
    size = np.abs(shown.response[0, 0])
    n = shown.n_frequencies
    variances = np.diag(shown.covariance_at(shown.omega_rad_s)[0])
    told = np.sqrt(0.5 * (variances[:n] + variances[n:])) / size
    np.testing.assert_allclose(shown.random_error[0, 0], np.minimum(told, 1e6), rtol=1e-12)


def test_bins_tell_as_much_as_their_power_where_nothing_leaks() -> None:
    """A multisine of flat power and random phases: three polynomials of response share 18 bins."""
    random, n = np.random.default_rng(5), 4000
    spectrum = np.exp(2j * np.pi * random.random(n // 2 + 1))
    u = np.fft.irfft(spectrum, n)[None]
    omega = np.array([3.0])
    spread = local_spread([u], [u], omega, 0.01)[0, 0]
    power = 2.0 * 0.01 / n  # of a bin, as one-sided density
    # A parabola's middle has 9/4 of the variance of a mean; leakage takes bins as well.
    assert 2.0 < spread * power * 18 < 5.0


def test_the_command_says_what_was_leakage(tmp_path: Path) -> None:
    given = stretch(14.0, 24.0)
    table = tmp_path / "cut.csv"
    rows = np.column_stack([np.arange(given.n_samples) * STEP_S, *given.matrix(["u", "y"])])
    np.savetxt(table, rows, delimiter=",", header="time_s,u,y", comments="")
    said = CliRunner().invoke(program, ["response", str(table), "--inputs", "u", "--outputs", "y"])
    assert said.exit_code == 0, said.output
    assert "leakage of the records' ends" in " ".join(said.output.split())
