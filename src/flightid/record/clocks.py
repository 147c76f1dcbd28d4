"""Files with clocks of their own: offset and drift between them, from a signal that both hold."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from flightid._native import cubic_spline
from flightid.conventions import Light
from flightid.errors import DataError
from flightid.findings import Finding
from flightid.frozen import dataclass
from flightid.record.stamps import mean_spacing_s

Array = NDArray[np.float64]
Signal = tuple[Array, Array]
"""Stamps, s, and samples, shape (n,) each."""
LEAST_CORRELATION = 0.8
"""Correlation of the shared channel below which it is not the same signal."""
RIVAL = 0.98
"""Part of the best correlation that no offset elsewhere may reach: a periodic signal has two."""
LEAST_OVERLAP = 0.25
"""Part of the shorter file that both have to cover."""
STRETCHES, FEWEST = 12, 5
"""Stretches whose own offsets tell interval and drift, and how few of them tell none."""
FASTEST_DRIFT = 5e-4
"""Difference of rates that is looked for: clocks of cheap crystals differ by 100 ppm."""
STEP, STEP_LEVEL = 0.25, 1e-3
"""Least step of a clock that is looked for, in samples, and the chance of seeing one in none."""
REGULAR = 0.9
"""Share of runs of one length, give or take a row, from which a log repeats a slower signal."""
RAREST = 0.01
"""Share of repeated rows above which they are no accidents: of 59 values a second in 60 rows."""
SMOOTHED = 9
"""Samples of the window under which signals are matched."""
SETTLED = 32
"""Samples beyond which a spline knows nothing of where its signal was cut: 0.27³² of it."""
COARSE = 0.5
"""Part of the sample time to which an offset should be known."""


@dataclass(frozen=True)
class ClockOffset:
    """Relation of two clocks: first = offset_s + (1 + drift) * second.

    Attributes
    ----------
    offset_s, drift : float
    half_width_s : float or None
        Half of the 95 % interval of the relation at both ends of the files' overlap, where an error
        of the drift counts most; None: nothing tells it.
    correlation : float or None
        Of the shared signal; None where the offset was told.
    sample_s : float
        The longer spacing of both signals, s.
    middle_s : float
        Stamp on the second clock in the middle of the overlap, where the offset is told in words.
    step_s : float
        Step of a clock within the overlap, s, of which a line knows nothing; 0 where none is seen.
    """

    offset_s: float
    drift: float
    half_width_s: float | None
    correlation: float | None
    sample_s: float
    middle_s: float = 0.0
    step_s: float = 0.0

    @property
    def said(self) -> str:
        """The relation in words."""
        if self.correlation is None:
            return f"clock offset {self.offset_s:.6g} s, as told"
        half = self.half_width_s or self.sample_s
        digits = int(np.clip(1 - np.floor(np.log10(half)), 0, 9)) if half > 0 else 9
        text = f"clock offset {self.offset_s + self.drift * self.middle_s:.{digits}f} s"
        text += "" if self.half_width_s is None else f" ± {self.half_width_s:.2g} s"
        text += f", drift {1e6 * self.drift:.3g} ppm" if self.drift else ""
        return f"{text} (correlation {self.correlation:.3f})"

    @property
    def finding(self) -> Finding | None:
        """What is to be doubted of it."""
        if self.correlation is None:
            return Finding(
                "clock-offset-told", Light.AMBER,
                f"the {self.said}: nothing of the files was compared",
                "name a column that both hold (join_on): an offset by 10 ms turns the phase at "
                "10 rad/s by 6 degrees",
            )  # fmt: skip
        if self.step_s:
            return Finding(
                "clock-steps", Light.RED,
                f"{self.said}: a clock steps by about {1e3 * self.step_s:.3g} ms within the "
                "overlap, so that no line relates the clocks",
                "cut the files where the clock was set, and join each part by itself",
            )  # fmt: skip
        if self.half_width_s is None or self.half_width_s > COARSE * self.sample_s:
            known = "nobody can say how well" if self.half_width_s is None else "within that alone"
            return Finding(
                "clock-offset-uncertain", Light.AMBER, f"{self.said}: it is known {known}",
                "join on a signal that moves more, or over a longer span",
            )  # fmt: skip
        return None


def clock_offset(first: Signal, second: Signal, name: str) -> ClockOffset:
    """Offset and drift of a second clock against a first, by a signal that both recorded.

    The offset with the largest correlation over the overlap is found at the coarser spacing; then
    each of some stretches is matched by itself, between samples. A line through them is offset and
    drift, their scatter about it the interval (Student's t). Values that a log repeats, since their
    source is slower, count where they are new; the interval then has half a row more. A lag between
    both sensors, such as a filter of one, is part of the offset.

    Parameters
    ----------
    first, second : (time_s, values)
        Each on its own clock.
    name : str
        Of the signal, for errors.

    Raises
    ------
    DataError
        Signals that do not correlate, or that correlate at other offsets as well.

    Reference
    ---------
    Knapp & Carter, *IEEE Trans. ASSP* 24 (1976): delay by the maximum of a correlation.
    """
    late_s = 0.0
    for signal in (first, second):
        late_s += 0.5 * mean_spacing_s(signal[0]) if _repeats(signal[1]) else 0.0
    first, second = _fresh(first), _fresh(second)
    sample_s = max(mean_spacing_s(first[0]), mean_spacing_s(second[0]))
    one, two = (_gridded(*pair, sample_s) for pair in (first, second))
    correlation = _correlations(one, two)
    best = int(np.argmax(correlation))
    found = float(correlation[best])
    opposite = -float(np.min(correlation))
    if opposite >= LEAST_CORRELATION and opposite > found:
        raise DataError(
            f"{name!r} of the files has opposite signs",
            found=f"correlation {-opposite:.3f}",
            needed="one sign",
            action="turn one of them, and look whether its axes are those of the other",
        )
    if not found >= LEAST_CORRELATION:
        raise DataError(
            f"{name!r} of the files is not one signal",
            found=f"correlation {found:.2f} at best",
            needed=f"at least {LEAST_CORRELATION}",
            action="name another shared channel (join_on), state clock_offset_s, or see to the "
            "unit of the stamps (join_time_unit)",
        )
    lags = np.arange(correlation.size) - (two.size - 1)
    far = np.abs(lags - lags[best]) > _width(correlation, best)
    if np.any(far) and float(np.max(correlation[far])) > RIVAL * found:
        rival = lags[far][int(np.argmax(correlation[far]))]
        raise DataError(
            f"{name!r} does not tell the offset of the clocks",
            found=f"correlation {found:.3f} at one offset, and about as much "
            f"{abs(rival - lags[best]) * sample_s:.4g} s away",
            needed="a signal that does not repeat",
            action="state clock_offset_s, or join where the signal does not repeat",
        )
    start = float(first[0][0] - second[0][0]) + float(lags[best]) * sample_s
    smooth = [_smooth(time_s[0], values, sample_s) for (time_s, _), values in (
        (first, one), (second, two)
    )]  # fmt: skip
    held = all(_is_held(values) for _, values in (first, second))
    floor_s = (sample_s if held else 0.0) + late_s
    return _of_stretches(smooth[0], smooth[1], start, sample_s, found, floor_s)


def _repeats(values: Array) -> bool:
    """Whether a log writes each value of a slower signal several times over.

    Of few new values the runs are of one length, give or take a row: those of a signal that stands
    still are not. Of few repeats most stand alone, and there are more than quantisation makes: by
    chance as many moves are 0 as +1 or as -1 quantum.

    Example
    -------
    >>> _repeats(np.repeat(np.arange(20.0), 3)), _repeats(np.arange(60.0))
    (True, False)
    >>> _repeats(np.sin(np.floor(np.arange(90) * 2 / 3)))
    True
    """
    moves = np.abs(np.diff(values))
    same = moves == 0.0
    repeats = np.count_nonzero(same)
    if 2 * repeats < same.size:
        by_chance = np.count_nonzero(moves[~same] < 1.5 * np.min(moves[~same]))
        together = np.count_nonzero(same[1:] & same[:-1])
        enough = max(FEWEST, by_chance, RAREST * same.size)
        return bool(repeats > enough and 2 * together < repeats)
    runs = np.diff(np.flatnonzero(~same))
    if runs.size < FEWEST or np.median(runs) < 2:
        return False
    # Two values that are alike by chance make one run of two.
    return float(np.mean(np.abs(runs - np.median(runs)) <= 1)) >= REGULAR


def _fresh(signal: Signal) -> Signal:
    """A signal whose repeated values are left out: each stands half a row before its first one."""
    time_s, values = signal
    if not _repeats(values):
        return signal
    new = np.flatnonzero(np.diff(values)) + 1
    return time_s[new] - 0.5 * mean_spacing_s(time_s), values[new]


def _is_held(values: Array) -> bool:
    """Whether a signal moves by jumps alone: its edges are known within a sample each."""
    moves = np.abs(np.diff(values))
    edges = moves > 0.25 * np.max(moves, initial=0.0)
    apart = not np.any(edges[1:] & edges[:-1])
    most = float(np.sum(moves[edges] ** 2)) > 0.9 * float(np.sum(moves**2))
    return bool(np.any(edges)) and apart and most


def _smooth(start_s: float, values: Array, step_s: float) -> Signal:
    """A gridded signal without what is fast, so that it can be read between samples.

    Interpolated noise is smaller between samples than at them, which draws a match there; a
    symmetric window takes that away and moves nothing.
    """
    window = np.hanning(SMOOTHED + 2)[1:-1]
    made = np.asarray(np.convolve(values, window / np.sum(window), "valid"), dtype=np.float64)
    first = start_s + step_s * (SMOOTHED - 1) / 2
    return np.asarray(first + step_s * np.arange(made.size), dtype=np.float64), made


def _gridded(time_s: Array, values: Array, step_s: float) -> Array:
    grid = np.arange(time_s[0], time_s[-1] + step_s / 2, step_s)
    made = np.interp(grid, time_s, values)
    return np.asarray(made - np.mean(made), dtype=np.float64)


def _correlations(one: Array, two: Array) -> Array:
    """Correlation over the overlap at each lag of the second; 0 where it is too short."""
    ones, twos = np.ones(one.size), np.ones(two.size)
    power = _slid(one**2, twos) * _slid(ones, two**2)
    count = np.rint(_slid(ones, twos))
    floor = 1e-12 * float(np.max(power, initial=0.0))
    enough = (count >= LEAST_OVERLAP * min(one.size, two.size)) & (power > floor)
    return np.where(enough, _slid(one, two) / np.sqrt(np.maximum(power, floor or 1.0)), 0.0)


def _slid(one: Array, two: Array) -> Array:
    """Sum of products at each lag."""
    size = one.size + two.size - 1
    padded = 1 << (size - 1).bit_length()
    product = np.fft.rfft(one, padded) * np.fft.rfft(two[::-1], padded)
    return np.asarray(np.fft.irfft(product, padded)[:size])


def _width(correlation: Array, best: int) -> int:
    """Samples from the peak to where the correlation has fallen to half of it."""
    low = np.flatnonzero(correlation < 0.5 * correlation[best])
    return int(np.min(np.abs(low - best))) if low.size else correlation.size


def _of_stretches(
    first: Signal,
    second: Signal,
    start_s: float,
    sample_s: float,
    correlation: float,
    floor_s: float,
) -> ClockOffset:
    """Offset, interval and drift from stretches of the overlap in which the signal moves."""
    from scipy.stats import t as student  # noqa: PLC0415 - commands that join nothing do without

    inside = (first[0] >= second[0][0] + start_s) & (first[0] <= second[0][-1] + start_s)
    moves = 0.1 * float(np.std(first[1][inside]))
    span_s = float(np.ptp(first[0][inside]))
    reach_s = 1.5 * sample_s + FASTEST_DRIFT * span_s
    middles, own = [], []
    for part in np.array_split(np.flatnonzero(inside), STRETCHES):
        if part.size < 16 or float(np.std(first[1][part])) <= moves:
            continue
        found = _matched((first[0][part], first[1][part]), second, start_s, reach_s, sample_s)
        if found is not None:
            own.append(found)
            middles.append(float(np.mean(first[0][part])))
    if len(own) < FEWEST:
        return ClockOffset(start_s, 0.0, None, correlation, sample_s)
    time_s, offsets_s = np.array(middles), np.array(own)
    centre_s = float(np.mean(time_s))
    design = np.stack([np.ones(time_s.size), time_s - centre_s], axis=1)
    line = np.linalg.lstsq(design, offsets_s, rcond=None)[0]
    spread = float(np.sum((time_s - centre_s) ** 2))
    error = float(np.sqrt(np.sum((offsets_s - design @ line) ** 2) / (time_s.size - 2)))
    slope_error = error / np.sqrt(spread)
    farther_s = float(np.max(np.abs(first[0][inside][[0, -1]] - centre_s)))
    ends_s = float(np.hypot(error / np.sqrt(time_s.size), slope_error * farther_s))
    # Edges of held signals lie anywhere between two samples of the common grid, for many stretches
    # alike where clocks drift little: that is added. Both ends are to hold.
    half = float(student.ppf(1.0 - 0.05 / 4.0, time_s.size - 2)) * ends_s + floor_s
    step_s = _step(design, offsets_s, max(STEP * sample_s, 2 * floor_s))
    # Stamps t of the first and s of the second: t - s = offset + slope (t - centre).
    drift = float(line[1] / (1 - line[1]))
    at_zero = float((line[0] - line[1] * centre_s) / (1 - line[1]))
    if abs(drift) > FASTEST_DRIFT:
        raise DataError(
            "the clocks differ by more than clocks do",
            found=f"drift {1e6 * drift:.3g} ppm",
            needed=f"at most {1e6 * FASTEST_DRIFT:.3g} ppm",
            action="look for a clock that was set within the files, and cut them there",
        )
    middle_s = centre_s - float(line[0])
    return ClockOffset(at_zero, drift, half, correlation, sample_s, middle_s, step_s)


def _step(design: Array, offsets_s: Array, least_s: float) -> float:
    """Step between stretches that a line with one explains far better than a line; else 0."""
    from scipy.stats import f as fisher  # noqa: PLC0415 - as above

    n = offsets_s.size
    line = np.linalg.lstsq(design, offsets_s, rcond=None)[0]
    whole = float(np.sum((offsets_s - design @ line) ** 2))
    best, size = whole, 0.0
    for cut in range(2, n - 1):
        with_step = np.column_stack([design, np.arange(n) >= cut])
        found = np.linalg.lstsq(with_step, offsets_s, rcond=None)[0]
        left = float(np.sum((offsets_s - with_step @ found) ** 2))
        if left < best:
            best, size = left, float(found[2])
    gain = (whole - best) / max(best / max(n - 4, 1), np.finfo(float).tiny)
    sure = float(fisher.sf(gain, 1, max(n - 4, 1))) * n < STEP_LEVEL
    return size if sure and abs(size) > least_s else 0.0


def _matched(
    part: Signal, second: Signal, start_s: float, reach_s: float, sample_s: float
) -> float | None:
    """Offset at which a stretch fits the second signal best; None where it lies at the edge."""
    time_s, values = part
    ends_s = time_s[[0, -1]] - start_s + 1.5 * reach_s * np.array([-1.0, 1.0])
    low, high = np.searchsorted(second[0], ends_s) + np.array([-SETTLED, SETTLED])
    near = slice(max(0, low), high)
    stamps, samples = second[0][near], second[1][near]

    def agreement(offset_s: float) -> float:
        at = time_s - offset_s
        inside = (at >= stamps[0]) & (at <= stamps[-1])
        pair = values[inside], cubic_spline(stamps, samples, at[inside])
        if pair[0].size < 16 or min(float(np.ptp(each)) for each in pair) == 0.0:
            return -1.0
        return float(np.corrcoef(*pair)[0, 1])

    step_s = sample_s / 4
    tried = start_s + step_s * np.arange(-np.ceil(reach_s / step_s), np.ceil(reach_s / step_s) + 1)
    reached = np.array([agreement(each) for each in tried])
    top = int(np.argmax(reached))
    if top in (0, tried.size - 1):
        return None
    below, best, above = reached[top - 1 : top + 2]
    bend = below - 2 * best + above
    return float(tried[top] + (0.5 * step_s * (below - above) / bend if bend < 0 else 0.0))
