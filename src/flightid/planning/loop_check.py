"""Whether the axis and the controllers a plan rests on do what the loop did in that flight."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from flightid.control.autopilots.axis_loop import AxisLoop
from flightid.conventions import Light
from flightid.errors import FlightidError
from flightid.findings import Finding
from flightid.frozen import dataclass
from flightid.planning.flown_axis import FlownAxis
from flightid.record import Record
from flightid.responses import FrequencyResponse, estimate_response
from flightid.uncertainty.quantiles import half_width

LARGEST_ERROR, LEAST_ERROR, FEWEST_POINTS = 0.2, 0.04, 6
"""A frequency counts as measured up to this random error; none weighs more than one of the least;
so many make a check. The least is what windows may bend of a response."""
SMALLER = "a third of the amplitude"
CAREFULLY = f"begin with {SMALLER}, look at the log, then fly the whole"
MISSED = "loop-not-as-flown"
"""Code of the finding that a loop flew otherwise than expected, beyond doubt."""
LARGEST_MISS = math.log(1.3)
"""Root mean square of the logarithm: peaks of the card, which scale with the loop, hold to 30 %."""
SURELY = half_width(0.90)
"""Standard errors to each end of the interval: one end holds in 95 of 100 flights."""


@dataclass(frozen=True)
class LoopCheck:
    """Closed rate loop as predicted beside as flown, set-point to rate.

    Attributes
    ----------
    miss : float
        Root mean square of the logarithm of flown over predicted, without the share of noise.
    least, most : float
        Lower and upper 95 % bound of the miss, each by itself, by the response's own covariance.
    lowest_rad_s, highest_rad_s : float
        Where it was compared.
    """

    miss: float
    least: float
    most: float
    lowest_rad_s: float
    highest_rad_s: float

    @property
    def holds(self) -> bool:
        """Whether the prediction flies as the vehicle did, beyond doubt."""
        return self.most <= LARGEST_MISS

    @property
    def is_missed(self) -> bool:
        """Whether the vehicle did not fly as predicted, beyond doubt."""
        return self.least > LARGEST_MISS

    def finding(self, axis: str) -> Finding:
        """How far the plan may be trusted for an axis."""
        hertz = " to ".join(
            f"{each / math.tau:.2g}" for each in (self.lowest_rad_s, self.highest_rad_s)
        )
        flown = f"its closed loop in this flight, {hertz} Hz"
        if self.holds:
            said = f"{axis}: expected within {_percent(self.miss)} of {flown}"
            return Finding("loop-as-flown", Light.GREEN, said)
        ends = f"{_percent(self.least)} to {_percent(self.most)}"
        apart = f"{_percent(self.miss)} ({ends}) away from {flown}"
        if self.is_missed:
            said = f"{axis}: what the plan expects is {apart}"
            return Finding(MISSED, Light.AMBER, said, CAREFULLY)
        return Finding(
            "loop-untold",
            Light.UNKNOWN,
            f"{axis}: what the plan expects is {apart}: whether it holds to "
            f"{_percent(math.expm1(LARGEST_MISS))} is not told",
            f"fly a minute with brisker sticks about {axis} and plan from that log, or {CAREFULLY}",
        )


def begins_small(finding: Finding) -> bool:
    """Whether a finding, by what it says to do, has the first sweep be smaller than planned."""
    return SMALLER in finding.action


def _percent(share: float) -> str:
    return f"{100.0 * share:.0f} %"


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
    logs = np.log(flown.response[0, 0][sure] / predicted)
    weight = np.maximum(error[sure], LEAST_ERROR) ** -2
    ends = _interval(logs, _covariance(flown, sure, error), weight / weight.sum())
    return LoopCheck(*ends, float(omega[0]), float(omega[-1]))


def _covariance(
    flown: FrequencyResponse, sure: NDArray[np.bool_], error: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Of real and imaginary parts of the logarithm at the sure frequencies, (2 n, 2 n)."""
    if flown.errors is None:
        return np.diag(np.tile(error[sure] ** 2, 2))
    omega, values = flown.omega_rad_s[sure], flown.response[0, 0][sure]
    scale = np.diag(1.0 / values)
    turn = np.block([[scale.real, -scale.imag], [scale.imag, scale.real]])
    return np.asarray(turn @ flown.covariance_at(omega)[0] @ turn.T)


def _interval(
    logs: NDArray[np.complex128], covariance: NDArray[np.float64], weight: NDArray[np.float64]
) -> tuple[float, float, float]:
    """Root of the weighted mean square of logarithms, less noise's, with its bounds.

    With d of mean μ and covariance C, ``dᵀWd`` has the mean ``m + tr(WC)``, ``m = μᵀWμ``, and the
    variance ``2 tr(WCWC) + 4 μᵀWCWμ``, the last share in the direction of d. Bounds are the m that
    lie `SURELY` of their own standard deviations from what was found (a score interval), and
    `LEAST_ERROR` further out for the bias of the estimate.

    Reference
    ---------
    Mathai & Provost, *Quadratic Forms in Random Variables* (1992), theorem 3.2b.2.
    """
    parts = np.concatenate([logs.real, logs.imag])
    w = np.tile(weight, 2)
    through = w[:, None] * covariance
    square = float(parts @ (w * parts))
    spread = 2.0 * float(np.einsum("ij,ji->", through, through))
    along = 4.0 * float((w * parts) @ covariance @ (w * parts)) / max(square, 1e-300)
    found = square - float(np.trace(through))
    # (m − found)² = z² (spread + along·m), solved for m.
    middle = found + 0.5 * SURELY**2 * along
    inside = SURELY**2 * (spread + along * found) + 0.25 * SURELY**4 * along**2
    half = math.sqrt(max(0.0, inside))
    least, most = middle - half, middle + half
    miss, low, high = (math.sqrt(max(0.0, each)) for each in (found, least, most))
    # What windows bend of a response adds at most its own size to a root of squares.
    return miss, max(0.0, low - LEAST_ERROR), high + LEAST_ERROR
