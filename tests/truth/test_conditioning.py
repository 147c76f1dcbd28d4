"""Conditioning against analytic truth: filters, skew, axes, lever arms, derivatives, segments."""

from __future__ import annotations

import re
from collections.abc import Callable

import numpy as np
import pytest
from scipy import signal

from flightid import conditioning as c
from flightid.errors import DataError, OptionError, UnitError, UnknownNameError
from flightid.record import Record
from flightid.record.interpolation import windowed_sinc
from tests.closeness import assert_close

RATE_HZ = 100.0
TIME_S = np.arange(3000) / RATE_HZ
MIDDLE = slice(500, -500)
BAND = (np.pi, 16.0 * np.pi)


def _sine(frequency_hz: float) -> Record:
    wave = np.sin(2 * np.pi * frequency_hz * TIME_S)
    return Record.from_arrays(TIME_S, inputs={"u": wave}, outputs={"y": wave})


# --- detrend


def test_line_and_mean_leave_nothing_of_a_line() -> None:
    record = Record.from_arrays(TIME_S, outputs={"y": 3 + 0.2 * TIME_S})
    assert_close(c.detrend(record, "line")["y"], 0, atol=1e-12, why="a line")
    assert_close(c.detrend(record)["y"].mean(), 0, atol=1e-12, why="the mean")
    options = c.detrend(record, "line").history[-1].options
    assert_close(options["y_slope_per_s"], 0.2, rtol=1e-12, why="slope in history")


def test_trim_value_is_removed_and_kept_as_a_label() -> None:
    record = Record.from_arrays(TIME_S, outputs={"y": TIME_S}, trim={"y": 2.0})
    found = c.detrend(record, "trim")
    assert_close(found["y"], TIME_S - 2.0, atol=1e-15, why="trim")
    assert found.trim == {"y": 2.0}


# --- filters


@pytest.mark.parametrize("design", ["butterworth", "fir"])
def test_zero_phase_has_six_db_and_no_phase_at_the_cutoff(design: str) -> None:
    record = _sine(5.0)
    order = 4 if design == "butterworth" else 200
    found = c.filter_record(record, 5.0, design=design, order=order)
    assert_close(
        found["y"][MIDDLE], record["y"][MIDDLE] / 2, atol=2e-3, why="half, and no shift at all"
    )
    assert found["u"].tolist() == found["y"].tolist()
    assert found.history[-1].options["delay_s"] == 0.0


@pytest.mark.parametrize("design", ["butterworth", "fir"])
def test_causal_delay_is_what_history_says(design: str) -> None:
    record = _sine(0.2)
    order = 4 if design == "butterworth" else 40
    found = c.filter_record(record, 5.0, design=design, order=order, zero_phase=False)
    delay_s = float(found.history[-1].options["delay_s"])
    late = np.sin(2 * np.pi * 0.2 * (TIME_S - delay_s))
    assert delay_s > 0.05
    assert_close(found["y"][MIDDLE], late[MIDDLE], atol=5e-4, why="group delay in the pass band")


def test_filter_agrees_with_scipy() -> None:
    random = np.random.default_rng(0).standard_normal(3000)
    record = Record.from_arrays(TIME_S, outputs={"y": random})
    sections = signal.butter(3, [1, 8], "bandpass", fs=RATE_HZ, output="sos")
    found = c.filter_record(record, (1.0, 8.0), kind="bandpass", order=3)["y"]
    assert_close(found, signal.sosfiltfilt(sections, random), atol=1e-12, why="same filter")
    taps = signal.firwin(61, 8.0, fs=RATE_HZ)
    found = c.filter_record(record, 8.0, design="fir", order=60, zero_phase=False)["y"]
    assert_close(found[60:], signal.lfilter(taps, 1, random)[60:], atol=1e-12, why="same taps")


@pytest.mark.parametrize("band", ["highpass", "bandstop"])
def test_constants_pass_or_vanish(band: str) -> None:
    record = Record.from_arrays(TIME_S, outputs={"y": np.full(3000, 4.0)})
    cutoff = 5.0 if band == "highpass" else (5.0, 10.0)
    for zero_phase in (True, False):
        found = c.filter_record(record, cutoff, kind=band, zero_phase=zero_phase)["y"]
        expected = 0.0 if band == "highpass" else 4.0
        assert_close(found, expected, atol=1e-8, why="no transient from a steady start")


# --- skew


def _skewed(lag: float, seed: int, noise: float, n: int = 6000) -> Record:
    random = np.random.default_rng(seed)
    wave = signal.sosfilt(signal.butter(3, 0.2, output="sos"), random.standard_normal(n + 400))
    first = wave[200:-200]
    second = windowed_sinc(wave, np.arange(200, n + 200) - lag, 0.5, 1.0)
    channels = {
        name: values + noise * values.std() * random.standard_normal(n)
        for name, values in (("a", first), ("b", second))
    }
    return Record.from_arrays(np.arange(n) / RATE_HZ, outputs=channels)


@pytest.mark.parametrize("lag", [0.0, 0.25, 3.37, -7.81, 20.0])
def test_skew_is_found_to_a_hundredth_of_a_sample_and_removed(lag: float) -> None:
    record = _skewed(lag, 3, 0.0)
    estimate = c.estimate_skew(record, "a", "b", band_rad_s=BAND, window_s=4.0)
    assert_close(estimate.skew_s * RATE_HZ, lag, atol=1e-3, why="a thousandth of a sample")
    aligned = c.align(record, {"b": estimate.skew_s})
    assert_close(
        aligned["b"][100:-100], aligned["a"][100:-100], atol=1e-4, why="band-limited shift"
    )
    assert aligned.n_samples == record.n_samples - int(
        np.ceil(abs(estimate.skew_s) * RATE_HZ - 1e-9)
    )
    assert estimate.to_dict()["schema"] == "flightid.skew/1"
    assert "behind" in estimate.summary().to_text()
    assert estimate._repr_html_().startswith("<table>")


@pytest.mark.parametrize(
    ("flights", "least"), [(8, 6), pytest.param(40, 35, marks=pytest.mark.nightly)]
)
def test_skew_interval_covers_the_truth(flights: int, least: int) -> None:
    inside, scores = 0, []
    for seed in range(flights):
        estimate = c.estimate_skew(_skewed(3.37, seed, 0.3), "a", "b", band_rad_s=BAND, window_s=4)
        low, high = estimate.lag.interval95
        inside += low <= 0.0337 <= high
        scores.append((estimate.lag.value - 0.0337) / estimate.lag.stderr)
    # At 95 %: fewer of 8 or of 40 has a chance of some in 1000.
    assert inside >= least
    assert 0.5 < np.sqrt(np.mean(np.square(scores))) < 1.6


@pytest.mark.slow
def test_skew_interval_is_calibrated() -> None:
    draws = [
        c.estimate_skew(_skewed(3.37, seed, 0.3), "a", "b", band_rad_s=BAND, window_s=4)
        for seed in range(1000)
    ]
    covered = np.mean([d.lag.interval95[0] <= 0.0337 <= d.lag.interval95[1] for d in draws])
    assert 0.93 <= covered <= 0.97


def test_reversed_and_unrelated_channels_are_named() -> None:
    record = c.flip_sign(_skewed(2.0, 1, 0.0), ["b"])
    estimate = c.estimate_skew(record, "a", "b", band_rad_s=BAND, window_s=4.0)
    assert_close(estimate.skew_s, 0.02, atol=1e-5, why="the sign does not disturb")
    assert [f.code for f in estimate.findings] == ["sign-reversed"]
    random = np.random.default_rng(5)
    record = Record.from_arrays(
        TIME_S, outputs={"a": random.standard_normal(3000), "b": random.standard_normal(3000)}
    )
    assert "skew-coherence-low" in {f.code for f in c.estimate_skew(record, "a", "b").findings}
    estimate = c.estimate_skew(
        _skewed(20.0, 1, 0.0), "a", "b", largest_s=0.2, band_rad_s=BAND, window_s=4
    )
    assert [f.code for f in estimate.findings] == ["skew-at-limit"]


# --- axes


def test_conversions_undo_each_other() -> None:
    random = np.random.default_rng(0).standard_normal((3, 50))
    record = Record.from_arrays(
        np.arange(50.0), outputs=dict(zip("pqr", random, strict=True)), trim={"q": 1.0}
    )
    for there, back in (("flu-to-frd", "frd-to-flu"), ("enu-to-ned", "ned-to-enu")):
        turned = c.convert_axes(record, there, [("p", "q", "r")])
        returned = c.convert_axes(turned, back, [("p", "q", "r")])
        assert returned.matrix("pqr").tobytes() == record.matrix("pqr").tobytes()
        assert returned.trim == record.trim
    ned = c.convert_axes(record, "enu-to-ned", [("p", "q", "r")])
    assert ned["p"].tolist() == record["q"].tolist()
    assert ned.trim == {"p": 1.0}


def _rotation(phi: float, theta: float, psi: float) -> np.ndarray:
    """Body to ground, rotation order 3-2-1."""
    cx, sx, cy, sy, cz, sz = (f(a) for a in (phi, theta, psi) for f in (np.cos, np.sin))
    z = np.array([[cz, -sz, 0], [sz, cz, 0], [0, 0, 1]])
    y = np.array([[cy, 0, sy], [0, 1, 0], [-sy, 0, cy]])
    x = np.array([[1, 0, 0], [0, cx, -sx], [0, sx, cx]])
    return z @ y @ x


def test_attitude_conversion_is_the_rotation_matrix_in_other_axes() -> None:
    phi, theta, psi = 0.3, -0.4, 1.1
    record = Record.from_arrays(
        [0.0, 1.0],
        outputs={"phi": [phi] * 2, "theta": [theta] * 2, "psi": [psi] * 2},
        units={"phi": "rad", "theta": "rad", "psi": "rad"},
        trim={"theta": 0.1, "psi": 0.0},
    )
    found = c.convert_attitude(record)
    ground = np.array([[0, 1, 0], [1, 0, 0], [0, 0, -1]])
    body = np.diag([1.0, -1.0, -1.0])
    expected = ground @ _rotation(phi, theta, psi) @ body
    angles = [float(found[name][0]) for name in ("phi", "theta", "psi")]
    assert_close(_rotation(*angles), expected, atol=1e-14, why="ENU/FLU to NED/FRD")
    assert_close(found.trim["psi"], np.pi / 2, rtol=1e-12, why="trim turns too")
    assert_close(c.convert_attitude(found)["psi"], psi, rtol=1e-12, why="own inverse")


# --- sensor position

UNITS = {
    **dict.fromkeys("pqr", "rad/s"),
    **dict.fromkeys(("ax", "ay", "az"), "m/s^2"),
    **dict.fromkeys(("u", "v", "w", "V"), "m/s"),
    **dict.fromkeys(("alpha", "beta"), "rad"),
}


def _spinning(arm: np.ndarray) -> tuple[Record, np.ndarray]:
    """Rates that are known functions, and accelerometers that feel only the lever arm."""
    omega = np.array([np.sin(TIME_S), 0.5 * np.cos(2 * TIME_S), 0.3 + 0 * TIME_S])
    change = np.array([np.cos(TIME_S), -np.sin(2 * TIME_S), 0 * TIME_S])
    lever = arm[:, None]
    at_sensor = np.cross(change, lever, axis=0) + np.cross(
        omega, np.cross(omega, lever, axis=0), axis=0
    )
    samples = dict(zip(("p", "q", "r", "ax", "ay", "az"), [*omega, *at_sensor], strict=True))
    return Record.from_arrays(TIME_S, outputs=samples, units={k: UNITS[k] for k in samples}), omega


def test_accelerometer_on_an_analytic_rotation_reads_nothing_at_the_cg() -> None:
    record, _ = _spinning(np.array([0.4, -0.2, 0.1]))
    found = c.accelerations_at_cg(record, (0.4, -0.2, 0.1))
    assert np.max(np.abs(record.matrix(("ax", "ay", "az")))) > 0.3
    inner = found.matrix(("ax", "ay", "az"))[:, 2:-2]
    assert_close(inner, 0, atol=1e-4, why="five-point derivative at 100 Hz")
    assert found.history[-1].options["y_m"] == -0.2


def test_sensors_move_in_the_units_that_a_record_has() -> None:
    record, _ = _spinning(np.array([0.4, -0.2, 0.1]))
    feet = record.to_units(p="deg/s", ax="ft/s^2", ay="g", az="ft/s^2")
    moved = c.accelerations_at_cg(feet, (0.1, 0.2, 0.3))
    assert [moved.unit(name) for name in ("p", "ax", "ay")] == ["deg/s", "ft/s^2", "g"]
    metres = moved.to_units(ax="m/s^2", ay="m/s^2", az="m/s^2").matrix(("ax", "ay", "az"))
    known = c.accelerations_at_cg(record, (0.1, 0.2, 0.3)).matrix(("ax", "ay", "az"))
    assert_close(metres, known, atol=1e-12, why="the same motion in other units")
    samples = {name: record[name] for name in record.channels}
    wrong = Record.from_arrays(
        TIME_S, outputs=samples, units={k: UNITS[k] for k in samples} | {"ax": "deg"}
    )
    with pytest.raises(UnitError, match=r"'ax'.* has another unit"):
        c.accelerations_at_cg(wrong, (0.1, 0.2, 0.3))


def test_velocity_and_air_data_on_a_lever_arm() -> None:
    arm = np.array([1.5, 0.3, -0.4])
    record, omega = _spinning(arm)
    at_cg = np.array([[20.0], [1.0], [2.0]])
    at_boom = at_cg + np.cross(omega, arm[:, None], axis=0)
    speed = np.linalg.norm(at_boom, axis=0)
    more = {
        **dict(zip("uvw", at_boom, strict=True)),
        "V": speed,
        "alpha": np.arctan2(at_boom[2], at_boom[0]),
        "beta": np.arcsin(at_boom[1] / speed),
    }
    record = Record.from_arrays(
        TIME_S,
        outputs={**{k: record[k] for k in "pqr"}, **more},
        units={k: UNITS[k] for k in ("p", "q", "r", *more)},
    )
    moved = c.velocities_at_cg(record, tuple(arm))
    assert_close(moved.matrix("uvw"), at_cg + 0 * TIME_S, atol=1e-12, why="v - omega x r")
    air = c.air_data_at_cg(record, tuple(arm))
    assert_close(air["V"], np.linalg.norm(at_cg), rtol=1e-12, why="speed")
    assert_close(air["alpha"], np.arctan2(2.0, 20.0), rtol=1e-11, why="angle of attack")
    assert_close(air["beta"], np.arcsin(1.0 / np.linalg.norm(at_cg)), rtol=1e-11, why="sideslip")


# --- derivatives


def test_local_derivative_is_that_of_savitzky_and_golay() -> None:
    values = np.random.default_rng(0).standard_normal(23)
    for half_width in (1, 2, 5, 11):
        known = signal.savgol_filter(
            values, 2 * half_width + 1, 2, deriv=1, delta=0.02, mode="interp"
        )
        found = c.local_derivative(values, 0.02, half_width=half_width)
        assert_close(found, known, why="the ends too", rtol=1e-11, atol=1e-11)


def test_local_derivative_of_a_sine() -> None:
    found = c.local_derivative(np.sin(3 * TIME_S), 0.01)
    assert_close(found[2:-2], 3 * np.cos(3 * TIME_S)[2:-2], atol=2e-3, why="fourth-order error")


def test_fourier_smoother_finds_signal_slope_and_noise() -> None:
    random = np.random.default_rng(0)
    truth = np.sin(2 * TIME_S) + 0.5 * np.cos(5 * TIME_S)
    noisy = truth + 0.05 * random.standard_normal(TIME_S.size)
    found = c.fourier_smooth(noisy, 0.01)
    slope = 2 * np.cos(2 * TIME_S) - 2.5 * np.sin(5 * TIME_S)
    inner = slice(100, -100)
    assert np.std(found.values[inner] - truth[inner]) < 0.05 / 3
    assert np.std(found.derivative[inner] - slope[inner]) < 0.1
    assert_close(found.noise, 0.05, rtol=0.1, why="median of 1500 squared coefficients")
    exact = c.fourier_smooth(truth, 0.01, cutoff_hz=20.0)
    assert_close(exact.values[inner], truth[inner], atol=1e-4, why="nothing to remove")
    assert_close(exact.derivative[inner], slope[inner], atol=5e-3, why="series differentiated")


def test_derivatives_become_channels() -> None:
    record = Record.from_arrays(TIME_S, outputs={"p": np.sin(TIME_S)}, units={"p": "rad/s"})
    for options in ({}, {"half_width": None, "cutoff_hz": 5.0}):
        found = c.differentiate(record, {"p": "p_dot"}, **options)
        assert found.unit("p_dot") == "rad/s^2"
        assert_close(found["p_dot"][MIDDLE], np.cos(TIME_S)[MIDDLE], atol=1e-3, why="cosine")


# --- segments and resampling


def test_events_modes_and_drops() -> None:
    mode = np.where(TIME_S < 10, 5.0, 25.0)
    record = Record.from_arrays(TIME_S, outputs={"y": TIME_S}, others={"mode": mode})
    parts = c.split(record, {"sweep": 5.0, "doublet": 20.0})
    assert [(p.name, p.n_samples) for p in parts] == [
        ("record[0]", 500),
        ("sweep", 1500),
        ("doublet", 1000),
    ]
    assert [p.n_samples for p in c.split_by_mode(record, "mode")] == [1000, 2000]
    assert [p.n_samples for p in c.split_by_mode(record, "mode", shortest_s=15.0)] == [2000]
    assert [p.n_samples for p in c.drop(record, [(0.0, 5.0), (10.0, 12.0)])] == [500, 1800]
    assert sum(p.n_samples for p in c.split(record, [1.0, 2.0, 3.0])) == record.n_samples


def test_resampling_a_record_keeps_the_sine() -> None:
    record = _sine(1.0)
    found = c.resample(record, 1 / 30, interpolation={"u": "linear"})
    assert_close(
        found["y"][50:-50], np.sin(2 * np.pi * found.time_s)[50:-50], atol=3e-5, why="kernel"
    )
    assert "low-pass" in str(found.history[-1].options["y"])


# --- refusals

BASE = Record.from_arrays(
    TIME_S,
    outputs={**{k: np.sin(TIME_S) for k in ("p", "q", "r")}, "deg": TIME_S, "flat": 0 * TIME_S},
    units={**dict.fromkeys("pqr", "rad/s"), "deg": "deg"},
)
AIR = Record.from_arrays(
    TIME_S,
    outputs={**{k: BASE[k] for k in "pqr"}, "V": BASE["flat"], "alpha": TIME_S, "beta": TIME_S},
    units={k: UNITS[k] for k in ("p", "q", "r", "V", "alpha", "beta")},
)


@pytest.mark.parametrize(
    ("call", "error", "message"),
    [
        (lambda: c.detrend(BASE, "curve"), OptionError, "trend is not known: found 'curve'"),
        (lambda: c.detrend(BASE, "trim"), DataError, "channel 'p' has no trim value"),
        (lambda: c.detrend(BASE, channels=["x"]), UnknownNameError, "no such channel: found x"),
        (lambda: c.filter_record(BASE, 60.0), OptionError, "does not suit a lowpass filter"),
        (lambda: c.filter_record(BASE, 5.0, kind="notch"), OptionError, "band is not known"),
        (lambda: c.filter_record(BASE, 5.0, design="x"), OptionError, "filter design is not known"),
        (lambda: c.filter_record(BASE, 5.0, order=13), OptionError, "order is out of range"),
        (
            lambda: c.filter_record(BASE, 5.0, design="fir", order=5),
            OptionError,
            "order of an FIR filter is not even: found 5",
        ),
        (
            lambda: c.filter_record(BASE, (8.0, 2.0), kind="bandpass"),
            OptionError,
            "cut-offs are not in order",
        ),
        (
            lambda: c.filter_record(BASE, 5.0, design="fir", order=4000),
            DataError,
            "the record is shorter than the filter",
        ),
        (
            lambda: c.estimate_skew(BASE, "p", "deg"),
            UnitError,
            "channel 'deg' has another unit",
        ),
        (
            lambda: c.estimate_skew(BASE, "p", "q", window_s=20.0),
            OptionError,
            "window or search range do not suit",
        ),
        (
            lambda: c.estimate_skew(BASE, "p", "q", band_rad_s=(0.06, 0.12)),
            OptionError,
            "the band holds too few frequencies",
        ),
        (
            lambda: c.estimate_skew(BASE.replace({"q": BASE["flat"]}), "p", "q"),
            DataError,
            "channel 'q' does not move",
        ),
        (lambda: c.align(BASE, {"p": np.nan}), OptionError, "skew of 'p' is not finite"),
        (lambda: c.align(BASE, {"p": 100.0}), DataError, "a skew is as long as the record"),
        (
            lambda: c.convert_axes(BASE, "up", [("p", "q", "r")]),
            OptionError,
            "axis conversion is not known",
        ),
        (
            lambda: c.convert_axes(BASE, "flu-to-frd", [("p", "q", "deg")]),
            OptionError,
            "three components of one unit",
        ),
        (
            lambda: c.accelerations_at_cg(BASE, (1.0, 0.0, 0.0), accelerations=("p", "q", "r")),
            UnitError,
            "channel 'p' of record 'record' has another unit",
        ),
        (
            lambda: c.velocities_at_cg(BASE, (1.0, 0.0)),
            OptionError,
            "position is not three finite numbers",
        ),
        (lambda: c.air_data_at_cg(AIR, (1.0, 0, 0)), DataError, "'V' is not positive everywhere"),
        (lambda: c.local_derivative([1.0, 2.0], 0.1), DataError, "too few samples"),
        (
            lambda: c.local_derivative(TIME_S, 0.0),
            OptionError,
            "needs neighbours and a sample time",
        ),
        (lambda: c.fourier_smooth([1.0, 2.0], 0.1), DataError, "too few samples for a Fourier"),
        (lambda: c.fourier_smooth(TIME_S, 0.1, cutoff_hz=6.0), OptionError, "does not lie in"),
        (
            lambda: c.fourier_smooth(np.pad(np.random.default_rng(0).standard_normal(999), 1), 0.1),
            DataError,
            "does not stand out of its noise",
        ),
        (lambda: c.differentiate(BASE, {"p": "q"}), OptionError, "the name is taken: found q"),
        (
            lambda: c.differentiate(BASE, {"p": "x"}, cutoff_hz=2.0),
            OptionError,
            "a cut-off belongs to the global method",
        ),
        (lambda: c.split(BASE, [99.0]), OptionError, "an instant lies outside the record"),
        (lambda: c.drop(BASE, [(2.0, 1.0)]), OptionError, "does not end after it begins"),
        (lambda: c.drop(BASE, [(-1.0, 99.0)]), DataError, "nothing remains"),
    ],
)
def test_refusals(call: Callable[[], object], error: type[Exception], message: str) -> None:
    with pytest.raises(error, match=re.escape(message)):
        call()
