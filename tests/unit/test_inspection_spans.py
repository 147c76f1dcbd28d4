"""What the inspection says of spans: nothing is lost to a rounding, nothing claimed unmeasured."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
import scipy.signal

import flightid as fid
from flightid.conventions import Light
from flightid.inspection.actuators import find_actuators
from flightid.inspection.axes import AxisChannels
from flightid.inspection.flight_phases import FlightPhases, flight_phases
from flightid.inspection.gap_findings import gap_findings
from flightid.inspection.rates import stream_rates
from flightid.inspection.signals import Signal, find, inside, records
from flightid.inspection.stretches import packed
from flightid.inspection.thresholds import INDEPENDENT_WINDOWS
from flightid.inspection.usable_band import _explained, _whole_window
from flightid.logs import Log, read_log
from flightid.logs.dataflash.writer import DataflashWriter
from flightid.logs.ulog.reader import UlogSource
from tests.ulog_builder import UlogBuilder

STAMPS = (1e7 + 1e4 * np.arange(3000)).astype(np.int64)
MOTORS = {f"SERVO{i}_FUNCTION": 32.0 + i for i in (1, 2)}


def written(
    folder: Path, stamps: np.ndarray = STAMPS, *, events: bool = False, **pwm: float
) -> Log:
    """Rates and motor outputs alone, the motors at 1500 µs between the first and last second."""
    writer = DataflashWriter()
    writer.message(int(stamps[0]), "ArduCopter V4.6.0 (test)")
    for name, value in {**MOTORS, **pwm}.items():
        writer.parameter(name, value)
    flying = (stamps > stamps[0] + 1e6) & (stamps < stamps[-1] - 1e6)
    outputs = np.where(flying, 1500.0, 1000.0)
    writer.add("RCOU", stamps, {"C1": outputs, "C2": outputs})
    writer.add("RATE", stamps, {"R": np.sin(1e-6 * stamps), "ROut": np.cos(1e-6 * stamps)})
    if events:
        paused = np.flatnonzero(np.diff(stamps) > 1e6)[0]
        writer.add("EV", stamps[paused + 1 : paused + 2], {"Id": [10]})
    return read_log(writer.write(folder / "flight.bin"))


def test_a_span_that_ends_a_microsecond_after_a_stream_keeps_the_stream() -> None:
    stamps = np.arange(1000) / 100.0
    signals = [Signal(name, stamps, np.sin(stamps), "1", name) for name in ("tau_phi", "p")]
    (made,) = records(signals, {"tau_phi"}, [(-1e-6, stamps[-1] + 1e-6)])
    assert made.n_samples == stamps.size


def test_both_ends_of_a_span_are_inside() -> None:
    assert inside(np.arange(5.0), [(0.0, 1.0), (3.0, 3.0)]).tolist() == [
        True,
        True,
        False,
        True,
        False,
    ]


@pytest.mark.parametrize("rate", [None, 50.0])
def test_a_record_over_such_a_span_is_made_too(tmp_path: Path, rate: float | None) -> None:
    log = written(tmp_path)
    span = (log.first_s or 0.0, (log.last_s or 0.0) + 1e-6)
    made = log.record(names=["tau_phi", "p"], span_s=span, sample_rate_hz=rate)
    assert made.duration_s > 29.9


def test_motors_tell_of_flight_where_no_throttle_is_logged(tmp_path: Path) -> None:
    log = written(tmp_path, MOT_PWM_MIN=1000.0, MOT_PWM_MAX=2000.0)
    phases = flight_phases(log, find_actuators(log))
    assert phases.evidence == "mean of RCOU above 0.219"
    assert phases.airborne_s == pytest.approx(28.0, abs=0.05)


def test_nothing_that_tells_of_flight_is_not_called_never_airborne(tmp_path: Path) -> None:
    writer = DataflashWriter()
    writer.message(int(STAMPS[0]), "ArduCopter V4.6.0 (test)")
    writer.add("RATE", STAMPS, {"R": np.sin(1e-6 * STAMPS), "ROut": np.cos(1e-6 * STAMPS)})
    found = fid.inspect_log(writer.write(tmp_path / "rates.bin"))
    codes = {finding.code: finding.light for finding in found.findings}
    assert codes["flight-unknown"] is Light.UNKNOWN
    assert "not-airborne" not in codes


@pytest.mark.parametrize(
    ("pwm", "limits"),
    [
        ({"MOT_PWM_MAX": 0.0, "RC3_MIN": 1100.0, "RC3_MAX": 1900.0}, (1100.0, 1900.0)),
        ({"MOT_PWM_MIN": 1050.0, "MOT_PWM_MAX": 1950.0, "RC3_MIN": 1100.0}, (1050.0, 1950.0)),
        ({"RCMAP_THROTTLE": 1.0, "RC1_MIN": 900.0, "RC1_MAX": 2100.0}, (900.0, 2100.0)),
        ({"MOT_PWM_MIN": 0.0, "MOT_PWM_MAX": 0.0}, (1000.0, 2000.0)),
    ],
)
def test_zero_is_no_limit_of_a_motor(
    tmp_path: Path, pwm: dict[str, float], limits: tuple[float, float]
) -> None:
    found = find_actuators(written(tmp_path, MOT_SPIN_MIN=0.0, MOT_SPIN_MAX=1.0, **pwm))
    assert found is not None
    assert (found.low, found.high) == limits
    used = find_actuators(written(tmp_path, **pwm))
    assert used is not None
    width = limits[1] - limits[0]
    assert (used.low, used.high) == (limits[0] + 0.15 * width, limits[0] + 0.95 * width)


def test_a_pause_between_arms_is_no_slow_card(tmp_path: Path) -> None:
    stamps = STAMPS + np.where(np.arange(STAMPS.size) >= 1500, int(2e7), 0)
    log = written(tmp_path, stamps, events=True)
    (rate,) = [rate for rate in stream_rates(log) if rate.message == "RATE"]
    apart = FlightPhases(((11.0, 24.99), (45.0, 58.0)), True, None, "test")
    (said,) = gap_findings(log, rate, apart)
    assert (said.code, said.light) == ("pauses", Light.GREEN)
    flown = FlightPhases(((11.0, 58.0),), True, None, "test")
    (said,) = gap_findings(log, rate, flown)
    assert (said.code, said.message[:45]) == (
        "gaps",
        "RATE has 1 gap in flight, the longest 20 s (m",
    )
    unarmed = written(tmp_path, stamps)
    for near, code in (
        ((24.99, 45.0), "gaps"),
        ((23.9, 45.0), "pauses"),
        ((24.99, 46.1), "pauses"),
    ):
        spans = FlightPhases(((11.0, near[0]), (near[1], 58.0)), True, None, "test")
        assert [said.code for said in gap_findings(unarmed, rate, spans)] == [code]


def test_the_gyroscope_of_a_driver_is_read(tmp_path: Path) -> None:
    built = UlogBuilder().format("sensor_gyro:uint64_t timestamp;float x;float y;float z;")
    built.announce("sensor_gyro", 0)
    for index in range(50):
        built.sample(0, "Q3f", 1_000_000 + 4000 * index, 0.1 * index, 0.2, -0.3)
    path = tmp_path / "gyro.ulg"
    path.write_bytes(bytes(built))
    found = find(Log(path, UlogSource(path)), "p")
    assert found is not None
    assert found.label == "sensor_gyro.x"
    assert found.values[-1] == pytest.approx(4.9)


def test_gaps_do_not_leave_an_axis_without_windows(shared_data: Path, tmp_path: Path) -> None:
    """Pieces of one window and a half hold one: by their lengths' sum no frequency had five."""
    lengths = [5.4, 5.3, 3.1, *[2.9] * 3, *[1.4] * 6]
    whole = _whole_window(lengths, 7.0)
    assert sum(int(each / whole + 1e-9) for each in lengths) >= 7
    assert sum(int(each / (1.01 * whole) + 1e-9) for each in lengths) < 7
    assert _whole_window([70.0], 7.0) == pytest.approx(10.0)
    content = (shared_data / "logs" / "px4_esc_status.ulg").read_bytes()
    cut = tmp_path / "cut.ulg"
    cut.write_bytes(content[: len(content) * 39 // 50])
    # A log cut a little earlier has coherence on all axes.
    assert all(band.largest_coherence for band in fid.inspect_log(cut).bands)


def test_two_chirps_of_20_s_are_judged_at_every_frequency() -> None:
    """Seven windows of 5.7 s lie in 40 s, but six in two halves: one too few of the longest."""
    rng, time_s = np.random.default_rng(0), 0.002 * np.arange(24_000)
    axes = [AxisChannels(f"u{axis}", f"y{axis}", "") for axis in "pqr"]
    sweep = scipy.signal.chirp(np.mod(time_s, 25.0), 2.0, 20.0, 60.0, "logarithmic")
    signals = []
    for place, names in enumerate(axes):
        command = 0.02 * rng.standard_normal(time_s.size) + (sweep if place == 0 else 0.0)
        rate = scipy.signal.lfilter([0.01], [1.0, -0.99], command)
        rate += 0.003 * rng.standard_normal(time_s.size)
        signals += [Signal(names.command, time_s, command, "1", names.command),
                    Signal(names.rate, time_s, rate, "rad/s", names.rate)]  # fmt: skip
    found = _explained(packed(signals), axes, ((0.0, 20.0), (25.0, 45.0)))
    assert not isinstance(found, str)
    assert found.composite.n_independent.min() >= INDEPENDENT_WINDOWS.value - 0.5
    swept = (found.omega_rad_s > 3.0 * math.tau) & (found.omega_rad_s < 30.0 * math.tau)
    assert found.composite.coherence[0, 0][swept].min() > 0.9
