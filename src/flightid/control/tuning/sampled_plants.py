"""Identified models as the autopilot's loop meets them: sampled, held, and many at once."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from flightid.control.tuning.loop_problem import Plants
from flightid.errors import ModelError
from flightid.frozen import dataclass
from flightid.models.linear.linear_system import LinearSystem
from flightid.models.model import linear_system
from flightid.progress import track

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]
ON_CIRCLE = 1e-9
"""Distance from the unit circle within which a pole is an integrator."""
LOWEST_RAD_S, KNEE_RAD_S = 1e-5, 0.05
"""Lowest frequency of a grid, rad/s, and the one below which it is thin."""
TAIL_POINTS = 40
"""Frequencies below the knee."""
FEWEST_DECADES = 600.0
"""Least ratio of the highest frequency to the knee: slow loops have a lower one."""
BELOW_NYQUIST = 1.0 - 1e-4
"""At half the sample rate itself filters are exactly zero."""
LIGHT, LIGHTEST = 0.1, 1e-3
"""Damping below which a mode is narrower than the grid, and below which it is drawn no narrower."""
ACROSS = np.array([-6.0, -3.0, -1.5, -0.75, 0.0, 0.75, 1.5, 3.0, 6.0])
"""Points over a resonance, in its damping ratio."""
APART = 1e-7
"""Least relative distance of frequencies."""
SAME_STEP, WHOLE = 1e-6, 1e-9
"""Relative difference of equal steps; share of a step short of which a delay is whole steps."""


def loop_grid(sample_time_s: float, points: int, resonances_rad_s: Array | None = None) -> Array:
    """Frequencies from far below all dynamics to half the sample rate, rad/s.

    Parameters
    ----------
    sample_time_s : float
        Of the loop, s.
    points : int
        Above `KNEE_RAD_S`; a thin tail leads down from there.
    resonances_rad_s : ndarray, optional
        Further frequencies, from `SampledPlants.resonances`; as many as half the points are kept.

    Returns
    -------
    ndarray, shape (TAIL_POINTS + points,), or with resonances up to half as many points more
    """
    top = BELOW_NYQUIST * np.pi / sample_time_s
    knee = min(KNEE_RAD_S, top / FEWEST_DECADES)
    tail = np.geomspace(LOWEST_RAD_S * knee / KNEE_RAD_S, knee, TAIL_POINTS, endpoint=False)
    even = np.concatenate([tail, np.geomspace(knee, top, points)])
    if resonances_rad_s is None or not resonances_rad_s.size:
        return even
    inside = np.sort(resonances_rad_s[(resonances_rad_s > tail[1]) & (resonances_rad_s < top)])
    kept = inside[np.unique(np.linspace(0, len(inside) - 1, points // 2).astype(int))]
    joined = np.unique(np.concatenate([even, kept]))
    # Points closer than rounding would divide by nothing.
    apart = np.append(True, np.diff(joined) > APART * joined[1:])
    apart[-1] = True
    return np.asarray(joined[apart])


@dataclass(frozen=True, eq=False)
class SampledPlants:
    """Plants of one or more axes at the loop's samples.

    Attributes
    ----------
    systems : tuple of LinearSystem
        Recursions from outputs of the controller to rates, then angles; the estimate first.
    delays : ndarray of int, shape (n, n_axes)
        Whole samples of delay of each input, kept out of the recursions.
    advances_s : ndarray, shape (n, n_axes)
        What of half a sample of hold a model's delay is too short to hold, s.
    unstable : ndarray of int, shape (n,)
        Poles of the plants outside the unit circle.
    """

    systems: tuple[LinearSystem, ...]
    delays: NDArray[np.int64]
    advances_s: Array
    unstable: NDArray[np.int64]

    def __len__(self) -> int:
        """Number of plants."""
        return len(self.systems)

    @property
    def n_axes(self) -> int:
        """Number of axes."""
        return len(self.systems[0].inputs)

    @property
    def sample_time_s(self) -> float:
        """Of the loop, s."""
        return float(self.systems[0].sample_time_s or 0.0)

    def resonances(self) -> Array:
        """Frequencies across every lightly damped mode of every plant, rad/s, in no order."""
        poles = np.concatenate([_poles(system) for system in self.systems]).astype(complex)
        roots = np.log(poles[poles.imag > 0.0]) / self.sample_time_s
        size = np.abs(roots)
        damping = np.abs(roots.real) / size
        light = damping < LIGHT
        width = np.maximum(damping[light], LIGHTEST)
        return np.asarray((size[light, None] * (1.0 + width[:, None] * ACROSS)).ravel())

    def take(self, rows: list[int]) -> SampledPlants:
        """Some of the plants."""
        return SampledPlants(
            tuple(self.systems[k] for k in rows),
            self.delays[rows],
            self.advances_s[rows],
            self.unstable[rows],
        )

    def responses(self, omega_rad_s: Array) -> tuple[Complex, Complex]:
        """Rates and angles over outputs, each (n, n_axes, n_axes, n_f)."""
        z_lag = -1j * omega_rad_s * self.sample_time_s
        found = np.empty((len(self), 2 * self.n_axes, self.n_axes, len(omega_rad_s)), complex)
        for k, system in enumerate(self.systems):
            shift = z_lag * self.delays[k][:, None] + 1j * omega_rad_s * self.advances_s[k][:, None]
            found[k] = system.frequency_response(omega_rad_s) * np.exp(shift)
        return found[:, : self.n_axes], found[:, self.n_axes :]


def sample_plants(
    sources: Sequence[object],
    outputs: Sequence[str],
    inputs: Sequence[str],
    sample_time_s: float,
    *,
    hold_in_model: bool,
) -> SampledPlants:
    """Sample models with the autopilot's output hold, exactly; angles are integrals of rates.

    Parameters
    ----------
    sources : sequence of model, fit or LinearSystem
        The estimate first.
    outputs, inputs : sequence of str
        Rates and commands of the axes, in the same order.
    sample_time_s : float
        Of the autopilot's loop, s.
    hold_in_model : bool
        Whether the models' delays hold the half sample of the output hold, as those of models
        fitted to logged signals do.

    Raises
    ------
    ModelError
        A model in discrete time whose samples are not those of the loop.
    """
    made = [
        _sampled(linear_system(source), outputs, inputs, sample_time_s, hold_in_model)
        for source in track(sources, "sampling the plants")
    ]
    systems, delays, advances = zip(*made, strict=True)
    unstable = [np.count_nonzero(np.abs(_poles(system)) > 1.0 + ON_CIRCLE) for system in systems]
    return SampledPlants(systems, np.array(delays), np.array(advances), np.array(unstable))


def _sampled(
    system: LinearSystem,
    outputs: Sequence[str],
    inputs: Sequence[str],
    step: float,
    hold_in_model: bool,
) -> tuple[LinearSystem, NDArray[np.int64], Array]:
    chosen = system.select(outputs=outputs, inputs=inputs)
    if chosen.sample_time_s is not None:
        if abs(chosen.sample_time_s / step - 1.0) > SAME_STEP:
            raise ModelError(
                "the model's samples are not those of the loop",
                found=f"T = {chosen.sample_time_s:g} s",
                needed=f"T = {step:g} s",
                action="convert it with to_continuous, or identify from a log of every loop",
            )
        whole = np.rint(np.asarray(chosen.delays_s) / step).astype(np.int64)
        undelayed = replace(chosen, delays_s=(), sample_time_s=step)
        return _with_sums(undelayed, step), whole, np.zeros(len(inputs))
    held = np.asarray(chosen.delays_s) - (0.5 * step if hold_in_model else 0.0)
    advance, late = np.maximum(-held, 0.0), np.maximum(held, 0.0)
    whole = np.floor(late / step + WHOLE).astype(np.int64)
    rest = np.maximum(late - whole * step, 0.0)
    return replace(_with_angles(chosen), delays_s=rest).sampled(step), whole, advance


def _with_angles(system: LinearSystem) -> LinearSystem:
    """Rates, then their integrals, of a continuous system."""
    a, b, c, d, delays = system.state_space()
    return _stacked(system, np.zeros((len(c), len(c))), (a, b, c, d), c, d, delays)


def _with_sums(system: LinearSystem, step: float) -> LinearSystem:
    """Rates, then angles by the trapezoidal rule, of a recursion whose inside is not known."""
    a, b, c, d, delays = system.state_space()
    # angle[k+1] = angle[k] + T (rate[k] + rate[k+1])/2; the input's own part of rate[k+1] needs the
    # next input, which D of a sampled vehicle (zero) does not pass on.
    slope = 0.5 * step * (c + c @ a)
    return _stacked(
        system, np.eye(len(c)), (a, b, c, d), slope, 0.5 * step * (2.0 * d + c @ b), delays
    )


def _stacked(
    system: LinearSystem,
    own: Array,
    matrices: tuple[Array, Array, Array, Array],
    rise: Array,
    rise_direct: Array,
    delays: Array,
) -> LinearSystem:
    a, b, c, d = matrices
    n, (p, m) = len(a), d.shape
    # Filled in place: `np.block` costs more than all else that a plant of hundreds needs.
    joined, driven = np.zeros((n + p, n + p)), np.zeros((n + p, m))
    seen, direct = np.zeros((2 * p, n + p)), np.zeros((2 * p, m))
    joined[:n, :n], joined[n:, :n], joined[n:, n:] = a, rise, own
    driven[:n], driven[n:] = b, rise_direct
    seen[:p, :n], seen[p:, n:], direct[:p] = c, np.eye(p), d
    return LinearSystem(
        joined,
        driven,
        seen,
        direct,
        system.inputs,
        (*system.outputs, *(f"integral of {name}" for name in system.outputs)),
        delays,
        sample_time_s=system.sample_time_s,
    )


def _poles(system: LinearSystem) -> Complex:
    return np.asarray(np.linalg.eigvals(np.asarray(system.a)))


@dataclass(frozen=True, eq=False)
class AxisLoops:
    """Controllers of the axes at given frequencies, as they stand.

    Attributes
    ----------
    feedback, outer : ndarray of complex, shape (n_axes, n_f)
        Rate to output, and angle to output through the rate loop, both with the opposite sign.
    """

    feedback: Complex
    outer: Complex


def plants_of_axis(
    rate: Complex,
    angle: Complex,
    omega_rad_s: Array,
    unstable: NDArray[np.int64],
    place: int,
    loops: AxisLoops,
) -> Plants:
    """Plant of one axis with the loops of the others closed.

    Parameters
    ----------
    rate, angle : ndarray of complex, shape (n, n_axes, n_axes, n_f)
        From `SampledPlants.responses`.
    omega_rad_s : ndarray, shape (n_f,)
    unstable : ndarray of int, shape (n,)
    place : int
        Which axis.
    loops : AxisLoops
        Controllers of all axes; that of this one is not used.
    """
    others = [k for k in range(rate.shape[1]) if k != place]
    own_rate, own_angle = rate[:, place, place], angle[:, place, place]
    if not others:
        return Plants(omega_rad_s, own_rate, own_angle, np.ones_like(own_rate), unstable)
    # Frequency last but one for the solver: (n, n_f, rows, columns).
    inner, outer = (np.moveaxis(each, -1, 1) for each in (rate, angle))
    gains = (each[others].T[None, :, :, None] for each in (loops.feedback, loops.outer))
    c, o = gains
    back = c * inner[:, :, others] + o * outer[:, :, others]
    open_loop = np.eye(len(others)) + back[..., others]
    answer = -np.linalg.solve(open_loop, back[..., [place]])
    seen_rate, seen_angle = (
        (each[:, :, [place]][..., others] @ answer)[..., 0, 0] + each[:, :, place, place]
        for each in (inner, outer)
    )
    return Plants(omega_rad_s, seen_rate, seen_angle, np.linalg.det(open_loop), unstable)


def whole_loop(rate: Complex, angle: Complex, loops: AxisLoops) -> Complex:
    """Loop transfer matrix broken at the outputs of all controllers, (n, n_f, n_axes, n_axes)."""
    moved = (np.moveaxis(each, -1, 1) for each in (rate, angle))
    inner, outer = moved
    return np.asarray(loops.feedback.T[:, :, None] * inner + loops.outer.T[:, :, None] * outer)
