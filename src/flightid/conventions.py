"""Physical choices as enumerations, and constants with their source (see CONVENTIONS.md)."""

from __future__ import annotations

from enum import StrEnum

STANDARD_GRAVITY_M_S2 = 9.80665
"""Standard acceleration of gravity, m/s² (ISO 80000-3)."""


class Role(StrEnum):
    """What a channel is to the system that is identified.

    `EXCITATION` is an injected signal that is independent of the noise (a chirp from the
    autopilot): the instrument of closed-loop estimates.
    """

    INPUT = "input"
    OUTPUT = "output"
    EXCITATION = "excitation"
    OTHER = "other"


class Axis(StrEnum):
    """Body axes of an aircraft: x forward, y right, z down; p, q, r positive by the right hand."""

    ROLL = "roll"
    PITCH = "pitch"
    YAW = "yaw"
    HEAVE = "heave"


class AxisConversion(StrEnum):
    """Conversions of vectors between axes.

    Body: FRD is forward, right, down (flightid's own); FLU is forward, left, up (ROS). Ground: NED
    is north, east, down; ENU is east, north, up.

    Example
    -------
    >>> AxisConversion("enu-to-ned")
    <AxisConversion.ENU_TO_NED: 'enu-to-ned'>
    """

    FLU_TO_FRD = "flu-to-frd"
    FRD_TO_FLU = "frd-to-flu"
    ENU_TO_NED = "enu-to-ned"
    NED_TO_ENU = "ned-to-enu"


_BODY = ((0, 1), (1, -1), (2, -1))
_GROUND = ((1, 1), (0, 1), (2, -1))
COMPONENTS = {
    AxisConversion.FLU_TO_FRD: _BODY,
    AxisConversion.FRD_TO_FLU: _BODY,
    AxisConversion.ENU_TO_NED: _GROUND,
    AxisConversion.NED_TO_ENU: _GROUND,
}
"""New component i is the sign times the old component at the index."""


class Light(StrEnum):
    """Verdict against a guideline: meets it, is doubtful, does not meet it, could not be judged."""

    GREEN = "green"
    AMBER = "amber"
    RED = "red"
    UNKNOWN = "unknown"

    @property
    def words(self) -> str:
        """What people read: ``"not judged"`` where scripts read ``"unknown"``."""
        return "not judged" if self is Light.UNKNOWN else self.value
