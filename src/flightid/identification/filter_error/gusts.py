"""Gust states: turbulence with a memory, which a vehicle feels as it feels its own velocity.

White noise on state derivatives has no memory; a gust has, L / V seconds of it, and drives all
equations at once by the same derivatives as the state whose velocity it adds to. Innovations that
stay coloured under white noise are offered such a state for each candidate, and the likelihood
decides.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from flightid.frozen import dataclass
from flightid.identification.filter_error.steady_filter import ContinuousPoint
from flightid.identification.records.held_model import LinearPoint

Array = NDArray[np.float64]
GUST_UNKNOWNS = 2
"""Logarithms of its deviation and its time."""
GUST_REACH = 6.0
GUST = "gust"
"""Name of its state among those of a fitted record."""


@dataclass(frozen=True)
class Gust:
    """A first-order gust g on one state x: ġ = −g/T + √(2/T) σ n, felt wherever x is felt.

    Its two unknowns are the logarithms of σ and T over their scales, the last of all unknowns.

    Attributes
    ----------
    state : int
        Index of the state that it adds to.
    driven : ndarray of bool, shape (n_states,)
        Equations that feel it: those whose derivative by the state is a parameter. Kinematics,
        whose coefficients are known numbers, do not.
    seen : ndarray of bool, shape (n_outputs,)
        Outputs that feel it, such as accelerations; also those that show the state itself where
        they are measured in moving air (a vane).
    deviation_scale : float
        First guess of σ, in the unit of the state.
    time_scale_s : float
        First guess of T, s.

    Reference
    ---------
    MIL-F-8785C, §3.7.2: Dryden's spectra; their vertical form is taken by its first-order part.
    Jategaonkar, *Flight Vehicle System Identification*, 2nd ed., §5.7.
    """

    state: int
    driven: NDArray[np.bool_]
    seen: NDArray[np.bool_]
    deviation_scale: float
    time_scale_s: float

    def size(self, logs: Array) -> tuple[float, float]:
        """Deviation σ and time T, s, at both unknowns."""
        deviation, time = np.exp(logs)
        return self.deviation_scale * float(deviation), self.time_scale_s * float(time)

    def added(self, point: LinearPoint, logs: Array) -> LinearPoint:
        """The model with the gust as its last state."""
        _, time_s = self.size(logs)
        count, n, _ = point.a.shape
        a = np.zeros((count, n + 1, n + 1))
        a[:, :n, :n] = point.a
        a[:, :n, n] = point.a[:, :, self.state] * self.driven
        a[0, n, n] = -1.0 / time_s
        b = np.concatenate([point.b, np.zeros((count, 1, point.b.shape[2]))], axis=1)
        felt = (point.c[:, :, self.state] * self.seen)[:, :, None]
        c = np.concatenate([point.c, felt], axis=2)
        return LinearPoint(a, b, np.ascontiguousarray(c), point.d, point.delays_s)

    def process(self, white: Array, logs: Array) -> Array:
        """Densities of all states, the gust's last."""
        deviation, time_s = self.size(logs)
        return np.append(white, 2.0 * deviation**2 / time_s)

    def slopes(self, point: ContinuousPoint) -> tuple[ContinuousPoint, ContinuousPoint]:
        """Derivatives by the logarithms of σ and T."""
        n = len(point.a)
        none_a, none_c = np.zeros((n, n)), np.zeros_like(point.c)
        none_r = np.zeros_like(point.measurement)
        wider, longer = none_a.copy(), none_a.copy()
        wider[-1, -1] = 2.0 * point.process[-1, -1]
        longer[-1, -1] = -point.a[-1, -1]
        return (
            ContinuousPoint(none_a, none_c, wider, none_r),
            ContinuousPoint(longer, none_c, -0.5 * wider, none_r),
        )


def candidates(
    point: LinearPoint, deviations: Array, sample_time_s: float, duration_s: float
) -> list[Gust]:
    """Gusts worth trying on a model: one or two for each state that drives by a parameter.

    Parameters
    ----------
    point : LinearPoint
        With derivatives by the free parameters.
    deviations : ndarray, shape (n_states,)
        Size of each state over the records, in its unit.
    sample_time_s, duration_s : float
        Of the records, s; times between them can be told.
    """
    time_s = float(np.sqrt(5.0 * sample_time_s * 0.05 * duration_s))
    moved_a, moved_c = np.any(point.a[1:], axis=0), np.any(point.c[1:], axis=0)
    made = []
    for state in np.flatnonzero(moved_a.any(axis=0)):
        scale = 0.3 * float(deviations[state])
        inertial, vane = moved_c[:, state], point.c[0, :, state] != 0.0
        felt = (inertial, vane) if np.any(vane & ~inertial) else (inertial,)
        made += [Gust(int(state), moved_a[:, state], seen, scale, time_s) for seen in felt]
    return made
