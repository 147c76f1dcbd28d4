"""How each autopilot is made to sweep an axis, what a pilot does meanwhile, and when to stop."""

from __future__ import annotations

from typing import Literal

from flightid.errors import UnknownNameError
from flightid.frozen import dataclass
from flightid.planning.flown_axis import Entry

How = Literal["mode", "stick", "autotune", "chirp"]


@dataclass(frozen=True)
class Procedure:
    """A way to sweep.

    Attributes
    ----------
    name, title : str
        For scripts and for people.
    loops : str
        Whose controllers stay on, as `axis_loop` names them; empty: not known here.
    kind : str
        Typical vehicle, of `review.typical_axes.TYPICAL`.
    how : {"mode", "stick", "autotune", "chirp"}
        The autopilot's own sweep, the pilot's stick, the autopilot's tuning, Betaflight's chirp.
    enters : {"mixer", "rate", "angle"}
    suffix : str
        Of the settings' files.
    before, fly, after : tuple of str
        What to do, in the autopilot's own words.
    source : str
    axes : tuple of str
        What can be swept so.
    """

    name: str
    title: str
    loops: str
    kind: str
    how: How
    enters: Entry
    suffix: str
    before: tuple[str, ...]
    fly: tuple[str, ...]
    after: tuple[str, ...]
    source: str
    axes: tuple[str, ...] = ("roll", "pitch", "yaw")

    def entry(self, axis: str) -> Entry:
        """Where the sweep of an axis is added: the yaw stick asks for a rate."""
        return "rate" if self.how == "stick" and axis == "yaw" else self.enters


_SAVE = "Save all parameters of the vehicle to a file first: that is the last way back."
_LOAD = (
    _SAVE,
    "Load the file of the axis, write it, refresh the list, load and write it once more: settings "
    "of the sweep show only after SID_AXIS is set.",
)
_LOAD_PX4 = (_SAVE, "Load the file and restart: SDLOG_PROFILE is read once.")
_AFTER = (
    "Load the rollback file, or what you saved first, and write it: it takes every setting back.",
    "Copy the log, then: flightid tune LOG.",
)
_ONE_FLIGHT = "One axis a flight; load the next axis' file on the ground."
_MODE = (
    "Take off in Stabilize or Acro, climb well clear of ground effect, hover for 10 s hands off.",
    "Switch to SystemID; the sweep starts after 1 s. Keep the vehicle in place with small, slow "
    "stick moves of the other axes.",
    "When the motion has ended, stay 20 s more, then leave the mode; enter it again for the next "
    "run.",
    _ONE_FLIGHT,
)
_STICK = (
    "Hover or fly straight and level at a safe height, hands off for 10 s.",
    "Move the stick of the axis like a sine, slowly first and faster and faster, to the size on "
    "this card; the other sticks stay still.",
    "Then stay hands off for 10 s; repeat with the first move to the other side.",
    "Fly one run of another axis only when the last has come to rest.",
)
PROCEDURES = {
    each.name: each
    for each in (
        Procedure(
            "arducopter", "ArduCopter", "arducopter", "multirotor", "mode", "mixer", ".param",
            _LOAD, _MODE, _AFTER, "ArduCopter, mode_systemid.cpp (4.6)",
        ),
        Procedure(
            "arduheli", "ArduCopter, helicopter", "arduheli", "helicopter", "mode", "mixer",
            ".param", _LOAD, _MODE, _AFTER, "ArduCopter, mode_systemid.cpp (4.6)",
        ),
        Procedure(
            "quadplane", "QuadPlane in hover", "arducopter", "multirotor", "mode", "mixer",
            ".param",
            (
                *_LOAD,
                "Set RCx_OPTION 184 on a switch; the firmware must be built with system "
                "identification for quadplanes (it is not in stable builds).",
            ),
            (
                "Take off in QSTABILIZE or QHOVER, climb well clear of ground effect, hover for "
                "10 s hands off.",
                "Switch system identification on; the sweep starts at once. Keep the vehicle in "
                "place with small, slow moves of the other sticks.",
                "When the motion has ended, stay 20 s more, then switch it off, and on again for "
                "the next run.",
                _ONE_FLIGHT,
            ),
            _AFTER, "ArduPlane, systemid.cpp (4.7 development)",
        ),
        Procedure(
            "arduplane", "ArduPlane", "arduplane", "aeroplane", "stick", "angle", ".param",
            (
                _SAVE,
                "Load the file: it makes the log fast enough. Stable firmware injects no sweep on "
                "fixed wings: fly it by stick in FBWA.",
            ),
            _STICK, _AFTER, "ArduPilot pull request 29608 (fixed-wing sweeps): open",
            ("roll", "pitch"),
        ),
        Procedure(
            "px4_multicopter", "PX4 multicopter", "px4_multicopter", "multirotor", "stick",
            "angle", ".params",
            (
                *_LOAD_PX4,
                "PX4 injects only its autotune's steps on multicopters: fly the sweep by stick in "
                "Stabilized.",
            ),
            _STICK, _AFTER, "PX4, mc_autotune_attitude_control; logged_topics.cpp",
        ),
        Procedure(
            "px4_fixed_wing", "PX4 fixed wing", "px4_fixed_wing", "aeroplane", "autotune", "rate",
            ".params",
            (
                *_LOAD_PX4,
                "Gains that the autotune finds are logged and not applied (FW_AT_APPLY 0).",
            ),
            (
                "Fly straight and level at trim speed in Position or Altitude mode, at a safe "
                "height.",
                "Start autotune from the ground station or switch; it finds its own amplitude, "
                "then sweeps the axes one after the other.",
                "Keep the sticks still: a stick move ends it. Repeat for the second run.",
            ),
            _AFTER, "PX4, fw_autotune_attitude_control",
        ),
        Procedure(
            "betaflight", "Betaflight 2025.12 (4.6) or newer", "", "multirotor", "chirp", "rate",
            ".txt",
            (
                "Save the answer of `diff all` to a file first: it is the way back.",
                "The firmware must be built with CHIRP (custom define USE_CHIRP); paste the file "
                "into the CLI.",
                "Put the CHIRP mode on a switch; feed-forward stays 0 for the sweep.",
            ),
            (
                "Take off in Angle or Acro with room all around, hover for 5 s.",
                "Switch CHIRP on: it sweeps roll; off and on again: pitch; again: yaw. Then once "
                "more round.",
                "Correct slowly with the sticks; land and look at motor heat after the first axis.",
            ),
            (
                "Paste your saved `diff all` into the CLI.",
                "Copy the blackbox log: flightid tune LOG --write gains.txt makes gains of it.",
            ),
            "Betaflight pull request 13105; pichim/bf_controller_tuning",
        ),
        Procedure(
            "inav", "INAV multicopter", "inav", "small multirotor", "stick", "angle", ".txt",
            (
                "Save the answer of `diff all` to a file first: it is the way back.",
                "Paste the file into the CLI: it makes the log fast and takes the control "
                "derivative (mc_cd_…) out of the sweep.",
            ),
            (
                "Take off in ANGLE with room all around, hover for 10 s hands off.",
                *_STICK[1:],
            ),
            (
                "Paste your saved `diff all` into the CLI.",
                "Copy the blackbox log: flightid tune LOG --write gains.txt makes gains of it.",
            ),
            "INAV, blackbox.c; its own chirp is in development (flight/chirp_flight.c)",
        ),
    )
}  # fmt: skip
STOP = (
    "motors scream, get hot or stop",
    "it drifts further than the sticks bring back",
    "it leans more than twice the attitude on this card",
    "the battery warns",
)
"""When to leave the sweep at once."""
_OF_VEHICLE = {
    ("quad", "ardupilot"): "arducopter",
    ("quad", "px4"): "px4_multicopter",
    ("quad", "betaflight"): "betaflight",
    ("quad", "inav"): "inav",
    ("heli", "ardupilot"): "arduheli",
    ("plane", "ardupilot"): "arduplane",
    ("plane", "px4"): "px4_fixed_wing",
    ("quadplane", "ardupilot"): "quadplane",
}


def procedure_of(vehicle: str, autopilot: str) -> Procedure:
    """The way to sweep a kind of vehicle with an autopilot.

    Raises
    ------
    UnknownNameError
        That autopilot does not fly it, or flightid knows no way.

    Example
    -------
    >>> procedure_of("quad", "px4").how
    'stick'
    """
    name = _OF_VEHICLE.get((vehicle, autopilot))
    if name is None:
        raise UnknownNameError(
            "no way to sweep this vehicle is known",
            found=f"{vehicle} with {autopilot}",
            needed="; ".join(f"{v} with {a}" for v, a in _OF_VEHICLE),
        )
    return PROCEDURES[name]
