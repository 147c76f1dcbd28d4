"""Levels of modes: what standards ask of eigenvalues."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

import numpy as np
from numpy.typing import NDArray

from flightid.dynamics.handling_qualities.rating import Rating, normal_draws, rate
from flightid.dynamics.handling_qualities.rating_charts import RatingChart
from flightid.dynamics.handling_qualities.rating_charts_reading import rating_chart
from flightid.dynamics.modes.result import Mode

SLOWEST_OSCILLATION = 0.5
"""rad/s; slower ones have limits of their own in ADS-33E."""
AEROPLANE = {
    "short period": ("short_period_damping",),
    "phugoid": ("phugoid",),
    "Dutch roll": ("dutch_roll",),
    "spiral": ("spiral",),
    "roll": ("roll_mode",),
}
ROTORCRAFT = ("short period", "Dutch roll", "phugoid-like")
Array = NDArray[np.float64]


def mode_ratings(
    modes: Iterable[Mode],
    *,
    vehicle: str,
    conditions: Mapping[str, str],
    n_alpha: float | None = None,
    path: str | None = None,
) -> tuple[Rating, ...]:
    """Levels of the modes that a standard names.

    Parameters
    ----------
    modes : iterable of Mode
    vehicle : {"aeroplane", "rotorcraft"}
    conditions : mapping of str to str
        Class and category.
    n_alpha : float, optional
        g/rad, for the control anticipation parameter of a short period.
    path : str, optional
        Chart file of the user's own.

    Returns
    -------
    tuple of Rating
    """
    found = []
    for mode in modes:
        for key in _keys(mode, vehicle, n_alpha):
            chart = rating_chart(key, path=path, **conditions)
            found.append(_rated(mode, chart, n_alpha))
    return tuple(found)


def _keys(mode: Mode, vehicle: str, n_alpha: float | None) -> tuple[str, ...]:
    if mode.eigenvalue is None:
        return ()
    if vehicle == "aeroplane":
        known = n_alpha is not None and mode.name == "short period"
        return (*AEROPLANE.get(mode.name, ()), *(("control_anticipation",) if known else ()))
    oscillates = mode.is_pair and abs(mode.eigenvalue) >= SLOWEST_OSCILLATION
    named = any(name in mode.name for name in ROTORCRAFT)
    return ("attitude_damping",) if oscillates and named else ()


def _rated(mode: Mode, chart: RatingChart, n_alpha: float | None) -> Rating:
    assert mode.eigenvalue is not None
    centre = np.array([mode.eigenvalue.real, mode.eigenvalue.imag])
    drawn = normal_draws(centre, mode.covariance)
    values = {name: float(each[0]) for name, each in _numbers(centre[:, None], n_alpha).items()}
    samples = None if drawn is None else _numbers(drawn, n_alpha)
    return rate(chart, values, samples, subject=mode.name)


def _numbers(parts: Array, n_alpha: float | None) -> dict[str, Array]:
    """What charts ask of eigenvalues, by quantity; times without end are infinite."""
    real, imaginary = parts
    frequency = np.hypot(real, imaginary)
    with np.errstate(divide="ignore"):
        found = {
            "frequency": frequency,
            "damping": -real / np.where(frequency > 0.0, frequency, 1.0),
            "decay": -real,
            "time_to_double": np.where(real > 0.0, np.log(2.0) / np.maximum(real, 0.0), np.inf),
            "time_constant": np.where(real < 0.0, -1.0 / np.minimum(real, -0.0), np.inf),
        }
    if n_alpha is not None:
        found["cap"] = frequency**2 / n_alpha
        found["n_alpha"] = np.full_like(frequency, n_alpha)
    return found
