"""Noise of the gyro in the outputs against the controllers' recursions; filters chosen by it."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import flightid as fid
from flightid.control.autopilots import AxisLoop, GainChange
from flightid.control.autopilots.output_noise import GyroSpectrum, output_noise
from flightid.control.tuning.filter_choice import choose_filters
from flightid.control.tuning.result import RefusedAxis
from flightid.control.tuning.tuned_filters import TunedFilters
from flightid.errors import DataError
from tests.closeness import assert_close

LOOP_HZ, GYRO_HZ, N = 400.0, 2000.0, 20_000


def _noise(seed: int, low_hz: float, high_hz: float) -> tuple[np.ndarray, GyroSpectrum]:
    """A period of noise made of lines, and its density."""
    spacing = GYRO_HZ / N
    frequency = np.arange(1, N // 2) * spacing
    density = np.where((frequency >= low_hz) & (frequency <= high_hz), 1e-5, 0.0)
    density *= 1.0 + 20.0 * np.exp(-(((frequency - 120.0) / 8.0) ** 2))
    phases = np.random.default_rng(seed).uniform(0.0, 2 * np.pi, frequency.size)
    lines = np.concatenate([[0.0], np.sqrt(density * spacing / 2) * np.exp(1j * phases), [0.0]])
    return np.fft.irfft(lines, N) * N, GyroSpectrum(frequency, density, "raw")


def _flown(
    axes: tuple[str, ...], spectrum: GyroSpectrum
) -> tuple[dict[str, AxisLoop], dict[str, GyroSpectrum], dict[str, float]]:
    """Loops of these axes, the spectrum of each and its crossover."""
    loops = {
        axis: fid.axis_loop("arducopter", axis, loop_rate_hz=LOOP_HZ, gyro_rate_hz=GYRO_HZ)
        for axis in axes
    }
    return loops, dict.fromkeys(axes, spectrum), dict.fromkeys(axes, 30.0)


@pytest.mark.parametrize("autopilot", ["arducopter", "arduplane", "px4_multicopter"])
def test_output_noise_is_what_the_recursion_makes_of_such_a_gyro(autopilot: str) -> None:
    samples, spectrum = _noise(1, 30.0, 900.0)
    loop = fid.axis_loop(autopilot, "roll", loop_rate_hz=LOOP_HZ, gyro_rate_hz=GYRO_HZ)
    loop = loop.with_gains({loop.names["d"]: 0.02 * loop.values["p"]})
    found = output_noise(loop, spectrum)
    twice = np.tile(samples, 2)
    run = loop.run(np.zeros(2 * N // 5), twice, gyro="raw", single_precision=False)
    for name, letter in ((loop.names["p"], "P"), (loop.names["d"], "D")):
        last = run.terms[letter][-N // 5 :]
        assert_close(found.paths[name], last.std(), rtol=1e-3, why=f"{letter} of a whole period")
    both = (run.terms["P"] + run.terms["D"])[-N // 5 :]
    assert_close(found.total, both.std(), rtol=1e-3, why="both paths together")


def test_a_filtered_spectrum_tells_the_same_and_what_other_filters_would_do() -> None:
    _, raw = _noise(2, 30.0, 190.0)
    loop = fid.axis_loop("arducopter", "pitch", loop_rate_hz=LOOP_HZ, gyro_rate_hz=GYRO_HZ)
    loop = loop.with_gains(INS_GYRO_FILTER=40.0)
    gain = np.abs(loop.gyro_response(2 * np.pi * raw.frequency_hz)) ** 2
    behind = GyroSpectrum(raw.frequency_hz, raw.density * gain, "filtered")
    new = loop.with_gains(INS_GYRO_FILTER=80.0)
    for asked in (loop, new):
        exact = output_noise(asked, raw).total
        told = output_noise(asked, behind, flown=loop).total
        assert_close(told, exact, rtol=1e-9, why="the flown filter is divided out")
    omega, density = raw.behind(loop)
    at = np.interp(2 * np.pi * 120.0, omega, density)
    assert_close(at, np.interp(120.0, raw.frequency_hz, raw.density * gain), rtol=0.02, why="same")


def test_noise_above_half_of_the_loop_s_rate_is_folded_below_it() -> None:
    frequency = np.linspace(1.0, 999.0, 4000)
    line = GyroSpectrum(frequency, np.exp(-(((frequency - 310.0) / 3.0) ** 2)), "raw")
    loop = fid.axis_loop("arducopter", "roll", loop_rate_hz=LOOP_HZ, gyro_rate_hz=GYRO_HZ)
    omega, density = line.behind(loop)
    assert_close(omega[np.argmax(density)], 2 * np.pi * 90.0, rtol=0.01, why="400 − 310 Hz")
    power = np.trapezoid(density, omega) / (2 * np.pi)
    gain = np.abs(loop.gyro_response(2 * np.pi * frequency)) ** 2
    assert_close(power, np.trapezoid(line.density * gain, frequency), rtol=0.01, why="none is lost")


def test_motion_below_20_hz_is_no_noise() -> None:
    frequency = np.linspace(1.0, 999.0, 4000)
    moved = GyroSpectrum(frequency, np.where(frequency < 20.0, 1e3, 1e-5), "filtered")
    loop = fid.axis_loop("arducopter", "roll", loop_rate_hz=LOOP_HZ, gyro_rate_hz=GYRO_HZ)
    omega, density = moved.behind(loop)
    below = density[omega < 2 * np.pi * 19.0]
    assert_close(below, np.full(below.size, density[100]), rtol=0.5, why="the level just above it")
    assert density[100] < 1e-4


def test_a_filter_is_raised_only_as_far_as_the_spectrum_tells() -> None:
    _, spectrum = _noise(3, 30.0, 900.0)
    loop = fid.axis_loop("arducopter", "roll", loop_rate_hz=LOOP_HZ, gyro_rate_hz=GYRO_HZ)
    for known_hz, highest in ((900.0, 40.0), (90.0, 30.0), (50.0, 20.0)):
        kept = spectrum.frequency_hz <= known_hz
        told = GyroSpectrum(spectrum.frequency_hz[kept], spectrum.density[kept], "raw")
        choice = choose_filters({"roll": loop}, {"roll": told}, {"roll": 30.0}, {"roll": 1e3})
        assert choice.values.get("INS_GYRO_FILTER", 20.0) == highest, "a third of what is known"


def test_a_plant_behind_the_flown_filter_sees_the_change_of_it_alone() -> None:
    flown = fid.axis_loop("arducopter", "roll", loop_rate_hz=LOOP_HZ, gyro_rate_hz=GYRO_HZ)
    notch = fid.axis_loop(
        "arducopter", "roll", {**flown.gains, "INS_HNTCH_ENABLE": 1.0, "INS_HNTCH_MODE": 0.0},
        loop_rate_hz=LOOP_HZ, gyro_rate_hz=GYRO_HZ,
    )  # fmt: skip
    for loop in (flown, notch):
        new = loop.with_filters({"INS_GYRO_FILTER": 45.0, "ATC_RAT_RLL_FLTD": 31.0})
        omega = np.geomspace(3.0, 1200.0, 40)
        plant = loop.gyro_response(omega)
        whole = plant * new.feedback(omega, gyro="filtered")
        plain = replace(new, plant_gyro=None)
        assert_close(whole, plain.feedback(omega, gyro="raw"), rtol=1e-9, why="old · new over old")
        assert_close(new.plant_gyro_response(omega), plant, rtol=1e-12, why="what the plant holds")


def test_quiet_gyros_get_faster_filters_and_noisy_ones_slower_within_ranges_and_steps() -> None:
    _, spectrum = _noise(3, 30.0, 900.0)
    axes = ("roll", "pitch")
    loops, spectra, at = _flown(axes, spectrum)
    flown = output_noise(loops["roll"], spectrum).total
    quiet = choose_filters(loops, spectra, at, dict.fromkeys(axes, 50.0 * flown))
    assert quiet.values == {
        "INS_GYRO_FILTER": 40.0, "ATC_RAT_RLL_FLTD": 40.0, "ATC_RAT_PIT_FLTD": 40.0
    }  # fmt: skip
    assert all(each.phase_gained_deg > 5.0 for each in quiet.axes)
    noisy = choose_filters(loops, spectra, at, dict.fromkeys(axes, 0.6 * flown))
    assert noisy.within_limit
    assert all(each.noise_new <= 0.6 * flown < each.noise_flown for each in noisy.axes)
    own = {name: value for name, value in noisy.values.items() if name in loops["pitch"].gains}
    new = output_noise(loops["pitch"].with_gains(own), spectrum).total
    assert_close(noisy.axes[1].noise_new, new, rtol=1e-9, why="told of the filters that are set")
    hopeless = choose_filters(loops, spectra, at, dict.fromkeys(axes, 1e-3 * flown))
    assert not hopeless.within_limit
    assert hopeless.values["INS_GYRO_FILTER"] == 10.0
    fixed = choose_filters(loops, spectra, at, dict.fromkeys(axes, flown), step_limit=1.0)
    assert fixed.changes == (), "no step is allowed"
    notch = GainChange("INS_HNTCH_ENABLE", 1.0)
    added = replace(noisy, changes=(notch, *noisy.changes)).summary().notes[0]
    assert added.startswith("INS_HNTCH_ENABLE 1; INS_GYRO_FILTER 20 → "), "the log has no notch"


def test_gains_are_tuned_with_the_new_filter_around_a_plant_that_holds_the_old_one() -> None:
    plant = fid.load_model("rate_integrator", axis="roll").with_values(
        {"Ltphi": 140.0, "tau": 0.03}
    )
    flown = fid.axis_loop("arducopter", "roll", loop_rate_hz=LOOP_HZ, gyro_rate_hz=GYRO_HZ)
    loop = flown.with_filters({"INS_GYRO_FILTER": 40.0})
    design = fid.tune_pid(
        plant, gains=loop, band_rad_s=(1.0, 100.0), nominal=True, angle_loop=False,
        requirements=fid.TuningRequirements(noise_growth=None),
    )  # fmt: skip
    found = design.worst_case("rate loop", "phase margin").nominal
    omega = np.geomspace(1.0, 200.0, 4000)
    # Twice the cut-off, around a plant whose delay holds the old one.
    faster = design.loop.gyro_response(omega) / flown.gyro_response(omega)
    control = replace(design.loop, plant_gyro=None).feedback(
        omega, gyro="filtered", with_hold=False
    )
    whole = control * faster * plant.frequency_response(omega)[0, 0]
    cross = int(np.flatnonzero(np.abs(whole) >= 1.0)[-1])
    phase = 180.0 + np.degrees(np.unwrap(np.angle(whole)))[cross]
    assert_close(found, phase, atol=0.5, why="old filter out, new filter in")


def test_tuning_with_a_choice_judges_its_filters_and_leaves_the_flown_margins_alone(
    tmp_path: Path,
) -> None:
    _, spectrum = _noise(5, 30.0, 900.0)
    axes = ("roll", "yaw")
    loops, spectra, at = _flown(axes, spectrum)
    flown_noise = output_noise(loops["roll"], spectrum).total
    choice = choose_filters(loops, spectra, at, dict.fromkeys(axes, 4.0 * flown_noise))
    assert choice.values["INS_GYRO_FILTER"] > 20.0
    plant = fid.load_model("rate_integrator", axis="roll").with_values(
        {"Ltphi": 140.0, "tau": 0.03}
    )
    shared = {"gains": loops, "band_rad_s": (1.0, 100.0), "nominal": True, "angle_loop": False}
    with_choice = fid.tune({"roll": plant}, filters=choice, **shared)
    plain = fid.tune({"roll": plant}, **shared)
    design = with_choice["roll"]
    for name in ("crossover", "phase margin", "gain margin"):
        found = (each["roll"].worst_case("rate loop", name).flown for each in (with_choice, plain))
        assert_close(*found, rtol=1e-9, why="flown gains are judged with the flown filters")
    started = fid.tune_pid(
        plant, gains=loops["roll"].with_filters(choice.loops["roll"].gains),
        band_rad_s=(1.0, 100.0), nominal=True, angle_loop=False,
        gyro_noise=spectrum.behind(loops["roll"]),
        requirements=fid.TuningRequirements(
            noise_growth=None, output_noise_rms=4.0 * flown_noise
        ),
    )  # fmt: skip
    assert design.gains == started.gains, "the same loop, and the same limit of noise"
    assert with_choice.filters is not None
    told = with_choice.filters.axes[0]
    assert_close(told.noise_flown, flown_noise, rtol=1e-9, why="as flown")
    exact = output_noise(design.loop, spectrum, flown=loops["roll"]).total
    assert_close(told.noise_tuned, exact, rtol=1e-9, why="filters and gains")
    # Yaw's gains had quadrupled beside "filters as flown", and nothing said why.
    grown = replace(told, axis="yaw", noise_flown=1e-4, noise_tuned=1.2e-3)
    (_, why) = TunedFilters(axes=(grown, replace(grown, axis="roll", noise_tuned=1.5e-4))).words
    assert "bounds the gains, not 2 times that of the flown ones: they go further" in why
    assert "yaw 0.0001 as flown, 0.0012" in why
    assert "roll" not in why
    first, back, *_ = with_choice.write(tmp_path / "gains.param")
    names = {"INS_GYRO_FILTER", "ATC_RAT_RLL_FLTD"}
    written, before = fid.read_parameters(first), fid.read_parameters(back)
    assert {name: written[name] for name in names} == {n: choice.values[n] for n in names}
    assert {before[name] for name in names} == {20.0}
    assert not any("YAW" in name for name in written), "yaw keeps its own filters"


def test_filters_that_all_axes_share_cost_no_phase_where_nothing_is_tuned(tmp_path: Path) -> None:
    _, spectrum = _noise(3, 30.0, 900.0)
    axes = ("roll", "pitch")
    loops, spectra, at = _flown(axes, spectrum)
    limits = dict.fromkeys(axes, 0.6 * output_noise(loops["roll"], spectrum).total)
    slower = choose_filters(loops, spectra, at, limits)
    kept = choose_filters(loops, spectra, at, limits, keep_phase=["pitch"])
    assert slower.axes[1].phase_gained_deg < -1.0 <= kept.axes[1].phase_gained_deg
    plant = fid.load_model("rate_integrator", axis="roll").with_values(
        {"Ltphi": 140.0, "tau": 0.03}
    )
    tuning = fid.tune(
        {"roll": plant}, gains=loops, filters=slower, band_rad_s=(1.0, 100.0), nominal=True,
        angle_loop=False,
    )  # fmt: skip
    left = replace(tuning, refused=(RefusedAxis("pitch", "its fit is red"),))
    assert "the filters that it shares cost pitch" in left.left_out["roll"]
    assert left.filters is not None
    assert "ATC_RAT_PIT_FLTD" not in {each.name for each in left.filters.changes}
    lost = loops["pitch"].with_gains(INS_GYRO_FILTER=slower.values["INS_GYRO_FILTER"])
    phase = np.angle(lost.feedback([30.0]) / loops["pitch"].feedback([30.0]), deg=True)[0]
    assert_close(left.filters.shared_deg["pitch"], phase, rtol=1e-9, why="its D filter stays")
    with pytest.raises(DataError):
        left.write(tmp_path / "gains.param")
