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


class Light(StrEnum):
    """Verdict against a guideline: meets it, is doubtful, does not meet it, could not be judged."""

    GREEN = "green"
    AMBER = "amber"
    RED = "red"
    UNKNOWN = "unknown"
