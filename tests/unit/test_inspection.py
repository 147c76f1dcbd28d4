"""Inspection: a good log is green, and every shortcoming is found under its own code."""

from __future__ import annotations

import json
from collections.abc import Callable
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

import flightid as fid
from flightid.cli.inspect import command
from flightid.conventions import Light
from flightid.inspection import advice
from flightid.inspection.carried import carried_axes, carried_sentence
from flightid.inspection.inspection import Inspection
from flightid.logs import Log
from flightid.logs.ulog.reader import UlogSource
from flightid.study.proposal.propose import propose_study
from tests.sweep_log import SweepFlight
from tests.ulog_builder import UlogBuilder


def codes(inspection: Inspection, light: Light) -> set[str]:
    return {finding.code for finding in inspection.findings if finding.light is light}


@pytest.fixture(scope="module")
def good(tmp_path_factory: pytest.TempPathFactory) -> Inspection:
    path = SweepFlight().write(tmp_path_factory.mktemp("good"))
    return fid.inspect_log(path)


def test_a_flight_with_sweeps_is_green(good: Inspection) -> None:
    assert good.verdict is Light.GREEN, [str(finding) for finding in good.findings]
    assert codes(good, Light.GREEN) == {
        *("airborne", "rate-good", "excitation-found"),
        *("band-roll", "band-pitch", "band-yaw"),
    }
    assert good.phases.airborne_s == pytest.approx(135.0, abs=0.1)
    for axis in ("roll", "pitch", "yaw"):
        band = good.usable_band_rad_s[axis]
        assert band is not None
        assert band[0] < 2 * np.pi * 0.7  # twice where coherence begins
        # The sweeps end at 12 Hz: what is coherent above is not the vehicle.
        assert 2 * np.pi * 8.0 < band[1] <= 2 * np.pi * 9.001
    assert "up to where the power of the sweep ends" in " ".join(good.to_text().split())


def test_injected_runs_are_located_with_their_settings(good: Inspection) -> None:
    assert [(e.kind, e.axis) for e in good.excitations] == [
        ("sid", "roll"),
        ("sid", "pitch"),
        ("sid", "yaw"),
    ]
    second = good.excitations[1]
    assert (second.start_s, second.stop_s) == pytest.approx((61.0, 105.0), abs=0.06)
    assert "0.2 to 12 Hz" in second.detail


def test_result_is_plain_values_text_and_tables(good: Inspection) -> None:
    values = json.loads(json.dumps(good.to_dict(), allow_nan=False))
    assert values["schema"] == "flightid.inspection/1"
    assert values["verdict"] == "green"
    assert set(values["usable_band_rad_s"]) == {"roll", "pitch", "yaw"}
    assert repr(good) == "Inspection('sweeps.bin', 145 s, 134.9 s airborne, green)"
    text = good.to_text()
    head = "s of the autopilot's clock, as all times here"
    span = f"from {good.start_s:.1f} to {good.start_s + good.duration_s:.1f} {head}"
    assert span in " ".join(text.split())
    assert (
        "This log can carry a model of roll, pitch and yaw.\nNext: flightid tune sweeps.bin" in text
    )
    assert "injected sweep on roll" in " ".join(text.split())
    assert max(map(len, text.split("\n\n")[0].splitlines())) <= 100
    assert [table.title for table in good.tables()][1:3] == [
        "Usable band by axis",
        "Excitation found",
    ]
    assert "<table>" in good._repr_html_()


BAD_CASES = [
    ("rate-too-low", Light.RED, SweepFlight(rate_hz=10.0, sweep_s=30.0)),
    ("rate-limited", Light.AMBER, SweepFlight(rate_hz=50.0, sweep_s=30.0)),
    ("too-short", Light.RED, SweepFlight(sweep_s=6.0)),
    ("nothing-excited", Light.RED, SweepFlight(amplitude=0.0, injected=False, sweep_s=20.0)),
    (
        "no-usable-band",
        Light.RED,
        SweepFlight(amplitude=0.001, noise=0.5, injected=False, sweep_s=20.0),
    ),
    ("not-airborne", Light.RED, SweepFlight(airborne=False, motor_us=1000.0, sweep_s=5.0)),
    ("tipped-over", Light.AMBER, SweepFlight(tips_over=True, sweep_s=20.0)),
    ("saturated", Light.AMBER, SweepFlight(motor_us=1950.0, sweep_s=20.0)),
    ("closed-loop", Light.AMBER, SweepFlight(injected=False, sweep_s=20.0)),
    ("skew", Light.AMBER, SweepFlight(imu_late_s=0.02, sweep_s=20.0)),
]


@pytest.fixture(scope="module")
def inspected(tmp_path_factory: pytest.TempPathFactory) -> Callable[[SweepFlight], Inspection]:
    """What the inspection finds in a flight, each of which is inspected once."""
    return cache(lambda flight: fid.inspect_log(flight.write(tmp_path_factory.mktemp("flight"))))


@pytest.mark.parametrize(("code", "light", "flight"), BAD_CASES, ids=[c for c, _, _ in BAD_CASES])
def test_each_shortcoming_has_its_code(
    code: str,
    light: Light,
    flight: SweepFlight,
    inspected: Callable[[SweepFlight], Inspection],
) -> None:
    inspection = inspected(flight)
    assert code in codes(inspection, light), [str(finding) for finding in inspection.findings]
    assert inspection.verdict is not Light.GREEN


def test_a_fall_ends_the_flight(inspected: Callable[[SweepFlight], Inspection]) -> None:
    inspection = inspected(SweepFlight(tips_over=True, sweep_s=20.0))
    assert inspection.phases.tipped_s == pytest.approx(75.3, abs=0.2)
    assert inspection.phases.airborne[-1][1] <= 75.4


def test_a_fall_is_the_first_thing_that_is_said_and_done(
    inspected: Callable[[SweepFlight], Inspection], tmp_path: Path
) -> None:
    flight = SweepFlight(tips_over=True, sweep_s=20.0, rate_hz=10.0, motor_us=1950.0)
    found = inspected(flight)
    assert carried_sentence(found).startswith("The vehicle falls over at ")
    # Red stands behind it: another flight would meet what made it fall again.
    lights = [each.light for each in found.findings[:3]]
    assert lights == [Light.AMBER, Light.AMBER, Light.RED]
    assert [each.code for each in found.findings[:2]] == ["tipped-over", "saturated"]
    review = fid.review_flight(flight.write(tmp_path))
    told = [each.code for each in review.findings[:-4:-1]]
    assert told[:2] == ["tipped-over", "motor-at-upper"], "last, where eyes are on a terminal"


def test_without_a_sweep_no_axis_carries_a_model_and_the_verdict_is_red(
    inspected: Callable[[SweepFlight], Inspection],
) -> None:
    found = inspected(SweepFlight(injected=False))
    assert carried_axes(found) == ()
    assert codes(found, Light.RED) == {"no-model"}
    assert "Next: " not in found.to_text()
    (red,) = (each for each in found.findings if each.code == "no-model")
    assert red.message == "no axis carries a model: none was swept"
    assert not any("usable from" in each.message for each in found.findings)
    why = "roll, pitch, yaw: nothing was injected, and no sweep was flown"
    assert carried_sentence(found) == f"This log can carry no model: {why}."


def test_a_sweep_that_was_broken_off_is_a_sweep(tmp_path: Path) -> None:
    """It was said that none was flown; what of it is wide enough gives a model."""
    log = SweepFlight().write(tmp_path)
    content = log.read_bytes()
    for share, said in ((0.2, "roll: the band of its sweep that"), (0.3, "carry a model of roll,")):
        log.write_bytes(content[: int(share * len(content))])
        found = fid.inspect_log(log)
        assert found.excitations[0].detail.endswith("broken off")
        assert said in carried_sentence(found)
    assert propose_study([log], folder=tmp_path).models == ("Roll rate",)


def test_skew_is_measured(inspected: Callable[[SweepFlight], Inspection]) -> None:
    inspection = inspected(SweepFlight(imu_late_s=0.02, sweep_s=20.0))
    lags = {skew.quantity: skew.lag_s for skew in inspection.skews}
    assert lags["p"] == pytest.approx(0.02, abs=0.002)


def test_logging_advice_names_the_missing_bits(tmp_path: Path) -> None:
    flight = SweepFlight(rate_hz=10.0, log_bitmask=float(1 << 10 | 1 << 12))
    inspection = fid.inspect_log(flight.write(tmp_path))
    action = next(f.action for f in inspection.findings if f.code == "rate-too-low")
    assert action == "set LOG_BITMASK 267267 (now 5120; bits 0, 1, 18 are missing)"


def test_record_length_rule() -> None:
    # Five windows of two cycles at 0.3 Hz.
    assert advice.shortest_flight_s() == pytest.approx(10 / 0.3)
    assert advice.record_length(0.1).startswith("fly at least 100 s")


def px4(tmp_path: Path, output: float, thrust: float) -> Inspection:
    """A PX4 log in which the vehicle moves, with motors at `output`."""
    built = UlogBuilder()
    built.format("vehicle_angular_velocity:uint64_t timestamp;float[3] xyz;")
    built.format("vehicle_torque_setpoint:uint64_t timestamp;float[3] xyz;")
    built.format("vehicle_thrust_setpoint:uint64_t timestamp;float[3] xyz;")
    built.format("actuator_motors:uint64_t timestamp;float[4] control;")
    for number, name in enumerate(
        ["vehicle_angular_velocity", "vehicle_torque_setpoint", "vehicle_thrust_setpoint"]
    ):
        built.announce(name, number)
    built.announce("actuator_motors", 3)
    rng = np.random.default_rng(0)
    rates = np.cumsum(rng.standard_normal((8000, 3)), axis=0) * 0.02
    rates -= rates.mean(axis=0)
    for index, rate in enumerate(rates):
        stamp = 1_000_000 + 10_000 * index
        built.sample(0, "Q3f", stamp, *rate)
        built.sample(1, "Q3f", stamp, *(-0.1 * rate))
        built.sample(2, "Q3f", stamp, 0.0, 0.0, -thrust)
        built.sample(3, "Q4f", stamp, output, output, output, float("nan"))
    path = tmp_path / "px4.ulg"
    path.write_bytes(bytes(built))
    return fid.inspect_log(Log(path, UlogSource(path)))


def test_motors_that_never_ran_are_told_apart_from_a_flight(tmp_path: Path) -> None:
    bench = px4(tmp_path, output=0.0, thrust=0.0)
    assert "motors-off" in codes(bench, Light.RED)
    assert {e.kind for e in bench.excitations} == {"hand"}
    flight = px4(tmp_path, output=0.4, thrust=0.4)
    assert "motors-off" not in codes(flight, Light.RED)
    assert {"closed-loop", "pilot-only"} <= codes(flight, Light.AMBER)
    action = next(f.action for f in bench.findings if f.code == "motors-off")
    assert action == "arm, fly, and hand in a log of the flight"


def test_command_line_prints_text_or_json_and_leaves_with_the_verdict(tmp_path: Path) -> None:
    path = SweepFlight(airborne=False, sweep_s=5.0, motor_us=1000.0).write(tmp_path)
    text = CliRunner().invoke(command, [str(path)])
    assert text.exit_code == 1
    assert "it can carry no model" in " ".join(text.output.split())
    document = CliRunner().invoke(command, [str(path), "--json"])
    assert json.loads(document.output)["verdict"] == "red"
