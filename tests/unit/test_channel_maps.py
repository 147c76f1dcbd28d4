"""Channel maps: shipped ones are sound, sources are tried in order, units and signs converted."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import flightid as fid
from flightid.conventions import Role
from flightid.errors import (
    DataError,
    FileFormatError,
    MissingColumnError,
    UnitError,
    UnknownNameError,
)
from flightid.logs import DataflashWriter, channel_map
from flightid.logs.channels.channel_map import DEFAULTS, ChannelSource, default_map
from flightid.logs.dataflash.field_units import UNITS
from flightid.logs.extraction import _euler, _values
from flightid.units import canonical, same_dimension
from tests.closeness import assert_close

TIME_US = np.arange(0, 4_000_000, 20_000)
T = TIME_US / 1e6


def _log(tmp_path: Path, *, vehicle: str = "ArduCopter", **messages: dict[str, object]) -> fid.Log:
    writer = DataflashWriter()
    writer.message(0, f"{vehicle} V4.7.0 (test)")
    for name, columns in messages.items():
        writer.add(name, TIME_US, columns)
    return fid.read_log(writer.write(tmp_path / "log.bin"))


@pytest.mark.parametrize("name", sorted(set(DEFAULTS.values())))
def test_shipped_maps_have_known_units_and_something_to_identify(name: str) -> None:
    mapped = channel_map(name)
    roles = [channel.role for channel in mapped.channels]
    # A ground station is sent no commands to the mixer, a blackbox holds no attitude.
    assert roles.count(Role.INPUT) == (1 if name == "mavlink" else 4)
    assert roles.count(Role.OUTPUT) >= (6 if name in ("mavlink", "betaflight") else 9)
    for channel in mapped.channels:
        assert canonical(channel.unit) == channel.unit
        for source in channel.sources:
            assert source.unit is None or same_dimension(source.unit, channel.unit)


def test_units_of_the_log_are_spelt_canonically() -> None:
    assert {canonical(unit) for unit in UNITS.values()} == set(UNITS.values())


def test_rates_become_radians_and_the_first_source_wins(tmp_path: Path) -> None:
    rate = {"ROut": np.sin(T), "R": np.degrees(np.cos(T))}
    log = _log(tmp_path, RATE=rate, PIDR={"Act": 7.0})
    record = log.record(names=["tau_phi", "p"])
    assert_close(record["p"], np.cos(record.time_s), atol=1e-7, why="single precision, deg to rad")
    assert record.unit("p") == "rad/s"
    assert record.channels["p"].note.startswith("RATE.R:")
    assert (record.inputs, record.outputs) == (("tau_phi",), ("p",))


def test_the_controllers_terms_stand_in_for_a_missing_command(tmp_path: Path) -> None:
    terms = {"P": np.sin(T), "I": 0.5, "D": 0.25, "FF": 0.125, "DFF": 0.0625, "Act": np.cos(T)}
    record = _log(tmp_path, PIDR=terms).record(names=["tau_phi", "p"])
    assert_close(record["tau_phi"], np.sin(record.time_s) + 0.9375, atol=2e-7, why="sum of terms")
    assert_close(record["p"], np.cos(record.time_s), atol=1e-7, why="PIDR is in rad/s already")


def test_headings_are_unwrapped(tmp_path: Path) -> None:
    heading = (350.0 + 10.0 * T) % 360.0
    log = _log(tmp_path, RATE={"ROut": 0.0}, ATT={"Yaw": heading})
    psi = log.record(names=["tau_phi", "psi"])["psi"]
    assert_close(np.diff(psi), np.radians(0.2), rtol=1e-3, why="a steady turn through north")


def test_what_is_missing_is_told_in_the_history(tmp_path: Path) -> None:
    record = _log(tmp_path, RATE={"ROut": np.sin(T), "R": np.cos(T)}).record()
    assert "phi (not logged)" in str(record.history[-1].options["left_out"])
    assert record.outputs == ("p", "q", "r")


def test_a_channel_that_ends_early_does_not_cut_the_record(tmp_path: Path) -> None:
    writer = DataflashWriter()
    writer.message(0, "ArduCopter V4.7.0 (test)")
    writer.add("RATE", TIME_US, {"ROut": np.sin(T), "R": np.cos(T)})
    writer.add("BAT", TIME_US[:50:5], {"Volt": 12.0})
    record = fid.read_log(writer.write(tmp_path / "log.bin")).record()
    assert "battery (does not cover the span)" in str(record.history[-1].options["left_out"])
    assert_close(record.duration_s, 4.0, atol=0.021, why="the whole of RATE")


def test_roles_can_be_changed_and_spans_cut(tmp_path: Path) -> None:
    log = _log(tmp_path, RATE={"ROut": np.sin(T), "R": np.cos(T)})
    record = log.record(names=["tau_phi", "p", "q"], roles={"q": "other"}, span_s=(1.0, 3.0))
    assert record.outputs == ("p",)
    assert_close([record.time_s[0], record.time_s[-1]], [1.0, 3.0], atol=0.021, why="one sample")


def test_a_span_outside_the_log_is_refused(tmp_path: Path) -> None:
    log = _log(tmp_path, RATE={"ROut": np.sin(T), "R": np.cos(T)})
    with pytest.raises(DataError, match="do not cover the span"):
        log.record(names=["tau_phi", "p"], span_s=(1.0, 30.0))
    with pytest.raises(DataError, match="has no samples in the span"):
        log.record(names=["tau_phi", "p"], span_s=(10.0, 30.0))


def test_a_named_channel_that_is_not_logged_is_refused(tmp_path: Path) -> None:
    log = _log(tmp_path, RATE={"ROut": 0.0})
    with pytest.raises(
        MissingColumnError, match=r"does not hold channel 'phi'.*ANG\.Roll or ATT\.Roll"
    ):
        log.record(names=["tau_phi", "phi"])


def test_a_log_without_inputs_makes_no_record(tmp_path: Path) -> None:
    log = _log(tmp_path, ATT={"Roll": 1.0})
    with pytest.raises(MissingColumnError, match="an input and an output"):
        log.record()


def test_a_vehicle_without_a_map_is_refused(tmp_path: Path) -> None:
    log = _log(tmp_path, vehicle="ArduRover", RATE={"ROut": 0.0})
    with pytest.raises(DataError, match="no channel map is known"):
        log.record()
    with pytest.raises(DataError, match="not told"):
        default_map("px4", None)


def test_a_map_of_ones_own_is_read_from_a_file(tmp_path: Path) -> None:
    path = tmp_path / "own.toml"
    path.write_text(
        'title = "own"\nkind = "ardupilot"\nvehicle = "copter"\n'
        '[channels.u]\nunit = "1"\nrole = "input"\n'
        'sources = [{ message = "RATE", field = "ROut", factor = -2.0 }]\n'
        '[channels.y]\nunit = "rad/s"\nrole = "output"\n'
        'sources = [{ message = "RATE", field = "R" }]\n'
    )
    record = _log(tmp_path, RATE={"ROut": np.sin(T), "R": np.degrees(T)}).record(path)
    assert_close(record["u"], -2 * np.sin(record.time_s), atol=2e-7, why="the map's factor")
    assert_close(record["y"], record.time_s, atol=4e-7, why="deg/s to rad/s")


def test_a_unit_of_another_dimension_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "own.toml"
    path.write_text(
        'title = "own"\nkind = "ardupilot"\nvehicle = "copter"\n[channels.v]\nunit = "m/s"\n'
        'role = "output"\nsources = [{ message = "RATE", field = "R" }]\n'
    )
    log = _log(tmp_path, RATE={"R": 0.0})
    with pytest.raises(UnitError, match="another dimension in the log"):
        log.record(path, names=["v"])


@pytest.mark.parametrize(
    "text",
    [
        "not toml",
        'title = "x"\nkind = "a"\nvehicle = "b"\n[channels.p]\nunit = "1"\nrole = "pilot"\n'
        "sources = []\n",
        'title = "x"\nkind = "a"\nvehicle = "b"\n[channels.p]\nunit = "1"\nrole = "input"\n'
        'sources = [{ message = "A", field = "B", sing = -1 }]\n',
    ],
)
def test_a_file_that_is_no_map_is_refused(tmp_path: Path, text: str) -> None:
    path = tmp_path / "bad.toml"
    path.write_text(text)
    with pytest.raises(FileFormatError, match=r"(is not|a) channel map"):
        channel_map(path)


def test_unknown_names_are_refused() -> None:
    with pytest.raises(UnknownNameError, match="no such channel map"):
        channel_map("arduboat")
    with pytest.raises(UnknownNameError, match="has no such channel"):
        channel_map("arducopter")["flap"]
    with pytest.raises(UnknownNameError, match="has no such channel"):
        channel_map("arducopter").with_roles({"flap": "input"})


def test_quaternions_become_euler_angles(shared_data: Path) -> None:
    log = fid.read_log(shared_data / "logs" / "px4_quad_2016.ulg")
    record = log.record(span_s=(115.0, 150.0))
    # The estimator's roll is in control_state too, as another quaternion: compare through the rate.
    rate = np.gradient(record["theta"], record.sample_time_s)
    kinematic = record["q"] * np.cos(record["phi"]) - record["r"] * np.sin(record["phi"])
    assert np.corrcoef(rate, kinematic)[0, 1] > 0.97
    assert record.inputs == ("tau_phi", "tau_theta", "tau_psi", "thrust")
    assert np.mean(record["az"]) == pytest.approx(-9.8, abs=0.6)


def test_euler_angles_come_back_from_large_turns() -> None:
    """A quaternion of three turns one after the other, z-y-x, multiplied out."""
    angles = {"roll": 2.1, "pitch": -1.2, "yaw": -2.6}
    turned = np.array([1.0, 0.0, 0.0, 0.0])
    for place, name in ((3, "yaw"), (2, "pitch"), (1, "roll")):
        half = 0.5 * angles[name]
        step = np.zeros(4)
        step[[0, place]] = np.cos(half), np.sin(half)
        turned = np.concatenate(
            (
                [turned[0] * step[0] - turned[1:] @ step[1:]],
                turned[0] * step[1:] + step[0] * turned[1:] + np.cross(turned[1:], step[1:]),
            )
        )
    for name, angle in angles.items():
        assert_close(_euler(name, *turned), angle, rtol=1e-12, why="the turn that was made")


def test_whole_numbers_are_cut_only_where_the_map_says_so(tmp_path: Path) -> None:
    rates = np.round(100.0 * np.sin(T))
    table = _log(tmp_path, RATE={"R": rates}).table("RATE")
    assert np.array_equal(_values(table, ChannelSource("RATE", ("R",))), rates)
    cut = _values(table, ChannelSource("RATE", ("R",), cut=True))
    assert np.array_equal(cut, rates + 0.5 * np.sign(rates))


def test_the_real_copter_gives_a_record_at_its_slow_rate(shared_data: Path) -> None:
    record = fid.read_log(shared_data / "logs" / "arducopter_457.BIN").record()
    assert_close(record.sample_rate_hz, 10.0, rtol=1e-3, why="PIDR is logged at 10 Hz")
    assert "an injected signal is not in it" in record.channels["tau_phi"].note


def test_an_edited_map_is_read_anew(tmp_path: Path) -> None:
    path = tmp_path / "own.toml"
    for title in ("first", "second"):
        path.write_text(f'title = "{title}"\nkind = "px4"\nvehicle = "copter"\n[channels]\n')
        assert channel_map(path).title == title
