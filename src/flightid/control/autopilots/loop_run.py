"""What a controller's recursion starts from, looks at, and computes."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import ArrayLike, NDArray

from flightid.errors import DataError, ShapeError
from flightid.frozen import dataclass

Samples = NDArray[np.float64]


@dataclass(frozen=True)
class LoopState:
    """State of a controller after a loop, in the units of its inside.

    Attributes
    ----------
    target, error : float
        Filtered target and error, rad/s (planes: times the square of the airspeed scaling).
    derivative : float
        Filtered derivative of the error, rad/s² (PX4 does not keep it).
    integrator : float
        Integrator.
    rate : float
        Filtered rate, rad/s, which PX4's old controller differences.
    """

    target: float = 0.0
    error: float = 0.0
    derivative: float = 0.0
    integrator: float = 0.0
    rate: float = 0.0


@dataclass(frozen=True)
class LoopFlags:
    """What else than set-point and rate a loop looks at; left out: false, and full thrust.

    Attributes
    ----------
    limited : ndarray of bool, shape (n,) or (n, 2)
        The actuators cannot give more: in both directions, or (PX4) upwards and downwards.
    landed : ndarray of bool, shape (n,)
        On the ground; PX4 then does not integrate.
    thrust : ndarray, shape (n,)
        Thrust set-point 0…1; PX4's controller until 2017 integrates only with thrust.
    acceleration : ndarray, shape (n,)
        Filtered angular acceleration, rad/s², as PX4 logs it; left out: made from the rate.
    start : LoopState
        State of the loop before the first sample; left out: at rest.
    """

    limited: NDArray[np.bool_] | None = None
    landed: NDArray[np.bool_] | None = None
    thrust: Samples | None = None
    acceleration: Samples | None = None
    start: LoopState | None = None


@dataclass(frozen=True)
class LoopRun:
    """What a controller computed from set-point and rate.

    Attributes
    ----------
    output : ndarray, shape (n,)
        Sum of all terms, in `AxisLoop.output_unit`.
    terms : mapping of str to ndarray
        ``P``, ``I``, ``D``, ``FF`` and what else the autopilot has, under its log's names.
    rate : ndarray, shape (n,)
        Filtered rate that the controller took, rad/s.
    """

    output: Samples
    terms: Mapping[str, Samples]
    rate: Samples

    def __repr__(self) -> str:
        """Length and terms on one line."""
        return f"LoopRun({self.output.size} loops, terms {', '.join(self.terms)})"


def samples(setpoint: ArrayLike, rate: ArrayLike, per_loop: int) -> tuple[Samples, Samples]:
    """Contiguous arrays of set-points and rates whose lengths agree."""
    first = np.ascontiguousarray(setpoint, dtype=np.float64)
    second = np.ascontiguousarray(rate, dtype=np.float64)
    if first.ndim != 1 or second.shape != (first.size * per_loop,):
        raise ShapeError(
            "set-points and rates do not belong together",
            found=f"{first.shape} and {second.shape}",
            needed=f"{per_loop} rates for each set-point",
        )
    if not (np.isfinite(first).all() and np.isfinite(second).all()):
        raise DataError("set-point or rate holds a value that is not finite")
    return first, second
