"""What is read off a closed loop: rise, overshoot, delay, bandwidth, each with an interval."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from flightid.review.deconvolution import LoopDraws
from flightid.uncertainty.estimate import Estimate, Reading
from flightid.uncertainty.quantiles import LEVEL, tails
from flightid.uncertainty.uneven import DrawnEnds, Reaching

Array = NDArray[np.float64]
END = 0.2
"""Share of the window, at its end, whose mean is the level that the step reaches."""
SETTLED = 0.1
"""Of the level: within it a step has settled."""
STRIDE = 0.15
"""Share of the window whose mean, the last, is held against the mean of the one before it. Moves
between them add up over one more window: a step that would leave its settled band has no level."""
CREEP = 0.03
"""Share of the level that a step surely gains or loses over one more window, by its slope, before
it is said to (ours): integrators bring the last of a rate over seconds, which is 5 % and more of a
window; attitudes that settled lose the last two percent of what they overshot."""
RISE = 2
"""Place of the rise time among the readings of a step."""
SAME_RISE = 0.1
"""Of a rise time: what half of the window tells otherwise by more is the window's, not the loop's.
A tenth is what counts between flights, too."""
RISES, FALLS = "still rises", "still falls"
TOLD = 0.95
"""Least share of the draws in which a crossing exists: else it is not told."""
HIGHEST, LOWEST = 0.3, 0.1
"""Of the sampling rate, and of the frequency of the phase delay: nothing is read beyond."""
BANDWIDTH, GAIN = "bandwidth at -3 dB", "gain at "
SEVEN_TENTHS = float(np.sqrt(0.5))
UNTOLD = "not reached in every loop that the data allow"


def step_features(
    steps: Array, time_s: Array, *, of_asked: bool | None = None
) -> tuple[Reading, ...]:
    """Level, delay, rise, overshoot and settling of step responses, row 0 the estimate.

    All are of the level that steps reach in their window, the mean of its last fifth, but an
    overshoot is of what is asked (`of_asked`) where the step ends within a tenth of that, each draw
    by its own end: a level that may lie on either side leaves either overshoot possible. Of one
    that still moves there no settling is told, no overshoot if it is highest there, and no rise
    time that goes by where the window ends.
    """
    read = window_features(steps, time_s, of_asked=of_asked)
    if not (way := creep(steps)):
        return read
    why = f"{way} where {_window(time_s)} ends: "
    untold = {"settling time": f"{why}settling is not seen"}
    if way == RISES and time_s[np.argmax(steps[0])] >= (1.0 - END) * time_s[-1]:
        untold["overshoot"] = f"{why}none is seen"
    if _rise_goes_by_window(steps, time_s):
        untold["rise time"] = f"{why}its last tenths are as long as one looks"
    return tuple(
        Estimate(each.name, None, each.unit, reason=untold[each.name])
        if each.name in untold
        else each
        for each in read
    )


def _rise_goes_by_window(steps: Array, time_s: Array) -> bool:
    """Whether half of the window would tell a rise time that differs by more than counts."""
    half = time_s <= 0.5 * time_s[-1]
    (whole, short) = (
        window_features(steps[:, part], time_s[part])[RISE].value
        for part in (np.ones(half.size, dtype=np.bool_), half)
    )
    return whole is None or short is None or abs(whole - short) > SAME_RISE * whole


def _window(time_s: Array) -> str:
    return f"this window of {time_s[-1]:.3g} s"


def still_moves(steps: Array) -> bool:
    """Whether steps drift at their end by more than counts, and than their draws allow for none."""
    drift, low, high = _drift(steps)
    return abs(drift) > SETTLED and not low <= 0.0 <= high


def creep(steps: Array) -> str:
    """``"still rises"`` or ``"still falls"`` of steps that surely do at their end; else empty."""
    _, low, high = _drift(steps)
    return RISES if low > CREEP else FALLS if high < -CREEP else ""


def _drift(steps: Array) -> tuple[float, float, float]:
    """What steps would move over one more window, of their level: the estimate, then its ends."""
    count = max(1, round(STRIDE * steps.shape[1]))
    last = steps[:, -count:].mean(axis=1)
    drift = last - steps[:, -2 * count : -count].mean(axis=1)
    if last[0] == 0.0:
        return 0.0, 0.0, 0.0
    ends = np.quantile(drift[1:], tails(LEVEL))
    shares = np.array([drift[0], *ends]) / (STRIDE * abs(last[0]))
    return float(shares[0]), float(shares[1]), float(shares[2])


def follows(steps: Array, time_s: Array) -> bool:
    """Whether the estimate's step ends within a tenth of what is asked."""
    return bool(abs(_levels(steps[:1], time_s)[0] - 1.0) <= SETTLED)


def _levels(steps: Array, time_s: Array) -> Array:
    return np.asarray(steps[:, time_s >= (1.0 - END) * time_s[-1]].mean(axis=1))


def window_features(
    steps: Array, time_s: Array, *, of_asked: bool | None = None
) -> tuple[Reading, ...]:
    """The same of the mean that the window ends at, whether the step has settled there or not."""
    level = _levels(steps, time_s)
    shares = steps / np.where(level > 0.0, level, np.nan)[:, None]
    near = np.abs(level - 1.0) <= SETTLED
    asked = near if of_asked is None else np.full(len(level), of_asked)
    half = _crossings(shares, time_s, 0.5)
    rise = _crossings(shares, time_s, 0.9) - _crossings(shares, time_s, 0.1)
    return (
        _reading("level", level, "1"),
        _reading("delay to half", half, "s"),
        _reading("rise time", rise, "s"),
        _overshoot(np.where(asked, _overshoots(steps), _overshoots(shares))),
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
    """Gain and phase delay at a low frequency, and bandwidths by gain and by phase.

    The bandwidth by gain is where the loop first follows with less than 0.71 of what is asked, 3 dB
    below one: a loop that lost gain has less of it, whatever its shape.
    """
    highest, base = HIGHEST / loop.sample_time_s, 0.5 * slowest_hz
    below = np.geomspace(LOWEST * slowest_hz, base, 80)[:-1]
    grid = np.concatenate([below, np.geomspace(base, highest, 240)])
    response = loop.response(2.0 * np.pi * grid)
    at_base = response[:, below.size]
    phase = np.unwrap(np.angle(response[:, below.size :]), axis=1)
    phase -= 2.0 * np.pi * np.round(phase[:, :1] / (2.0 * np.pi))
    slow = loop.response(np.array([2.0 * np.pi * slowest_hz]))[:, 0]
    late = -np.angle(slow) / (2.0 * np.pi * slowest_hz)
    above = f"above {highest:.3g} Hz, or not told below it by these data"
    lost = f"it follows with less than 0.71 of what is asked at {grid[0]:.2g} Hz already"

    def turns(deg: float) -> Array:
        return _falls(phase, np.radians(deg), grid[below.size :])

    gain = np.abs(response)
    weak = gain[0, 0] <= SEVEN_TENTHS
    return (
        _reading(f"phase delay at {slowest_hz:g} Hz", late, "s"),
        _reading(f"{GAIN}{base:g} Hz", np.abs(at_base), "1"),
        _reading(BANDWIDTH, _falls(gain, SEVEN_TENTHS, grid), "Hz", lost if weak else above),
        _reading("frequency at -90 deg", turns(-90.0), "Hz", above),
        _reading("frequency at -180 deg", turns(-180.0), "Hz", above),
    )


def _falls(curves: Array, value: float, at: Array) -> Array:
    """Where each curve first falls to a value; NaN where it begins below, or never does."""
    return np.where(curves[:, 0] <= value, np.nan, _crossings(-curves, at, -value))


def _crossings(curves: Array, at: Array, value: float) -> Array:
    """Where each curve first reaches a value, by straight lines; NaN where it does not."""
    above = curves >= value
    index = np.argmax(above, axis=1)
    rows, before = np.arange(len(curves)), np.maximum(index - 1, 0)
    left, right = curves[rows, before], curves[rows, index]
    with np.errstate(invalid="ignore", divide="ignore"):
        way = at[before] + (at[index] - at[before]) * (value - left) / (right - left)
    found = np.where(index == 0, at[0], way)
    return np.where(above.any(axis=1), found, np.nan)


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


def _overshoot(values: Array) -> Reading:
    """Of draws whose level lies on the other side of the limit each goes by its own.

    Where those are most, the estimate by its own level may lie beyond them: ends reach it.
    """
    found = _reading("overshoot", values, "%")
    told = np.isfinite(values)
    if found.value is not None or not told[0] or np.mean(told) < TOLD:
        return found
    ends = Reaching(DrawnEnds(values[1:][told[1:]]), float(values[0]))
    return Estimate("overshoot", float(values[0]), "%", ends=ends)


def _reading(name: str, values: Array, unit: str, why: str = UNTOLD) -> Reading:
    told = np.isfinite(values)
    if told[0] and np.mean(told) >= TOLD:
        found = Estimate(name, float(values[0]), unit, ends=DrawnEnds(values[1:][told[1:]]))
        ends = found.interval95
        # Draws that scatter about another crossing than the estimate's tell of neither.
        if ends is not None and ends[0] <= values[0] <= ends[1]:
            return found
    return Estimate(name, None, unit, reason=why)
