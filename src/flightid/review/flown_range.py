"""What flown gains promise: margins over all typical vehicles that would fly as this one did."""

from __future__ import annotations

import math
from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from flightid.control.autopilots.axis_loop import AxisLoop
from flightid.control.autopilots.from_log import autopilot_of, axis_loop_of
from flightid.control.margins.margins import GAIN_GUIDE_DB, PHASE_GUIDE_DEG
from flightid.conventions import Light
from flightid.errors import FlightidError
from flightid.findings import Finding
from flightid.frozen import dataclass
from flightid.logs import Log
from flightid.review.loop_response import LoopResponse
from flightid.review.loops import SLOWEST_HZ
from flightid.review.step_features import BANDWIDTH, GAIN, SEVEN_TENTHS
from flightid.review.typical_axes import TYPICAL, TypicalAxis
from flightid.table import Cell, Column, Table
from flightid.uncertainty.estimate import Reading
from flightid.uncertainty.quantiles import half_width

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]
DRAWN, ROUNDS, KEPT, FEWEST = 1500, 2, 400, 50
"""Vehicles of each round, further rounds, those whose margins are read, and the effective number
that must fly so before anything is said."""
WIDER, LEAST_SPREAD = 2.0, 0.01
"""Of a round's covariance over the last one's, and of the range, so that none is missed."""
FEWEST_READINGS = 3
LEADS_S = (1e-3, 0.5)
"""Of the yaw of rotors, which push the frame as they speed up; other axes have none."""
UNTOLD = "the flight tells too few bandwidths and delays of it"
UNLIKE = "hardly any typical vehicle answers so"
BY_FREQUENCY = ("phase delay", GAIN, BANDWIDTH, "frequency at")
CROSSOVERS_RAD_S = (2.0, 80.0)
SLOWEST = SLOWEST_HZ["rate"]
GRID = np.geomspace(1.0, 500.0, 100)
LOGS = np.log(GRID)
SIMPLE = 0.05
"""Relative size by which so simple a vehicle may miss what flew, beside the flight's own errors."""
ENDS = (0.025, 0.975)
KINDS = {
    "arducopter": "multirotor",
    "arduheli": "helicopter",
    "arduplane": "aeroplane",
    "px4_multicopter": "multirotor",
    "px4_fixed_wing": "aeroplane",
    "betaflight": "small multirotor",
    "inav": "small multirotor",
}
"""Typical vehicle of an autopilot's controllers."""


@dataclass(frozen=True)
class FlownRange:
    """Margins of one rate loop under the gains that flew, over a range of vehicles.

    Attributes
    ----------
    axis : str
    vehicles : float
        Effective number of draws that would fly as this one did; too few leave no numbers.
    crossover_rad_s, phase_margin_deg, gain_margin_db : tuple of float, or None
        What 95 % of them have; None where one of them has none, or for the reason.
    reason : str
        Why nothing is told; empty where something is.

    Example
    -------
    >>> FlownRange("roll", 3, None, None, None).finding("flight.bin") is None
    True
    """

    axis: str
    vehicles: float
    crossover_rad_s: tuple[float, float] | None
    phase_margin_deg: tuple[float, float] | None
    gain_margin_db: tuple[float, float] | None
    reason: str = ""

    def finding(self, log: str) -> Finding | None:
        """Whether the gains keep their guides over the whole range; None where nothing is told."""
        phase, gain = self.phase_margin_deg, self.gain_margin_db
        if phase is None:
            return None
        said = f"{self.axis}: the flown gains keep {_words(phase)} deg of phase margin"
        said += f" and {_words(gain)} dB of gain margin" if gain else ""
        said += " in 95 % of the typical vehicles that would fly as this one did"
        code = f"flown-range-{self.axis}"
        guides = f"{PHASE_GUIDE_DEG:g} deg and {GAIN_GUIDE_DB:g} dB"
        if phase[0] >= PHASE_GUIDE_DEG and (gain is None or gain[0] >= GAIN_GUIDE_DB):
            return Finding(code, Light.GREEN, said)
        if phase[1] < PHASE_GUIDE_DEG or (gain is not None and gain[1] < GAIN_GUIDE_DB):
            said += f": less than {guides}"
            return Finding(code, Light.AMBER, said, f"lower the gains of {self.axis}")
        action = f"sweeps tell which: flightid plan {log}"
        return Finding(code, Light.UNKNOWN, f"{said}: {guides} are not certain", action)


def flown_ranges(log: Log, loops: Iterable[LoopResponse]) -> tuple[FlownRange, ...]:
    """Margins of rate loops whose response a flight tells, over vehicles that would answer so.

    Parameters
    ----------
    log : Log
        Whose gains are flown.
    loops : iterable of LoopResponse

    Notes
    -----
    Vehicles are a gain, a lag, a motor lag and a delay, drawn over the plausible range of their
    kind, any gain, and weighed by how well their closed loop under the flown controller has the
    bandwidth and the phase that the flight shows, within its errors and `SIMPLE`. No model is
    claimed: a sweep tells which of them this vehicle is.

    Reference
    ---------
    Cappé et al., *J. Computational and Graphical Statistics* 13 (2004): population Monte Carlo.
    """
    try:
        kind = KINDS.get(autopilot_of(log), "multirotor")
    except FlightidError:
        return ()
    found = []
    for each in loops:
        if each.loop == "rate" and each.is_told:
            try:
                loop = axis_loop_of(log, each.axis)
            except FlightidError:
                continue
            by_torque = each.axis == "yaw" and kind.endswith("multirotor")
            found.append(_range(each, loop, TYPICAL[kind], turned_by_torque=by_torque))
    return tuple(found)


def range_table(found: Iterable[FlownRange]) -> Table:
    """A line for each axis."""
    columns = (
        Column("axis"), Column("crossover", "Hz"), Column("phase margin", "deg"),
        Column("gain margin", "dB"),
    )  # fmt: skip
    rows: list[tuple[Cell, ...]] = []
    reasons: dict[str, list[str]] = {}
    for each in found:
        hertz = each.crossover_rad_s and tuple(end / math.tau for end in each.crossover_rad_s)
        ends = (hertz, each.phase_margin_deg, each.gain_margin_db)
        told = (_words(end) if end else None for end in ends)
        rows.append((each.axis, *told))
        if each.reason:
            reasons.setdefault(each.reason, []).append(each.axis)
    notes = [
        "Rate loops of typical vehicles of any gain, their lags and delays within threefold of a "
        "middle-sized one, that would answer set-points as this flight shows; 95 % of them. A "
        "model of sweeps tells which of them this vehicle is."
    ]
    notes += [f"–: {', '.join(axes)}: {reason}." for reason, axes in reasons.items()]
    if any(each.gain_margin_db is None and not each.reason for each in found):
        notes.append("Gain margin –: not every one of them has one.")
    return Table("Flown gains, over a range of vehicles", columns, tuple(rows), tuple(notes))


def _words(ends: tuple[float, ...]) -> str:
    return f"{ends[0]:.3g} to {ends[1]:.3g}"


def _range(
    told: LoopResponse, loop: AxisLoop, typical: TypicalAxis, *, turned_by_torque: bool
) -> FlownRange:
    """Rounds of draws: over the whole range, then about those that answer so."""
    random = np.random.default_rng(0)
    wanted = [r for r in told.readings if r.value is not None and r.name.startswith(BY_FREQUENCY)]
    if len(wanted) < FEWEST_READINGS:
        return FlownRange(told.axis, 0.0, None, None, None, UNTOLD)
    leads = LEADS_S if turned_by_torque else ()
    low, high = (
        np.log([*typical.ends(way), *leads[int(way > 0) :][:1], CROSSOVERS_RAD_S[way > 0]])
        for way in (-1.0, 1.0)
    )
    at = random.uniform(low, high, (DRAWN, low.size))
    weight = _weights(-0.5 * _Candidates(at, loop).miss(wanted))
    for _ in range(ROUNDS):
        if weight.sum() <= 0.0:
            break
        share = weight / weight.sum()
        middle = share @ at
        spread = WIDER * np.einsum("n,ni,nj->ij", share, at - middle, at - middle)
        spread += np.diag(np.square(LEAST_SPREAD * (high - low)))
        at = random.multivariate_normal(middle, spread, DRAWN)
        at = at[((at >= low) & (at <= high)).all(axis=1)]
        off = at - middle
        near = 0.5 * np.einsum("ni,ij,nj->n", off, np.linalg.inv(spread), off)
        weight = _weights(near - 0.5 * _Candidates(at, loop).miss(wanted))
    total = weight.sum()
    count = float(total**2 / np.square(weight).sum()) if total > 0.0 else 0.0
    if count < FEWEST:
        return FlownRange(told.axis, count, None, None, None, UNLIKE)
    chosen = random.choice(len(at), size=KEPT, p=weight / total)
    flown = _Candidates(at[chosen], loop)
    phase, gain = flown.margins()
    return FlownRange(told.axis, count, _ends(np.exp(at[chosen, -1])), _ends(phase), _ends(gain))


def _weights(logs: Array) -> Array:
    """Weights by their logarithms, the largest one; all zero where none is finite."""
    most = logs.max(initial=-np.inf)
    return np.exp(logs - most) if np.isfinite(most) else np.zeros(logs.size)


def _ends(values: Array) -> tuple[float, float] | None:
    """What 95 % have; None where one of them has no such number."""
    if not np.isfinite(values).all():
        return None
    low, high = np.quantile(values, ENDS)
    return float(low), float(high)


class _Candidates:
    """Vehicles under one controller: logarithms of lags, delay, lead if any, and crossover."""

    def __init__(self, logs: Array, loop: AxisLoop) -> None:
        lag, delay, motor, *lead, crossover = np.exp(logs).T[:, :, None]
        s = 1j * GRID
        plants = np.exp(-delay * s) / ((lag * s + 1.0) * (motor * s + 1.0))
        for each in lead:
            plants = plants * (each * s + 1.0)
        opened = plants * loop.feedback(GRID, gyro="filtered", with_hold=False)
        scale = np.exp(-_at(np.log(np.abs(opened)), np.log(crossover[:, 0])))[:, None]
        self.opened = scale * opened
        forward = loop.forward(GRID, with_hold=False) * loop.set_point_delay(GRID)
        self.closed = scale * plants * forward / (1.0 + self.opened)
        self.phase = np.unwrap(np.angle(self.opened), axis=1)

    def miss(self, wanted: Iterable[Reading]) -> Array:
        """Squared misses of what a flight tells, in errors; infinite of loops that are unstable."""
        gain, phase = np.abs(self.closed), np.unwrap(np.angle(self.closed), axis=1)
        phase -= 2.0 * np.pi * np.round(phase[:, :1] / (2.0 * np.pi))
        total = np.where(self.margins()[1] <= 0.0, np.inf, 0.0)
        for each in wanted:
            assert each.value is not None
            if each.name.startswith("phase delay"):
                omega = math.tau * SLOWEST
                found = -_at(phase, np.full(len(phase), math.log(omega))) / omega
            elif each.name.startswith(GAIN):
                found = np.exp(
                    _at(np.log(gain), np.full(len(gain), math.log(0.5 * math.tau * SLOWEST)))
                )
            elif each.name == BANDWIDTH:
                found = _falls(gain, SEVEN_TENTHS) / math.tau
            else:
                found = _falls(phase, math.radians(float(each.name.split()[-2]))) / math.tau
            error = math.hypot(SIMPLE * each.value, (each.half_width95 or 0.0) / half_width())
            total = total + np.square((found - each.value) / error)
        return np.asarray(total)

    def margins(self) -> tuple[Array, Array]:
        """Least phase margin, deg, and gain margin, dB; NaN where the grid holds none."""
        gain_db = 20.0 * np.log10(np.abs(self.opened))
        change = gain_db[:, :-1] * gain_db[:, 1:] < 0.0
        share = gain_db[:, :-1] / np.where(change, gain_db[:, :-1] - gain_db[:, 1:], 1.0)
        angle = self.phase[:, :-1] + share * np.diff(self.phase, axis=1)
        least = np.degrees(np.min(np.where(change, angle + np.pi, np.inf), axis=1))
        turned = _falls(self.phase, -np.pi)
        known = np.where(np.isfinite(turned), turned, GRID[-1])
        return least, np.where(np.isfinite(turned), -_at(gain_db, np.log(known)), np.nan)


def _falls(curves: Array, value: float) -> Array:
    """Frequency at which each curve first falls to a value, rad/s; infinite where it does not."""
    below = curves <= value
    index = np.argmax(below, axis=1)
    rows, before = np.arange(len(curves)), np.maximum(index - 1, 0)
    left, right = curves[rows, before], curves[rows, index]
    share = np.where(left > right, (left - value) / np.where(left > right, left - right, 1.0), 0.0)
    logs = LOGS[before] + np.clip(share, 0.0, 1.0) * (LOGS[index] - LOGS[before])
    return np.where(below.any(axis=1), np.exp(logs), np.inf)


def _at(curves: Array, log_omega: Array) -> Array:
    """Each curve at a frequency of its own, by lines over the logarithm."""
    place = np.interp(log_omega, LOGS, np.arange(LOGS.size))
    left = np.minimum(place.astype(int), LOGS.size - 2)
    rows, share = np.arange(len(curves)), place - left
    return np.asarray((1.0 - share) * curves[rows, left] + share * curves[rows, left + 1])
