"""What an expert looks for before a fit: a sign, an integration, or a unit that is off.

The measured response is divided by the model at its start values. A ratio that is constant in phase
at 180° is a sign; one that falls or rises by 20 dB a decade with ∓90° is a missing or extra
integration; one of 57.3 is degrees against radians.
"""

from __future__ import annotations

import cmath
import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from flightid.conventions import Light
from flightid.findings import Finding
from flightid.frozen import dataclass

_STEADY = 0.8
_SLOPE = 20.0
_SLOPE_TOLERANCE = 6.0
_PHASE_TOLERANCE_DEG = 35.0
_RAD_TO_DEG_DB = 20.0 * np.log10(180.0 / np.pi)
_UNIT_TOLERANCE_DB = 1.5


@dataclass(frozen=True)
class Start:
    """A measured response and the model's at its start values.

    Attributes
    ----------
    name : str
        ``"output/input"``.
    omega_rad_s : ndarray, shape (n,)
        Frequencies, rad/s.
    measured, start : ndarray of complex, shape (n,)
    """

    name: str
    omega_rad_s: NDArray[np.float64]
    measured: NDArray[np.complex128]
    start: NDArray[np.complex128]


def check_setups(starts: Sequence[Start]) -> list[Finding]:
    """Compare measured responses with the model at its start.

    Parameters
    ----------
    starts : sequence of Start
        Of frequencies of their own, three at least.

    Returns
    -------
    list of Finding
        Empty where nothing looks wrong.

    Reference
    ---------
    Tischler & Remple, 2nd ed., §13.6.

    Example
    -------
    >>> omega = np.array([1.0, 2.0, 4.0, 8.0])
    >>> model = 1.0 / (1j * omega + 3.0)
    >>> starts = [Start("p/u", omega, -model, model), Start("q/u", omega, model, model)]
    >>> [(finding.code, finding.message[:3]) for finding in check_setups(starts)]
    [('setup-sign', 'p/u')]
    """
    if not starts:
        return []
    counts = np.array([len(each.omega_rad_s) for each in starts])
    first = np.cumsum(counts) - counts

    def means(values: NDArray[np.inexact]) -> NDArray[np.inexact]:
        return np.asarray(np.add.reduceat(values, first) / counts)

    measured = np.concatenate([each.measured for each in starts])
    ratio = measured / np.concatenate([each.start for each in starts])
    size = np.abs(ratio)
    directions, decibel = means(ratio / size), 20.0 * np.log10(size)
    decades = np.log10(np.concatenate([each.omega_rad_s for each in starts]))
    decades -= np.repeat(means(decades), counts)
    slopes = means(decades * decibel) / means(decades**2)
    found = zip(starts, directions.tolist(), slopes.tolist(), means(decibel).tolist(), strict=True)
    return [
        each
        for start, direction, slope, offset in found
        if abs(direction) >= _STEADY
        for each in _judged(start.name, math.degrees(cmath.phase(direction)), slope, offset)
    ]


def _judged(name: str, phase_deg: float, slope: float, offset: float) -> list[Finding]:
    """What a steady ratio tells by its phase, its slope in dB a decade and its mean in dB."""
    if abs(abs(phase_deg) - 180.0) < _PHASE_TOLERANCE_DEG and abs(slope) < _SLOPE_TOLERANCE:
        return [
            Finding(
                "setup-sign",
                Light.AMBER,
                f"{name}: the data lie {phase_deg:+.0f}° from the model at its start",
                "check the sign of the channels; a gain bounded to one sign cannot follow",
            )
        ]
    for power, word in ((-1, "integrated"), (1, "differentiated")):
        is_phase = abs(phase_deg - 90.0 * power) < _PHASE_TOLERANCE_DEG
        if is_phase and abs(slope - _SLOPE * power) < _SLOPE_TOLERANCE:
            return [
                Finding(
                    "setup-integration",
                    Light.AMBER,
                    f"{name}: against the model the data change by {slope:+.0f} dB a decade "
                    f"and {phase_deg:+.0f}°, as if {word} once",
                    "check whether the channel is a rate or an angle, or choose another structure",
                )
            ]
    is_unit = abs(abs(offset) - _RAD_TO_DEG_DB) < _UNIT_TOLERANCE_DB
    if is_unit and abs(slope) < _SLOPE_TOLERANCE and abs(phase_deg) < _PHASE_TOLERANCE_DEG:
        return [
            Finding(
                "setup-unit-factor",
                Light.AMBER,
                f"{name}: the data are {10 ** (offset / 20):.3g} times the model at its start, "
                "close to degrees against radians",
                "check the units of the channels",
            )
        ]
    return []
