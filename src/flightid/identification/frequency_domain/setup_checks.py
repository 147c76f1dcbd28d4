"""What an expert looks for before a fit: a sign, an integration, or a unit that is off.

The measured response is divided by the model at its start values. A ratio that is constant in phase
at 180° is a sign; one that falls or rises by 20 dB a decade with ∓90° is a missing or extra
integration; one of 57.3 is degrees against radians.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from flightid.conventions import Light
from flightid.findings import Finding

_STEADY = 0.8
_SLOPE = 20.0
_SLOPE_TOLERANCE = 6.0
_PHASE_TOLERANCE_DEG = 35.0
_RAD_TO_DEG_DB = 20.0 * np.log10(180.0 / np.pi)
_UNIT_TOLERANCE_DB = 1.5


def check_setup(
    name: str,
    omega_rad_s: NDArray[np.float64],
    measured: NDArray[np.complex128],
    start: NDArray[np.complex128],
) -> list[Finding]:
    """Compare a measured response with the model at its start.

    Parameters
    ----------
    name : str
        ``"output/input"``.
    omega_rad_s : ndarray, shape (n,)
        Frequencies, rad/s.
    measured, start : ndarray of complex, shape (n,)
        Measured response, and the model's at its start values.

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
    >>> [finding.code for finding in check_setup("p/u", omega, -model, model)]
    ['setup-sign']
    """
    ratio = measured / start
    direction = np.mean(ratio / np.abs(ratio))
    if np.abs(direction) < _STEADY:
        return []
    phase_deg = float(np.degrees(np.angle(direction)))
    decibel = 20.0 * np.log10(np.abs(ratio))
    decades = np.log10(omega_rad_s / omega_rad_s[0])
    decades -= decades.mean()
    slope = float(decades @ decibel / (decades @ decades))
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
    offset = float(np.mean(decibel))
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
