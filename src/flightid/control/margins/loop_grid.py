"""Frequencies at which a modelled loop is looked at: none of its turns is missed."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from flightid.errors import FlightidError
from flightid.frozen import dataclass
from flightid.models.model import linear_system

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]
BAND_RAD_S = (1e-2, 1e3)
"""Where nothing says more."""
POINTS_A_DECADE = 100
BEYOND = 100.0
"""Ratio by which the grid goes below the slowest and above the fastest root."""
ORIGIN = 1e-6
"""Size, relative to the largest pole, below which a pole is an integrator."""
NEUTRAL = 1e-9
LARGEST_TURN = 0.15
"""Turn of L or 1 + L between two points, rad, above which a point is put between them."""
ROUNDS = 14
MOST_POINTS = 20_000
DECADES_UP = 6


@dataclass(frozen=True)
class Roots:
    """What is known of the poles of a loop's parts.

    Attributes
    ----------
    rates : tuple of complex
        Poles as in continuous time, rad/s, integrators left out.
    n_unstable : int
    delay_s : float
        Sum of delays.
    end_rad_s : float
        π/T of the slowest sampled part.
    n_neutral : int
        Undamped pairs away from the origin.
    """

    rates: tuple[complex, ...] = ()
    n_unstable: int = 0
    delay_s: float = 0.0
    end_rad_s: float = np.inf
    n_neutral: int = 0

    def joined(self, other: Roots) -> Roots:
        """Of both parts in series."""
        return Roots(
            self.rates + other.rates,
            self.n_unstable + other.n_unstable,
            self.delay_s + other.delay_s,
            min(self.end_rad_s, other.end_rad_s),
            self.n_neutral + other.n_neutral,
        )


def roots_of(part: object) -> Roots:
    """Poles of a model or connection; none of a gain, a function or values, taken as stable."""
    if hasattr(part, "stability"):
        found = part.stability()
        return _roots(found.poles, found.sample_time_s, found.n_unstable, 0.0)
    if part is None or callable(part) or not hasattr(part, "frequency_response"):
        return Roots()
    try:
        system = linear_system(part)
    except FlightidError:
        return Roots()
    delay = float(np.max(np.asarray(system.delays_s), initial=0.0))
    return _roots(system.poles(), system.sample_time_s, None, delay)


def _roots(poles: Complex, step: float | None, count: int | None, delay: float) -> Roots:
    poles = np.asarray(poles, dtype=np.complex128)
    if step is not None:
        # A pole at the origin of the z plane is a delay, and has no rate.
        poles = np.asarray(np.log(poles[np.abs(poles) > ORIGIN]) / step, dtype=np.complex128)
    scale = float(np.max(np.abs(poles), initial=0.0))
    moving = poles[np.abs(poles) > ORIGIN * scale]
    unstable = moving.real > NEUTRAL * np.abs(moving)
    neutral = (np.abs(moving.real) <= NEUTRAL * np.abs(moving)) & (moving.imag > 0.0)
    return Roots(
        tuple(complex(each) for each in moving),
        int(np.sum(unstable)) if count is None else count,
        delay,
        np.inf if step is None else np.pi / step,
        int(np.sum(neutral)),
    )


def loop_grid(
    of: Callable[[Array], Complex], roots: Roots, band_rad_s: tuple[float, float] | None
) -> Array:
    """Frequencies that follow every turn of a loop.

    Parameters
    ----------
    of : callable
        The loop's response, shape (n_f,).
    roots : Roots
    band_rad_s : tuple of float, optional
        Left out: far enough below and above all roots that gain and phase have settled.

    Returns
    -------
    ndarray, shape (n_f,)
        rad/s.
    """
    low, high = band_rad_s or _band(of, roots)
    high = min(high, roots.end_rad_s)
    count = max(int(POINTS_A_DECADE * np.log10(high / low)), POINTS_A_DECADE)
    near = [
        abs(each) + shift * abs(each.real)
        for each in roots.rates
        for shift in (-4.0, -2.0, -1.0, -0.5, 0.0, 0.5, 1.0, 2.0, 4.0)
        if abs(each.imag) > abs(each.real)
    ]
    omega = np.union1d(np.geomspace(low, high, count), [at for at in near if low < at < high])
    omega = _without_equals(omega)
    values = of(omega)
    for _ in range(ROUNDS):
        turns = [np.abs(np.angle(each[1:] / each[:-1])) for each in (values, 1.0 + values)]
        # Small gains may turn as they like; so may the loop far from −1.
        coarse = (turns[1] > LARGEST_TURN) | (
            (turns[0] > LARGEST_TURN) & (np.abs(values[1:]) > 1e-2)
        )
        if not np.any(coarse) or len(omega) > MOST_POINTS:
            break
        between = np.sqrt(omega[1:] * omega[:-1])[coarse]
        omega, order = np.unique(np.concatenate([omega, between]), return_index=True)
        values = np.concatenate([values, of(between)])[order]
    return omega


def whole_grid(
    of: Callable[[Array], Complex], roots: Roots, band_rad_s: tuple[float, float]
) -> Array:
    """Frequencies below, in and above a band, for a count that must not miss any turn."""
    low, high = _band(of, roots)
    return loop_grid(of, roots, (min(low, band_rad_s[0]), max(high, band_rad_s[1])))


def zoomed(omega: Array, centres: Array, ratio: float) -> Array:
    """The grid with pairs of points close around some frequencies."""
    wanted = centres[np.isfinite(centres) & (centres > omega[0]) & (centres < omega[-1])]
    if not len(wanted):
        return omega
    close = np.concatenate([wanted / (1.0 + ratio), wanted, wanted * (1.0 + ratio)])
    return _without_equals(np.union1d(omega, close[(close > omega[0]) & (close < omega[-1])]))


def _without_equals(omega: Array) -> Array:
    """Frequencies that rounding does not make one."""
    apart = np.append(True, np.diff(omega) > 1e-12 * omega[1:])
    return np.asarray(omega[apart])


def _band(of: Callable[[Array], Complex], roots: Roots) -> tuple[float, float]:
    sizes = [abs(each) for each in roots.rates]
    if roots.delay_s > 0.0:
        sizes.append(1.0 / roots.delay_s)
    low, high = (min(sizes) / BEYOND, max(sizes) * BEYOND) if sizes else BAND_RAD_S
    if np.isfinite(roots.end_rad_s):
        return min(low, roots.end_rad_s / BEYOND**2), roots.end_rad_s
    for _ in range(DECADES_UP):
        if abs(of(np.array([high]))[0]) < 0.5:
            break
        high *= 10.0
    for _ in range(DECADES_UP):
        # An integrator alone may cross below what its poles show.
        if not _crosses_below(of, low):
            break
        low /= 10.0
    return low, high


def _crosses_below(of: Callable[[Array], Complex], low: float) -> bool:
    """Whether the gain at the lower end still has to rise through one as an integrator's does."""
    one, two = np.abs(of(np.array([low, 2.0 * low])))
    return bool(one < 1.0 and two < 0.75 * one)
