"""Where the fit of an equivalent system begins: shapes on a grid, gain and sign from the data."""

from __future__ import annotations

from itertools import product

import numpy as np
from numpy.typing import NDArray

from flightid.dynamics.lower_order.structures import DELAY, GAIN
from flightid.models import TransferFunctionModel

POINTS = {
    "zeta": (0.2, 0.7, 1.3),
    "zeta_phi": (0.2, 0.7),
    "zeta_r": (-0.2, 0.3),
    DELAY: (0.0, 0.08, 0.2),
}
"""Values tried for what has no place in the band."""
PER_BAND = 5
"""Values tried of each frequency, evenly in the log of the band."""
SPIRALS = (-0.3, -0.03, 0.03, 0.3)
KEPT = 3
PHASE_WEIGHT = 0.01745
Array = NDArray[np.float64]
Complex = NDArray[np.complex128]


def best_starts(
    model: TransferFunctionModel, omega: Array, wanted: Complex
) -> list[TransferFunctionModel]:
    """The few shapes of a grid that come nearest to a response, each with its best gain.

    Parameters
    ----------
    model : TransferFunctionModel
        One response; its free parameters are varied, but for the gain, which follows.
    omega : ndarray, shape (n,)
        rad/s.
    wanted : ndarray of complex, shape (n,)

    Returns
    -------
    list of TransferFunctionModel
    """
    free = [parameter.name for parameter in model.parameters.free if parameter.name != GAIN]
    grids = [_grid(name, float(omega[0]), float(omega[-1])) for name in free]
    found: list[tuple[float, dict[str, float]]] = []
    for values in product(*grids):
        chosen = dict(zip(free, values, strict=True))
        shape = model.frequency_response(omega, {**chosen, GAIN: 1.0})[0, 0]
        ratio = wanted / shape
        decibels = 20.0 * np.log10(np.abs(ratio))
        level = float(np.mean(decibels))
        for sign in (1.0, -1.0):
            degrees = np.degrees(np.angle(sign * ratio))
            cost = float(np.mean((decibels - level) ** 2 + PHASE_WEIGHT * degrees**2))
            found.append((cost, {**chosen, GAIN: sign * 10.0 ** (level / 20.0)}))
    found.sort(key=lambda each: each[0])
    return [model.with_values(values) for _, values in found[:KEPT]]


def _grid(name: str, low: float, high: float) -> tuple[float, ...]:
    if name in POINTS:
        return POINTS[name]
    if name == "spiral":
        return SPIRALS
    frequencies = np.geomspace(1.3 * low, high / 1.3, PER_BAND)
    return tuple(1.0 / frequencies if name == "T_R" else frequencies)
