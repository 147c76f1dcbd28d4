"""Numbers of other projects' formats, told a second time: as their sources count them."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from flightid.conventions import Axis
from flightid.inspection.advice import COPTER_LOG_BITS, PLANE_LOG_BITS
from flightid.inspection.excitation_found import PX4_AUTOTUNE
from flightid.inspection.rate_chirps import INAV_FIELDS
from flightid.logs.blackbox import reader as blackbox
from flightid.logs.blackbox.decoded import WORTH
from flightid.logs.blackbox.stick_rates import AXES as STICKS
from flightid.logs.dataflash.events import COPTER_MODES, ERROR_SUBSYSTEMS, EVENTS, PLANE_MODES
from flightid.logs.dataflash.layout import OWN_DIVISOR
from flightid.logs.dataflash.sdlog2 import TOPICS
from flightid.logs.dataflash.sid_runs import AXES
from flightid.logs.extraction import TURNED
from flightid.logs.mavlink.reader import AUTOPILOTS, SEVERITIES, VEHICLES
from flightid.logs.ulog.names import AIRFRAMES, ARMED, LEVELS, MODES, VEHICLE_TYPES
from flightid.logs.ulog.reader import DEFAULT_KINDS

# A dash: a number that is given out, or was, and that nobody needs in words.
_EVENTS = """
10 armed|disarmed|-|-|-|auto armed|-|landing complete, maybe|landing complete|GPS lost
20 -|flip started|flip ended|-|-|home set|-|-|not landed|-
30 autotune started|autotune off|autotune started again|autotune succeeded|autotune failed
35 autotune reached a limit|autotune's gains tested by the pilot|autotune saved its gains
56 motor interlock disabled|motor interlock enabled
"""
_ERRORS = """
1 main|radio|compass|-|radio failsafe|battery failsafe|-|ground-station failsafe|fence failsafe
10 flight mode|GPS|crash check|flip|-|parachute|EKF check|EKF failsafe|barometer|CPU
20 -|-|-|-|-|thrust loss|-|-|-|vibration failsafe
"""
_COPTER = """
0 STABILIZE|ACRO|ALT_HOLD|AUTO|GUIDED|LOITER|RTL|CIRCLE|mode 8|LAND
10 mode 10|DRIFT|mode 12|SPORT|FLIP|AUTOTUNE|POSHOLD|BRAKE|THROW|AVOID_ADSB
20 GUIDED_NOGPS|SMART_RTL|FLOWHOLD|FOLLOW|ZIGZAG|SYSTEMID|AUTOROTATE|AUTO_RTL|TURTLE
"""
_PLANE = """
0 MANUAL|CIRCLE|STABILIZE|TRAINING|ACRO|FBWA|FBWB|CRUISE|AUTOTUNE|mode 9
10 AUTO|RTL|LOITER|TAKEOFF|AVOID_ADSB|GUIDED|INITIALISING|QSTABILIZE|QHOVER|QLOITER
20 QLAND|QRTL|QAUTOTUNE|QACRO|THERMAL|LOITER_ALT_QLAND
"""
_PX4 = """
0 MANUAL|ALTCTL|POSCTL|AUTO_MISSION|AUTO_LOITER|AUTO_RTL
10 ACRO|-|DESCEND|TERMINATION|OFFBOARD|STAB|-|AUTO_TAKEOFF|AUTO_LAND|AUTO_FOLLOW_TARGET
20 AUTO_PRECLAND|ORBIT
"""
_TYPES = "1 plane|copter|copter|{}|-|-|-|-|-|rover|-|-|copter|copter|copter"
_ARMED = "0 init|disarmed|armed|armed with error|disarmed with error"
_LEVELS = "0 emergency|alert|critical|error|warning|notice|info|debug"
_TABLES = {
    "LogEvent": (_EVENTS, EVENTS),
    "LogErrorSubsystem": (_ERRORS, ERROR_SUBSYSTEMS),
    "Mode::Number of ArduCopter": (_COPTER, COPTER_MODES),
    "Mode::Number of ArduPlane": (_PLANE, PLANE_MODES),
    "nav_state": (_PX4, MODES),
    "arming_state": (_ARMED, ARMED),
    "FLIGHT_LOG_EVENT": ("0 beep\n15 disarmed\n255 end of log", blackbox.EVENTS),
    "boxId of Betaflight": ("1 ANGLE|HORIZON", blackbox.MODES),
    "boxId of INAV": (
        "1 ANGLE|HORIZON|ALTHOLD|-|-|-|-|RTH|POSHOLD|MANUAL\n19 WP",
        blackbox.INAV_MODES,
    ),
    "MAV_AUTOPILOT": ("3 ArduPilot\n12 PX4", AUTOPILOTS),
    "MAV_TYPE": (_TYPES.format("copter") + "\n29 copter", VEHICLES),
    "MAV_TYPE of PX4's airframes": (_TYPES.format("heli"), AIRFRAMES),
    "defaults of a ULog": ("1 system|airframe", DEFAULT_KINDS),
    "syslog": (_LEVELS, LEVELS),
    "MAV_SEVERITY": (_LEVELS, dict(enumerate(SEVERITIES))),
    "vehicle_type": ("1 copter|plane|rover", VEHICLE_TYPES),
    "autotune_attitude_control_status.state": ("2 roll|-|pitch|-|yaw", PX4_AUTOTUNE),
}


def test_words_stand_at_their_numbers() -> None:
    assert {name: table for name, (_, table) in _TABLES.items()} == {
        name: _counted(told) for name, (told, _) in _TABLES.items()
    }


def _counted(told: str) -> Mapping[int, str]:
    """Lines of words, each with the number of its first."""
    lines = [line.split(" ", 1) for line in told.strip().splitlines()]
    words = {
        int(first) + place: word
        for first, line in lines
        for place, word in enumerate(line.split("|"))
    }
    return {number: word for number, word in words.items() if word != "-"}


def test_axes_of_a_sweep_are_those_of_ardupilot() -> None:
    roll, pitch, yaw, heave = Axis.ROLL, Axis.PITCH, Axis.YAW, Axis.HEAVE
    groups = (
        *[("input angle", "deg", (roll, pitch)), ("input rate", "deg/s", (yaw,))],
        *[("recovery angle", "deg", (roll, pitch)), ("recovery rate", "deg/s", (yaw,))],
        *[("rate", "deg/s", (roll, pitch, yaw)), ("mixer", "1", (roll, pitch, yaw, heave))],
        *[(f"measured {side} position", "m", (None,)) for side in ("lateral", "longitudinal")],
        *[
            (f"{point} {side} velocity", "m/s", (None,))
            for point in ("measured", "input")
            for side in ("lateral", "longitudinal")
        ],
    )
    points = [(point, axis, unit) for point, unit, axes in groups for axis in axes]
    assert dict(enumerate(points, 1)) == AXES


def test_storage_of_ardupilot_counts_hundredths_and_ten_millionths_of_degrees() -> None:
    assert {**dict.fromkeys("cCeE", 100), "L": 10**7} == OWN_DIVISOR


def test_sdlog2_logs_sixteen_outputs() -> None:
    topic, fields = TOPICS["OUT0"]
    assert (topic, len(fields), fields["Out15"]) == ("actuator_outputs", 16, ("output[15]", "us"))


def test_bits_of_the_logging_mask_are_those_of_each_vehicle() -> None:
    copter = {"FAST": 0, "MED": 1, "RCOUT": 10, "PID": 12, "IMU_FAST": 18}
    assert list(copter.values()) == list(COPTER_LOG_BITS)
    assert list({"IMU": 7, "RC": 13, "ATTITUDE_FULLRATE": 20}.values()) == list(PLANE_LOG_BITS)


def test_units_of_decoders_count_in_those_of_the_fields() -> None:
    in_si = {"deg/s": np.pi / 180.0, "g": 9.80665, "V": 1.0, "A": 1.0}
    units = {"deg/s": 1.0, "rad/s": 1.0 / in_si["deg/s"], "g": 1.0, "m/s/s": 1.0 / in_si["g"]}
    units |= {"m/s2": units["m/s/s"], "V": 1.0, "mV": 0.001, "A": 1.0, "mA": 0.001}
    assert units == WORTH


def test_fields_are_counted_from_zero() -> None:
    assert list(INAV_FIELDS) == ["debug[0]", "debug[1]", "debug[2]", "debug[3]"]
    assert list(STICKS) == [0, 1, 2]


def test_east_north_up_turns_to_north_east_down() -> None:
    """A vehicle that points east (0 there) has a heading of 90 degrees; nose up stays nose up."""
    east = {name: float(turn(np.array(0.0))) for name, turn in TURNED.items()}
    north = {name: float(turn(np.array(np.pi / 2.0))) for name, turn in TURNED.items()}
    assert east == {"roll": 0.0, "pitch": 0.0, "yaw": np.pi / 2.0}
    assert north == {"roll": np.pi / 2.0, "pitch": -np.pi / 2.0, "yaw": 0.0}
