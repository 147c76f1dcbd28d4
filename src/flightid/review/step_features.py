"""What is read off a closed loop: rise, overshoot, delay, bandwidth, each with an interval."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from flightid.review.deconvolution import LoopDraws
from flightid.uncertainty.estimate import Estimate, Reading
from flightid.uncertainty.quantiles import LEVEL, tails
from flightid.uncertainty.uneven import DrawnEnds

Array = NDArray[np.float64]
END = 0.2
"""Share of the window, at its end, whose mean is the level that the step reaches."""
SETTLED = 0.1
"""Of the level: within it a step has settled."""
STRIDE = 0.15
"""Share of the window whose mean, the last, is held against the mean of the one before it. Moves
between them add up over one more window: a step that would leave its settled band has no level."""
CREEP = 0.01
"""Share of the level that a step still gains or loses over one more window before it is said to
(ours): integrators bring the last of a rate over seconds, and below that nobody minds."""
RISES, FALLS = "still rises", "still falls"
TOLD = 0.95
"""Least share of the draws in which a crossing exists: else it is not told."""
HIGHEST = 0.3
"""Of the sampling rate: frequencies above it are not read."""


def step_features(steps: Array, time_s: Array) -> tuple[Reading, ...]:
    """Level, delay, rise, overshoot and settling of step responses, row 0 the estimate.

    No numbers where the step still moves at the end of its window: they all stand on its level.
    Where it creeps there they are of what it reaches in this window, and no settling is seen.
    """
    if still_moves(steps):
        why = f"not settled in {_window(time_s)}"
        read = window_features(steps, time_s)
        return tuple(Estimate(each.name, None, each.unit, reason=why) for each in read)
    return reached_features(steps, time_s)


def reached_features(steps: Array, time_s: Array) -> tuple[Reading, ...]:
    """The same of what steps reach in their window, settled or not; then no settling is told.

    Nor is an overshoot of one that is highest where it ends, and rises there.
    """
    read = window_features(steps, time_s)
    if not (way := creep(steps)):
        return read
    why = f"{way} where {_window(time_s)} ends: "
    untold = {"settling time": f"{why}settling is not seen"}
    if way == RISES and time_s[np.argmax(steps[0])] >= (1.0 - END) * time_s[-1]:
        untold["overshoot"] = f"{why}none is seen"
    return tuple(
        Estimate(each.name, None, each.unit, reason=untold[each.name])
        if each.name in untold
        else each
        for each in read
    )


def _window(time_s: Array) -> str:
    return f"this window of {time_s[-1]:.3g} s"


def still_moves(steps: Array) -> bool:
    """Whether steps drift at their end by more than counts, and than their draws allow for none."""
    return abs(_drift(steps)) > SETTLED


def creep(steps: Array) -> str:
    """``"still rises"`` or ``"still falls"`` of steps that do at their end; else empty."""
    drift = _drift(steps)
    if abs(drift) <= CREEP:
        return ""
    return RISES if drift > 0.0 else FALLS


def _drift(steps: Array) -> float:
    """What the estimate would move over one more window, of its level; 0 where draws allow none."""
    count = max(1, round(STRIDE * steps.shape[1]))
    last = steps[:, -count:].mean(axis=1)
    drift = last - steps[:, -2 * count : -count].mean(axis=1)
    low, high = np.quantile(drift[1:], tails(LEVEL))
    if low <= 0.0 <= high or last[0] == 0.0:
        return 0.0
    return float(drift[0] / (STRIDE * abs(last[0])))


def window_features(steps: Array, time_s: Array) -> tuple[Reading, ...]:
    """The same of the mean that the window ends at, whether the step has settled there or not."""
    level = steps[:, time_s >= (1.0 - END) * time_s[-1]].mean(axis=1)
    shares = steps / np.where(level > 0.0, level, np.nan)[:, None]
    half = _crossings(shares, time_s, 0.5)
    rise = _crossings(shares, time_s, 0.9) - _crossings(shares, time_s, 0.1)
    return (
        _reading("level", level, "1"),
        _reading("delay to half", half, "s"),
        _reading("rise time", rise, "s"),
        _reading("overshoot", _overshoots(shares), "%"),
        _reading("settling time", _settling(shares, time_s), "s"),
    )


def _overshoots(shares: Array) -> Array:
    """By how much each curve passes one, %, without what its errors lift its highest point.

    A peak is taken where errors are highest, so it lies above the true one as peaks of draws lie
    above the estimate's. Draws are about the estimate without that, and as much wider as it is.

    Reference: Efron & Tibshirani, *An Introduction to the Bootstrap*, section 10.6.
    """
    peaks = 100.0 * (shares.max(axis=1) - 1.0)
    told = np.isfinite(peaks)
    told[0] = False
    if not told.any() or not np.isfinite(peaks[0]):
        return np.asarray(np.maximum(peaks, 0.0))
    centre = float(peaks[told].mean())
    lifted, spread = centre - peaks[0], float(peaks[told].std())
    wider = np.hypot(spread, lifted) / spread if spread > 0.0 else 1.0
    moved = peaks[0] - lifted + wider * (peaks - centre)
    moved[0] = peaks[0] - lifted
    return np.asarray(np.maximum(moved, 0.0))


def frequency_features(loop: LoopDraws, slowest_hz: float) -> tuple[Reading, ...]:
    """Bandwidths by gain and phase, and the phase delay at a low frequency."""
    highest = HIGHEST / loop.sample_time_s
    grid = np.geomspace(0.5 * slowest_hz, highest, 240)
    response = loop.response(2.0 * np.pi * grid)
    gain = np.abs(response) / np.abs(response[:, :1])
    phase = np.unwrap(np.angle(response), axis=1)
    phase -= 2.0 * np.pi * np.round(phase[:, :1] / (2.0 * np.pi))
    slow = loop.response(np.array([2.0 * np.pi * slowest_hz]))[:, 0]
    late = -np.angle(slow) / (2.0 * np.pi * slowest_hz)

    def falls(curve: Array, value: float) -> Array:
        found = _crossings(-curve, grid, -value)
        return np.where(curve[:, 0] <= value, np.nan, found)

    return (
        _reading(f"phase delay at {slowest_hz:g} Hz", late, "s"),
        _reading("bandwidth at -3 dB", falls(gain, np.sqrt(0.5)), "Hz", highest),
        _reading("frequency at -90 deg", falls(phase, -np.pi / 2.0), "Hz", highest),
        _reading("frequency at -180 deg", falls(phase, -np.pi), "Hz", highest),
    )


def _crossings(curves: Array, at: Array, value: float) -> Array:
    """Where each curve first reaches a value, by straight lines; NaN where it does not."""
    above = curves >= value
    index = np.argmax(above, axis=1)
    found = np.full(len(curves), np.nan)
    for row in np.flatnonzero(above.any(axis=1)):
        k = index[row]
        if k == 0:
            found[row] = at[0]
            continue
        left, right = curves[row, k - 1], curves[row, k]
        found[row] = at[k - 1] + (at[k] - at[k - 1]) * (value - left) / (right - left)
    return found


def _settling(shares: Array, time_s: Array) -> Array:
    """When each curve enters its settled band for good, by straight lines; NaN if never."""
    outside = np.abs(shares - 1.0) > SETTLED
    last = shares.shape[1] - 1 - np.argmax(outside[:, ::-1], axis=1)
    rows = np.arange(len(shares))
    after = np.minimum(last + 1, time_s.size - 1)
    with np.errstate(invalid="ignore", divide="ignore"):
        # The edge on the side that it comes from.
        edge = 1.0 + SETTLED * np.sign(shares[rows, last] - 1.0)
        way = (edge - shares[rows, last]) / (shares[rows, after] - shares[rows, last])
    found = time_s[last] + np.clip(way, 0.0, 1.0) * (time_s[after] - time_s[last])
    found = np.where(outside.any(axis=1), found, time_s[0])
    return np.where(last >= shares.shape[1] - 2, np.nan, found)


def _reading(name: str, values: Array, unit: str, highest: float | None = None) -> Reading:
    told = np.isfinite(values)
    if told[0] and np.mean(told) >= TOLD:
        found = Estimate(name, float(values[0]), unit, ends=DrawnEnds(values[1:][told[1:]]))
        ends = found.interval95
        # Draws that scatter about another crossing than the estimate's tell of neither.
        if ends is not None and ends[0] <= values[0] <= ends[1]:
            return found
    why = "not reached in every loop that the data allow"
    if highest is not None:
        why = f"above {highest:.3g} Hz, or not told below it by these data"
    return Estimate(name, None, unit, reason=why)
