"""Which gyroscope signal a controller is fed: before or behind the autopilot's filters."""

from __future__ import annotations

from typing import Literal

Gyro = Literal["raw", "filtered"]
