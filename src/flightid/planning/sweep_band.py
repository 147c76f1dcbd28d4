"""From where to where a sweep goes, so that the loops to be tuned from it can be promised."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from flightid.control.margins.mode_slack import MOST_MOVED_DB
from flightid.control.margins.outside_band import SAMPLES_IN_CYCLE
from flightid.control.tuning.requirements import TuningRequirements
from flightid.conventions import Light
from flightid.findings import Finding
from flightid.planning.flown_axis import FlownAxis

LOWEST_HZ, HIGHEST_HZ, HIGHEST_BY_STICK_HZ = 0.1, 25.0, 2.0
LOW_SHARE, HIGH_SHARE = 0.125, 2.5
"""Ends of the band over the crossover, and over the frequency of -180 deg."""
CLEAR_DB = MOST_MOVED_DB + TuningRequirements.gain_margin_db
"""Below one, where a light mode beyond the band leaves a loop the gain margin that tuning asks."""
WIDEST_BAND = 80.0
"""Highest over lowest frequency: a chirp has as many times less power at its end."""


def sweep_band(vehicle: FlownAxis, sample_rate_hz: float, by_stick: bool) -> tuple[float, float]:
    """Around crossover and -180 deg of the broken rate loop, as the log's rate allows, rad/s.

    Up to where a light mode beyond takes no margin of gains like those that flew: gains are
    promised no other.

    Parameters
    ----------
    vehicle : FlownAxis
    sample_rate_hz : float
        Of the log.
    by_stick : bool
        Whether a pilot sweeps.
    """
    omega, opened = _broken(vehicle)
    crossover = crossover_rad_s(vehicle) or 1.0 / vehicle.time_constant_s
    phase = np.unwrap(np.angle(opened))
    beyond = np.flatnonzero((phase < -np.pi) & (omega > crossover))
    turned = omega[beyond[0]] if beyond.size else 4.0 * crossover
    reaching = np.flatnonzero(np.abs(opened) >= 10.0 ** (-CLEAR_DB / 20.0))
    clear = float(omega[reaching[-1]]) if reaching.size else 0.0
    highest_hz = min(HIGHEST_HZ, sample_rate_hz / SAMPLES_IN_CYCLE)
    if by_stick:
        highest_hz = HIGHEST_BY_STICK_HZ
    high = min(max(HIGH_SHARE * float(turned), clear), math.tau * highest_hz)
    low = max(LOW_SHARE * float(crossover), math.tau * LOWEST_HZ)
    low = float(np.clip(low, high / WIDEST_BAND, high / 10.0))
    return _rounded(low), _rounded(high)


def crossover_rad_s(vehicle: FlownAxis) -> float | None:
    """Where the broken loop, as it flew, falls through one last, rad/s; None: nowhere."""
    omega, opened = _broken(vehicle)
    above = np.flatnonzero(np.abs(opened) >= 1.0)
    return float(omega[above[-1]]) if above.size else None


def _broken(vehicle: FlownAxis) -> tuple[NDArray[np.float64], NDArray[np.complex128]]:
    omega = np.geomspace(0.5, 200.0, 600)
    opened = vehicle.response(omega) * vehicle.feedback_slope(omega) / (1j * omega)
    return omega, np.asarray(opened)


def ends_too_low(
    tops_rad_s: Mapping[str, float], crossovers_rad_s: Mapping[str, float | None]
) -> Finding | None:
    """Amber where sweeps end below what gains like those that flew need of a band.

    Parameters
    ----------
    tops_rad_s : mapping of str to float
        Highest frequency that is swept, by axis, rad/s.
    crossovers_rad_s : mapping of str to float or None
        Of the loops as they flew, by axis, rad/s.

    Example
    -------
    >>> print(ends_too_low({"roll": 12.6, "yaw": 12.6}, {"roll": 18.8, "yaw": 2.0}))
    [amber] roll: swept up to 2 Hz, and the loop crosses over at 3 Hz: gains ...
    """
    factor = TuningRequirements.band_factor or 1.0
    found = {axis: crossovers_rad_s[axis] or 0.0 for axis in tops_rad_s}
    named = [axis for axis, top in tops_rad_s.items() if found[axis] > top / factor]
    if not named:
        return None
    tops, places = (
        " and ".join(dict.fromkeys(f"{of[axis] / math.tau:.2g} Hz" for axis in named))
        for of in (tops_rad_s, found)
    )
    needed = factor * max(found[axis] for axis in named) / math.tau
    return Finding(
        "sweep-below-loop",
        Light.AMBER,
        f"{', '.join(named)}: swept up to {tops}, and the loop crosses over at {places}: gains "
        f"cross over below 1/{factor:g} of what was swept, so the log can hardly carry any",
        f"expect a model of it, not gains: those that fly need a sweep up to {needed:.2g} Hz",
    )


def why_so_high(tops_rad_s: Mapping[str, float]) -> Finding:
    """Why sweeps go up so far, by axis, rad/s.

    Example
    -------
    >>> print(why_so_high({"roll": 157.1, "yaw": 31.4}))
    [green] swept up to 25 Hz in roll, 5 Hz in yaw: as far as its rate allows a log has to show ...
    """
    named = ", ".join(f"{top / math.tau:.2g} Hz in {axis}" for axis, top in tops_rad_s.items())
    said = f"swept up to {named}: as far as its rate allows a log has to show the vehicle until "
    said += f"the loop is {CLEAR_DB:g} dB below one, where no light mode beyond takes a margin"
    return Finding("sweep-band", Light.GREEN, said)


def _rounded(omega_rad_s: float) -> float:
    """A frequency whose hertz have two digits."""
    hertz = omega_rad_s / math.tau
    return math.tau * float(f"{hertz:.2g}")
