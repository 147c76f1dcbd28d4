"""Bags of what an autopilot publishes in ROS: the channels of its own log, in the same axes."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pytest

import flightid as fid
from flightid.cli.program import run
from flightid.errors import FileFormatError
from flightid.inspection.signals import find
from flightid.logs import is_log
from flightid.logs.ros.names import published
from flightid.logs.ros.reader import _findings
from flightid.record.formats.ros import read_columns
from tests.closeness import assert_close
from tests.ulog_builder import UlogBuilder

rosbag2 = pytest.importorskip("rosbags.rosbag2")
typesys = pytest.importorskip("rosbags.typesys")

RATE_HZ, N, BOOT_US = 100, 3600, 12_000_000
STAMPS_US = BOOT_US + 10_000 * np.arange(N)
VECTOR = "uint64 timestamp\nuint64 timestamp_sample\nfloat32[3] xyz\n"
DEFINITIONS = {
    "px4_msgs/msg/VehicleAngularVelocity": VECTOR,
    "px4_msgs/msg/VehicleTorqueSetpoint": VECTOR,
    "px4_msgs/msg/VehicleThrustSetpoint": VECTOR,
    "px4_msgs/msg/VehicleRatesSetpoint": "uint64 timestamp\nfloat32 roll\nfloat32 pitch\n"
    "float32 yaw\n",
    "px4_msgs/msg/VehicleAttitude": "uint64 timestamp\nuint64 timestamp_sample\nfloat32[4] q\n",
    "px4_msgs/msg/VehicleStatus": "uint64 timestamp\nuint8 vehicle_type\nuint8 nav_state\n"
    "uint8 arming_state\n",
    "mavros_msgs/msg/ActuatorControl": "std_msgs/Header header\nuint8 group_mix\n"
    "float32[8] controls\n",
    "mavros_msgs/msg/AttitudeTarget": "std_msgs/Header header\nuint8 type_mask\n"
    "geometry_msgs/Quaternion orientation\ngeometry_msgs/Vector3 body_rate\nfloat32 thrust\n",
}


def _signals() -> dict[str, np.ndarray]:
    """Rates, commands, set-points (n, 3) and thrust of a flight with a sweep about each axis."""
    rng = np.random.default_rng(4)
    time_s = np.arange(N) / RATE_HZ
    sweep = np.sin(2 * np.pi * (0.3 * time_s + 0.08 * time_s**2))
    wanted = np.stack([0.8 * sweep, 0.6 * np.roll(sweep, 700), 0.4 * np.roll(sweep, 1500)], axis=1)
    command = 0.1 * wanted + 0.01 * rng.standard_normal((N, 3))
    rate = 7.0 * np.apply_along_axis(
        lambda x: np.convolve(x, 0.2 * 0.8 ** np.arange(30))[:N], 0, command
    )
    return {"rate": rate, "command": command, "wanted": wanted, "thrust": np.full(N, 0.5)}


def _attitude() -> np.ndarray:
    """Scalar first, aircraft's axes to north, east, down: roll 10, pitch −5, yaw 40 deg."""
    roll, pitch, yaw = 0.5 * np.radians([10.0, -5.0, 40.0])
    c, s = np.cos, np.sin
    return np.array(
        [
            c(roll) * c(pitch) * c(yaw) + s(roll) * s(pitch) * s(yaw),
            s(roll) * c(pitch) * c(yaw) - c(roll) * s(pitch) * s(yaw),
            c(roll) * s(pitch) * c(yaw) + s(roll) * c(pitch) * s(yaw),
            c(roll) * c(pitch) * s(yaw) - s(roll) * s(pitch) * c(yaw),
        ]
    )


def _write(
    path: Path,
    topics: Mapping[str, tuple[str, list[object]]],
    store: object,
    plugin: object = None,
) -> Path:
    """A bag by rosbags' own writer: topic to type and messages at 100 Hz."""
    storage = plugin or rosbag2.StoragePlugin.MCAP
    with rosbag2.Writer(path, version=9, storage_plugin=storage) as writer:
        for topic, (kind, messages) in topics.items():
            known = writer.add_connection(topic, kind, typestore=store)
            for k, message in enumerate(messages):
                at = 1_700_000_000_000_000_000 + 10_000_000 * k + 2_000_000
                writer.write(known, at, store.serialize_cdr(message, kind))
    return path


def _store() -> object:
    store = typesys.get_typestore(typesys.Stores.ROS2_HUMBLE)
    for name, text in DEFINITIONS.items():
        store.register(typesys.get_types_from_msg(text, name))
    return store


def _px4_bag(path: Path, *, ahead_us: int = 0, plugin: object = None) -> Path:
    signals, store = _signals(), _store()
    t = store.types
    stamps = (STAMPS_US + ahead_us).tolist()

    def vectors(kind: str, values: np.ndarray) -> list[object]:
        made = t[f"px4_msgs/msg/{kind}"]
        return [
            made(at, at - 1500, row.astype(np.float32))
            for at, row in zip(stamps, values, strict=True)
        ]

    thrust = np.column_stack([np.zeros((N, 2)), -signals["thrust"]])
    rates = t["px4_msgs/msg/VehicleRatesSetpoint"]
    attitude, q = t["px4_msgs/msg/VehicleAttitude"], _attitude().astype(np.float32)
    status = t["px4_msgs/msg/VehicleStatus"]
    out = "/fmu/out/"
    topics = {
        "vehicle_angular_velocity": vectors("VehicleAngularVelocity", signals["rate"]),
        "vehicle_torque_setpoint": vectors("VehicleTorqueSetpoint", signals["command"]),
        "vehicle_thrust_setpoint": vectors("VehicleThrustSetpoint", thrust),
        "vehicle_rates_setpoint": [
            rates(at, *map(float, row)) for at, row in zip(stamps, signals["wanted"], strict=True)
        ],
        "vehicle_attitude": [attitude(at, at - 1500, q) for at in stamps],
        "vehicle_status_v1": [status(at, 1, 15, 2) for at in stamps[::10]],
    }
    kinds = {name: type(each[0]).__msgtype__ for name, each in topics.items()}
    written = {out + name: (kinds[name], each) for name, each in topics.items()}
    # What a companion asks for is not what the autopilot does.
    asked = [rates(at, 9.0, 9.0, 9.0) for at in stamps]
    written["/fmu/in/vehicle_rates_setpoint"] = (kinds["vehicle_rates_setpoint"], asked)
    return _write(path, written, store, plugin)


def _ulog(path: Path) -> Path:
    signals, builder = _signals(), UlogBuilder()
    both, wanted = "uint64_t timestamp;uint64_t timestamp_sample;", "uint64_t timestamp;"
    thrust = np.column_stack([np.zeros((N, 2)), -signals["thrust"]])
    q = np.tile(_attitude(), (N, 1))
    tables = {
        "vehicle_angular_velocity": (both + "float[3] xyz;", "QQ3f", signals["rate"]),
        "vehicle_torque_setpoint": (both + "float[3] xyz;", "QQ3f", signals["command"]),
        "vehicle_thrust_setpoint": (both + "float[3] xyz;", "QQ3f", thrust),
        "vehicle_rates_setpoint": (
            wanted + "float roll;float pitch;float yaw;", "Q3f", signals["wanted"],
        ),
        "vehicle_attitude": (both + "float[4] q;", "QQ4f", q),
        "vehicle_status": (
            wanted + "uint8_t vehicle_type;uint8_t nav_state;uint8_t arming_state;", "Q3B",
            np.tile([1, 15, 2], (N, 1)),
        ),
    }  # fmt: skip
    for name, (fields, _, _) in tables.items():
        builder.format(f"{name}:{fields}")
    for number, name in enumerate(tables):
        builder.announce(name, number)
    for number, (_, layout, values) in enumerate(tables.values()):
        every = 10 if layout == "Q3B" else 1
        for at, row in zip(STAMPS_US[::every].tolist(), values[::every].tolist(), strict=True):
            head = (at, at - 1500) if layout.startswith("QQ") else (at,)
            builder.sample(number, layout, *head, *row)
    path.write_bytes(bytes(builder))
    return path


@pytest.fixture(scope="module")
def bag(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return _px4_bag(tmp_path_factory.mktemp("bags") / "flight")


def test_a_bag_of_px4_is_the_log_that_px4_writes(bag: Path, tmp_path: Path) -> None:
    assert is_log(bag)
    log, own = fid.read_log(bag), fid.read_log(_ulog(tmp_path / "flight.ulg"))
    assert (log.kind, log.vehicle) == (own.kind, own.vehicle) == ("px4", "copter")
    assert [e.text for e in log.events] == [e.text for e in own.events] == ["STAB", "armed"]
    assert set(log.messages) == set(own.messages)
    first, second = log.record(), own.record()
    assert list(first.channels) == list(second.channels)
    for name in second.channels:
        # Stamps of other seconds round otherwise where a channel is put on the base of another.
        assert_close(first[name], second[name], why="the same numbers", atol=1e-7)
        assert first.unit(name) == second.unit(name)
    # PX4's own stamps, of when the sensor was read where it says so; whole seconds are the origin.
    assert_close(first.time_s, second.time_s - 12.0, why="the same instants", atol=1e-9)
    told = fid.inspect_log(log), fid.inspect_log(own)
    assert [e.kind for e in told[0].excitations] == [e.kind for e in told[1].excitations]
    for ours, theirs in zip(told[0].bands, told[1].bands, strict=True):
        assert ours.band_rad_s == pytest.approx(theirs.band_rad_s)
    assert {f.code for f in log.findings} == {"no-parameters"}


def test_stamps_of_another_clock_are_not_taken_for_when_a_sensor_was_read(tmp_path: Path) -> None:
    """PX4 moves stamps onto the companion's clock; a few versions leave the sampled ones."""
    store, kind = _store(), "px4_msgs/msg/VehicleAngularVelocity"
    message, ahead, ones = store.types[kind], 1_700_000_000_000_000, np.ones(3, np.float32)
    made = [message(at + ahead, at, ones) for at in STAMPS_US[:50].tolist()]
    topics = {"/px4_1/fmu/out/vehicle_angular_velocity": (kind, made)}
    path = _write(tmp_path / "a", topics, store, rosbag2.StoragePlugin.SQLITE3)
    table = fid.read_log(path).table("vehicle_angular_velocity")
    assert "timestamp_sample" not in table
    assert_close(table.time_s[[0, -1]], [0.0, 0.49], why="whole seconds are the origin", atol=1e-6)


def test_commands_work_on_a_bag_and_columns_stay_to_be_had(
    bag: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(["inspect", str(bag)]) == 0
    said = capsys.readouterr().out
    assert "PX4 (bag of ROS 2)" in said
    assert "vehicle_torque_setpoint.xyz[0]" in said
    assert run(["flight", str(bag)]) in (0, 1)
    assert "roll rate" in capsys.readouterr().out
    assert "/fmu/out/vehicle_rates_setpoint/roll" in read_columns(bag).lengths


def _mavros_bag(path: Path) -> Path:
    """As MAVROS turns it: y and z of the body change sign; the earth is east, north, up."""
    signals, store = _signals(), _store()
    t = store.types
    w, x, y, z = _attitude()
    half = np.sqrt(0.5)
    # q_ENU_NED · q · q_FRD_FLU, both turns by 180 deg.
    turned = _product(_product(np.array([0.0, half, half, 0.0]), np.array([w, x, y, z])),
                      np.array([0.0, 1.0, 0.0, 0.0]))  # fmt: skip
    quaternion = t["geometry_msgs/msg/Quaternion"](
        x=turned[1], y=turned[2], z=turned[3], w=turned[0]
    )
    vector, header = t["geometry_msgs/msg/Vector3"], t["std_msgs/msg/Header"]
    flip, nine = np.array([1.0, -1.0, -1.0]), np.zeros(9)
    imu, control, target = [], [], []
    for k in range(N):
        stamp = t["builtin_interfaces/msg/Time"](1_700_000_000 + k // 100, 10_000_000 * (k % 100))
        head = header(stamp=stamp, frame_id="base_link")
        rate, ask = (vector(*(flip * signals[n][k])) for n in ("rate", "wanted"))
        force = vector(0.0, 0.0, 9.8)
        imu.append(t["sensor_msgs/msg/Imu"](head, quaternion, nine, rate, nine, force, nine))
        both = np.concatenate([signals["command"][k], [0.5], np.zeros(4)]).astype(np.float32)
        control.append(t["mavros_msgs/msg/ActuatorControl"](head, 0, both))
        target.append(t["mavros_msgs/msg/AttitudeTarget"](head, 0, quaternion, ask, 0.5))
    topics = {
        "/uav1/mavros/imu/data": ("sensor_msgs/msg/Imu", imu),
        "/uav1/mavros/target_actuator_control": ("mavros_msgs/msg/ActuatorControl", control),
        "/uav1/mavros/setpoint_raw/target_attitude": ("mavros_msgs/msg/AttitudeTarget", target),
    }
    return _write(path, topics, store)


def _product(p: np.ndarray, q: np.ndarray) -> np.ndarray:
    """Of quaternions, scalar first."""
    vector = p[0] * q[1:] + q[0] * p[1:] + np.cross(p[1:], q[1:])
    return np.concatenate([[p[0] * q[0] - p[1:] @ q[1:]], vector])


def test_mavros_is_turned_into_the_axes_of_an_aircraft(tmp_path: Path) -> None:
    log, signals = fid.read_log(_mavros_bag(tmp_path / "flight")), _signals()
    assert (log.kind, log.vehicle) == ("mavros", None)
    record = log.record()
    for place, (rate, command, wanted) in enumerate(
        (("p", "tau_phi", "p_ref"), ("q", "tau_theta", "q_ref"), ("r", "tau_psi", "r_ref"))
    ):
        for name, key in ((rate, "rate"), (command, "command"), (wanted, "wanted")):
            assert_close(record[name], signals[key][:, place], why="single", atol=1e-6)
    for name, angle in (("phi", 10.0), ("theta", -5.0), ("psi", 40.0)):
        assert_close(np.degrees(record[name]), np.full(N, angle), why="as built", atol=1e-6)
    assert_close(record["az"], np.full(N, -9.8), why="level and at rest", rtol=1e-12)
    assert find(log, "thrust") is not None
    assert any(e.axis == "roll" for e in fid.inspect_log(log).excitations)


@pytest.mark.parametrize(
    ("topic", "kind", "message"),
    [
        ("/fmu/out/vehicle_status_v1", "px4_msgs/VehicleStatus", "vehicle_status"),
        ("/drone/fmu/in/actuator_motors", "px4_msgs/ActuatorMotors", "actuator_motors"),
        ("/renamed/vehicle_attitude", "px4_msgs/VehicleAttitude", "vehicle_attitude"),
        ("/mavros/imu/data", "sensor_msgs/Imu", "imu/data"),
        ("/mavros/rc/in", "mavros_msgs/RCIn", None),
        ("/imu/data", "sensor_msgs/Imu", None),
    ],
)
def test_topics_have_the_names_of_the_log(topic: str, kind: str, message: str | None) -> None:
    found = published(topic, kind)
    assert (None if found is None else found.message) == message


def test_a_bag_without_numbers_of_an_autopilot_is_refused(tmp_path: Path) -> None:
    store = _store()
    words = store.types["std_msgs/msg/String"]
    topics = {"/mavros/imu/data_raw": ("std_msgs/msg/String", [words("px4_msgs/")] * 3)}
    with pytest.raises(FileFormatError, match="no topic of an autopilot with numbers"):
        fid.read_log(_write(tmp_path / "a", topics, store))


def test_of_topics_that_are_left_out_six_are_named() -> None:
    for count, end in ((6, "; t5"), (8, "; t5; and 2 more")):
        said, _ = _findings([f"t{k}" for k in range(count)], {("px4", ""): 1}, "")
        assert said.message.startswith("t0; t1; ")
        assert said.message.endswith(end)
