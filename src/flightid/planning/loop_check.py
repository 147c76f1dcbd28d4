"""Whether the axis and the controllers a plan rests on do what the loop did in that flight."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from flightid.control.autopilots.axis_loop import AxisLoop
from flightid.conventions import Light
from flightid.errors import FlightidError
from flightid.findings import Finding
from flightid.planning.flown_axis import FlownAxis
from flightid.record import Record
from flightid.responses import estimate_response

LARGEST_ERROR, LEAST_ERROR, FEWEST_POINTS = 0.2, 0.04, 6
"""A frequency counts as measured up to this random error; none weighs more than one of the least;
so many make a check."""
CAREFULLY = "begin with a third of the amplitude, look at the log, then fly the whole"
LARGEST_MISS = 0.25
"""Root mean square of the logarithm, beyond what noise explains: a quarter of the loop."""


@dataclass(frozen=True)
class LoopCheck:
    """Closed rate loop as predicted beside as flown, set-point to rate.

    Attributes
    ----------
    miss : float
        Root mean square of the logarithm of flown over predicted, without the share of noise.
    lowest_rad_s, highest_rad_s : float
        Where it was compared.
    """

    miss: float
    lowest_rad_s: float
    highest_rad_s: float

    @property
    def holds(self) -> bool:
        """Whether the prediction flies as the vehicle did."""
        return self.miss <= LARGEST_MISS

    def finding(self, axis: str) -> Finding:
        """How far the plan may be trusted for an axis."""
        hertz = " to ".join(
            f"{each / math.tau:.2g}" for each in (self.lowest_rad_s, self.highest_rad_s)
        )
        flown = f"its closed loop in this flight, {hertz} Hz"
        if self.holds:
            said = f"{axis}: expected within {self.miss:.0%} of {flown}"
            return Finding("loop-as-flown", Light.GREEN, said)
        return Finding(
            "loop-not-as-flown",
            Light.AMBER,
            f"{axis}: what the plan expects is {self.miss:.0%} away from {flown}",
            CAREFULLY,
        )


def check_loop(
    pieces: list[Record],
    channels: tuple[str, str, str],
    vehicle: FlownAxis,
    loop: AxisLoop,
    omega_rad_s: NDArray[np.float64],
) -> LoopCheck | None:
    """Compare the loop of an expected axis with what rates made of their set-points in flight.

    Parameters
    ----------
    pieces : list of Record
        In the air.
    channels : tuple of str
        Set-point of the rate, the rate, and the set-point of attitude, which no gust moves.
    vehicle : FlownAxis
    loop : AxisLoop
        Controllers as they flew.
    omega_rad_s : ndarray
        Frequencies to compare at.

    Returns
    -------
    LoopCheck or None
        None where the flight does not tell its closed loop.

    Notes
    -----
    The set-point of attitude is the instrument, so gusts and gyro noise do not bias what flew.

    Reference
    ---------
    Ljung, *System Identification*, 2nd ed., section 13.5 (joint input-output approach).
    """
    wanted, rate, angle = channels
    told = [piece for piece in pieces if all(name in piece for name in channels)]
    if not told:
        return None
    try:
        flown = estimate_response(
            told, inputs=wanted, outputs=rate, excitations=angle, omega_rad_s=omega_rad_s,
            estimator="instrument",
        )  # fmt: skip
    except FlightidError:
        return None
    error = flown.random_error[0, 0]
    sure = error <= LARGEST_ERROR
    if np.count_nonzero(sure) < FEWEST_POINTS:
        return None
    omega = flown.omega_rad_s[sure]
    plant = vehicle.response(omega)
    fed = plant * loop.feedback(omega, gyro="filtered", with_hold=False)
    predicted = plant * loop.forward(omega, with_hold=False) / (1.0 + fed)
    apart = np.abs(np.log(flown.response[0, 0][sure] / predicted)) ** 2 - 2.0 * error[sure] ** 2
    weight = np.maximum(error[sure], LEAST_ERROR) ** -2
    miss = math.sqrt(max(0.0, float(np.average(apart, weights=weight))))
    return LoopCheck(miss, float(omega[0]), float(omega[-1]))
