"""From where to where a sweep goes, so that the loops to be tuned from it can be promised."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from flightid.control.margins.mode_slack import MOST_MOVED_DB
from flightid.control.tuning.requirements import TuningRequirements
from flightid.conventions import Light
from flightid.findings import Finding
from flightid.planning.flown_axis import FlownAxis

SAMPLES_IN_CYCLE = 16.0
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
    omega = np.geomspace(0.5, 200.0, 600)
    opened = vehicle.response(omega) * vehicle.feedback_slope(omega) / (1j * omega)
    above = np.flatnonzero(np.abs(opened) >= 1.0)
    crossover = omega[above[-1]] if above.size else 1.0 / vehicle.time_constant_s
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
