"""Numbers that autopilots log for events, modes, axes and errors, as their sources number them."""

from __future__ import annotations

from flightid.inspection import actuators, excitation_found, flight_phases
from flightid.inspection.advice import COPTER_LOG_BITS, PLANE_LOG_BITS
from flightid.logs.blackbox import reader as blackbox
from flightid.logs.dataflash.events import COPTER_MODES, ERROR_SUBSYSTEMS, EVENTS, PLANE_MODES
from flightid.logs.dataflash.sid_runs import AXES
from flightid.logs.ulog import names

OF_ARDUPILOT = (  # AP_Logger.h
    "10 armed; 11 disarmed; 15 auto armed; 17 landing complete, maybe; 18 landing complete; "
    "19 GPS lost; 21 flip started; 22 flip ended; 25 home set; 28 not landed; "
    "30 autotune started; 31 autotune off; 32 autotune started again; 33 autotune succeeded; "
    "34 autotune failed; 35 autotune reached a limit; 36 autotune's gains tested by the pilot; "
    "37 autotune saved its gains; 56 motor interlock disabled; 57 motor interlock enabled"
)
ERRORS = (
    "1 main; 2 radio; 3 compass; 5 radio failsafe; 6 battery failsafe; 8 ground-station failsafe; "
    "9 fence failsafe; 10 flight mode; 11 GPS; 12 crash check; 13 flip; 15 parachute; "
    "16 EKF check; 17 EKF failsafe; 18 barometer; 19 CPU; 25 thrust loss; 29 vibration failsafe"
)
OF_PX4 = (  # vehicle_status.msg
    "0 MANUAL; 1 ALTCTL; 2 POSCTL; 3 AUTO_MISSION; 4 AUTO_LOITER; 5 AUTO_RTL; 10 ACRO; "
    "12 DESCEND; 13 TERMINATION; 14 OFFBOARD; 15 STAB; 17 AUTO_TAKEOFF; 18 AUTO_LAND; "
    "19 AUTO_FOLLOW_TARGET; 20 AUTO_PRECLAND; 21 ORBIT"
)
ARMING = "0 init; 1 disarmed; 2 armed; 3 armed with error; 4 disarmed with error"
LEVELS = "0 emergency; 1 alert; 2 critical; 3 error; 4 warning; 5 notice; 6 info; 7 debug"
OF_INAV = "8 RTH; 19 WP; 9 POSHOLD; 10 MANUAL; 1 ANGLE; 2 HORIZON; 3 ALTHOLD"


TABLES: tuple[tuple[dict[int, str], str], ...] = (
    (EVENTS, OF_ARDUPILOT), (ERROR_SUBSYSTEMS, ERRORS), (names.MODES, OF_PX4),
    (names.ARMED, ARMING), (names.LEVELS, LEVELS), (blackbox.INAV_MODES, OF_INAV),
    (names.VEHICLE_TYPES, "1 copter; 2 plane; 3 rover"),
    (blackbox.MODES, "1 ANGLE; 2 HORIZON"),
    (blackbox.EVENTS, "0 beep; 15 disarmed; 255 end of log"),
    (excitation_found.PX4_AUTOTUNE, "2 roll; 4 pitch; 6 yaw"),
)  # fmt: skip


def test_names_stand_at_the_numbers_of_the_source() -> None:
    for table, told in TABLES:
        rows = [row.partition(" ") for row in told.split("; ")]
        assert list(table.items()) == [(int(number), name) for number, _, name in rows]


def test_points_of_injection_are_those_of_the_system_identification_mode() -> None:
    """ArduCopter/mode_systemid.cpp: three axes each of four points, then what a position needs."""
    turned = ("roll", "pitch", "yaw")
    of_rate = [("rate", axis, "deg/s") for axis in turned]
    mixed = [("mixer", axis, "1") for axis in (*turned, "heave")]
    wanted = []
    for name in ("input", "recovery"):
        wanted += [(f"{name} angle", axis, "deg") for axis in turned[:2]]
        wanted.append((f"{name} rate", "yaw", "deg/s"))
    ways = ("lateral", "longitudinal")
    places = [(f"measured {way} position", None, "m") for way in ways]
    speeds = [
        (f"{kind} {way} velocity", None, "m/s") for kind in ("measured", "input") for way in ways
    ]
    found = [(point, axis and axis.value, unit) for point, axis, unit in AXES.values()]
    assert found == [*wanted, *of_rate, *mixed, *places, *speeds]
    assert list(AXES) == list(range(1, 20))


def test_modes_and_bits_that_are_asked_for() -> None:
    copter = {0: "STABILIZE", 5: "LOITER", 9: "LAND", 16: "POSHOLD", 25: "SYSTEMID", 28: "TURTLE"}
    plane = {0: "MANUAL", 5: "FBWA", 10: "AUTO", 15: "GUIDED", 17: "QSTABILIZE", 24: "THERMAL"}
    assert {number: COPTER_MODES[number] for number in copter} == copter
    assert {number: PLANE_MODES[number] for number in plane} == plane
    assert (len(COPTER_MODES), len(PLANE_MODES)) == (29, 26)
    assert list(PLANE_LOG_BITS) == [7, 13, 20]
    assert 0 in COPTER_LOG_BITS
    assert COPTER_LOG_BITS[0].startswith("fast attitude")
    assert (flight_phases.EV_LAND_COMPLETE, flight_phases.EV_NOT_LANDED) == (18, 28)
    assert (blackbox.DISARMED, blackbox.FLIGHT_MODE) == (15, 30)
    assert list(actuators.MOTOR_FUNCTIONS) == [33, 34, 35, 36, 37, 38, 39, 40]
