"""Where a vehicle is and which way it points, from what its model tells, for the scenery."""

from __future__ import annotations

import math
from collections.abc import Mapping

from flightid.frozen import dataclass
from flightid.units import conversion_factor, is_convertible

SPEEDS = {"u": ("u", "um"), "v": ("v", "vm"), "w": ("w",)}
"""By body axis the outputs that tell the velocity along it, the first that there is."""
HEIGHT_M = 40.0
"""Of the take-off above the ground of the scenery."""
HIGHEST_M, FARTHEST_M = 5000.0, 1e6


@dataclass(frozen=True)
class Pose:
    """Attitude, rad, and place, m, north and east of the take-off, up from the ground."""

    phi: float = 0.0
    theta: float = 0.0
    psi: float = 0.0
    north_m: float = 0.0
    east_m: float = 0.0
    height_m: float = HEIGHT_M


class GroundTrack:
    """Euler's kinematics of what a model tells; what it does not tell is integrated, or rests.

    An attitude that is an output is taken as it is; else it is the integral of its rate. Velocities
    are along the body's axes. Nothing of it goes back into the model or into the record.

    Parameters
    ----------
    units : mapping of str to str
        By output.
    step_s : float
        s.
    speed_m_s : float
        Forward, beside what outputs tell.

    Example
    -------
    >>> track = GroundTrack({"r": "rad/s"}, 0.001, speed_m_s=10.0)
    >>> pose = [track.moved({"r": 0.5}) for _ in range(2000)][-1]
    >>> round(pose.psi, 6), round(pose.north_m, 1), round(pose.east_m, 1)
    (1.0, 16.8, 9.2)
    """

    def __init__(self, units: Mapping[str, str], step_s: float, *, speed_m_s: float = 0.0) -> None:
        self._step_s, self._speed_m_s = step_s, speed_m_s
        self._read = {
            name: (found, conversion_factor(units[found], unit))
            for name, choices, unit in _WANTED
            if (found := next((each for each in choices if _fits(units, each, unit)), ""))
        }
        self.pose = Pose()

    def moved(self, outputs: Mapping[str, float]) -> Pose:
        """Where it is a frame later."""
        told = {name: outputs[found] * factor for name, (found, factor) in self._read.items()}
        p, q, r = (told.get(name, 0.0) for name in "pqr")
        last, step_s = self.pose, self._step_s
        phi, theta, psi = last.phi, last.theta, last.psi
        turning = (q * math.sin(phi) + r * math.cos(phi)) / max(0.05, math.cos(theta))
        phi = told.get("phi", _wrapped(phi + step_s * (p + turning * math.sin(theta))))
        pitching = q * math.cos(phi) - r * math.sin(phi)
        # A model of the rate alone may loop; a picture of it stops short of the zenith.
        theta = told.get("theta", min(1.5, max(-1.5, theta + step_s * pitching)))
        psi = told.get("psi", _wrapped(psi + step_s * turning))
        north, east, up = _to_earth(
            phi, theta, psi, self._speed_m_s + told.get("u", 0.0), told.get("v", 0.0),
            told.get("w", 0.0),
        )  # fmt: skip
        self.pose = Pose(
            phi, theta, psi,
            _within(last.north_m + step_s * north, -FARTHEST_M, FARTHEST_M),
            _within(last.east_m + step_s * east, -FARTHEST_M, FARTHEST_M),
            _within(last.height_m + step_s * up, 0.0, HIGHEST_M),
        )  # fmt: skip
        return self.pose


_WANTED = (
    *((name, (name,), "rad/s") for name in "pqr"),
    *((name, (name,), "rad") for name in ("phi", "theta", "psi")),
    *((name, choices, "m/s") for name, choices in SPEEDS.items()),
)


def _fits(units: Mapping[str, str], name: str, unit: str) -> bool:
    return name in units and is_convertible(units[name], unit)


def _to_earth(
    phi: float, theta: float, psi: float, u: float, v: float, w: float
) -> tuple[float, float, float]:
    """Velocity to the north, to the east and up."""
    across = v * math.cos(phi) - w * math.sin(phi)
    down = v * math.sin(phi) + w * math.cos(phi)
    ahead = u * math.cos(theta) + down * math.sin(theta)
    return (
        ahead * math.cos(psi) - across * math.sin(psi),
        ahead * math.sin(psi) + across * math.cos(psi),
        u * math.sin(theta) - down * math.cos(theta),
    )


def _wrapped(angle: float) -> float:
    return math.remainder(angle, 2.0 * math.pi)


def _within(value: float, low: float, high: float) -> float:
    return min(high, max(low, value))
