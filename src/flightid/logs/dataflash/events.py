"""ArduPilot's numbers for modes, events and errors, in words.

Sources: ArduCopter/mode.h and ArduPlane/mode.h (mode numbers), AP_Logger/AP_Logger.h (LogEvent,
LogErrorSubsystem). A number that is not listed is shown as a number.
"""

from __future__ import annotations

COPTER_MODES = dict(
    enumerate(
        (
            *("STABILIZE", "ACRO", "ALT_HOLD", "AUTO", "GUIDED", "LOITER", "RTL", "CIRCLE"),
            *("mode 8", "LAND", "mode 10", "DRIFT", "mode 12", "SPORT", "FLIP", "AUTOTUNE"),
            *("POSHOLD", "BRAKE", "THROW", "AVOID_ADSB", "GUIDED_NOGPS", "SMART_RTL", "FLOWHOLD"),
            *("FOLLOW", "ZIGZAG", "SYSTEMID", "AUTOROTATE", "AUTO_RTL", "TURTLE"),
        )
    )
)
PLANE_MODES = dict(
    enumerate(
        (
            *("MANUAL", "CIRCLE", "STABILIZE", "TRAINING", "ACRO", "FBWA", "FBWB", "CRUISE"),
            *("AUTOTUNE", "mode 9", "AUTO", "RTL", "LOITER", "TAKEOFF", "AVOID_ADSB", "GUIDED"),
            *("INITIALISING", "QSTABILIZE", "QHOVER", "QLOITER", "QLAND", "QRTL", "QAUTOTUNE"),
            *("QACRO", "THERMAL", "LOITER_ALT_QLAND"),
        )
    )
)
MODES = {"copter": COPTER_MODES, "plane": PLANE_MODES}

EVENTS = {
    10: "armed",
    11: "disarmed",
    15: "auto armed",
    17: "landing complete, maybe",
    18: "landing complete",
    19: "GPS lost",
    21: "flip started",
    22: "flip ended",
    25: "home set",
    28: "not landed",
    30: "autotune started",
    31: "autotune off",
    32: "autotune started again",
    33: "autotune succeeded",
    34: "autotune failed",
    35: "autotune reached a limit",
    36: "autotune's gains tested by the pilot",
    37: "autotune saved its gains",
    56: "motor interlock disabled",
    57: "motor interlock enabled",
}

ERROR_SUBSYSTEMS = {
    1: "main",
    2: "radio",
    3: "compass",
    5: "radio failsafe",
    6: "battery failsafe",
    8: "ground-station failsafe",
    9: "fence failsafe",
    10: "flight mode",
    11: "GPS",
    12: "crash check",
    13: "flip",
    15: "parachute",
    16: "EKF check",
    17: "EKF failsafe",
    18: "barometer",
    19: "CPU",
    25: "thrust loss",
    29: "vibration failsafe",
}

_VEHICLES = {
    "copter": "copter",
    "plane": "plane",
    "rover": "rover",
    "sub": "sub",
    "tracker": "tracker",
    "blimp": "blimp",
    "heli": "copter",
}


def vehicle_of(firmware: str) -> str | None:
    """Vehicle that a version text names.

    Example
    -------
    >>> vehicle_of("ArduCopter V4.5.7 (2a3dc4b7)"), vehicle_of("ChibiOS: 6a85082c")
    ('copter', None)
    """
    name = firmware.split(" V", maxsplit=1)[0].lower()
    return next((vehicle for word, vehicle in _VEHICLES.items() if word in name), None)


def mode_text(vehicle: str | None, number: int, reason: int | None) -> str:
    """Mode in words with its number.

    Example
    -------
    >>> mode_text("copter", 25, 1), mode_text(None, 3, None)
    ('SYSTEMID (mode 25, reason 1)', 'mode 3')
    """
    name = MODES.get(vehicle or "", {}).get(number)
    why = "" if reason is None else f", reason {reason}"
    return f"mode {number}{why}" if name is None else f"{name} (mode {number}{why})"


def event_text(number: int) -> str:
    """Event in words with its number.

    Example
    -------
    >>> event_text(10), event_text(200)
    ('armed (event 10)', 'event 200')
    """
    return f"{EVENTS[number]} (event {number})" if number in EVENTS else f"event {number}"


def error_text(subsystem: int, code: int) -> str:
    """Error in words; code 0 means that it is over.

    Example
    -------
    >>> error_text(12, 1), error_text(6, 0)
    ('crash check, code 1', 'battery failsafe, resolved')
    """
    name = ERROR_SUBSYSTEMS.get(subsystem, f"subsystem {subsystem}")
    return f"{name}, resolved" if code == 0 else f"{name}, code {code}"
