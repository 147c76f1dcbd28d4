"""Numbers of other projects' formats, told a second time: as their sources count them."""

from __future__ import annotations

from collections.abc import Mapping

from flightid.conventions import Axis
from flightid.inspection.excitation_found import PX4_AUTOTUNE
from flightid.logs.dataflash.events import COPTER_MODES, ERROR_SUBSYSTEMS, EVENTS, PLANE_MODES
from flightid.logs.dataflash.layout import OWN_DIVISOR
from flightid.logs.dataflash.sdlog2 import TOPICS
from flightid.logs.dataflash.sid_runs import AXES
from flightid.logs.mavlink.reader import SEVERITIES
from flightid.logs.ulog.names import ARMED, LEVELS, MODES, VEHICLE_TYPES

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
_ARMED = "0 init|disarmed|armed|armed with error|disarmed with error"
_LEVELS = "0 emergency|alert|critical|error|warning|notice|info|debug"
_TABLES = {
    "LogEvent": (_EVENTS, EVENTS),
    "LogErrorSubsystem": (_ERRORS, ERROR_SUBSYSTEMS),
    "Mode::Number of ArduCopter": (_COPTER, COPTER_MODES),
    "Mode::Number of ArduPlane": (_PLANE, PLANE_MODES),
    "nav_state": (_PX4, MODES),
    "arming_state": (_ARMED, ARMED),
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
