"""Noise of the gyroscope: its spectrum in the air, against throttle, and peaks by name."""

from __future__ import annotations

from dataclasses import field

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

from flightid.control.autopilots import AXES
from flightid.control.autopilots.output_noise import GyroSpectrum
from flightid.control.gyro import Gyro
from flightid.frozen import dataclass
from flightid.inspection.signals import Signal, Span, find, inside
from flightid.logs import Log
from flightid.result import Result
from flightid.review.gyro_windows import GyroWindows, gyro_windows
from flightid.review.rank_correlation import rank_correlation
from flightid.table import Column, Table
from flightid.uncertainty.quantiles import chi_squared_quantile, shown, tails

Array = NDArray[np.float64]
BINS = 8
FEWEST_IN_BIN = 3
LEAST_THROTTLE = 0.03
"""Range, share of full, below which there is nothing to see across throttle."""
LOWEST_HZ = 20.0
"""Peaks below it are motion of the vehicle and its loops."""
HIGHEST = 0.45
"""Of the sampling rate."""
FLOOR_WIDTH = 0.5
"""Of a frequency: how wide the floor beneath a peak is looked for."""
FALSE_PEAKS = 0.01
STANDING_OUT = 2.0
"""A peak is at least so many times its floor: less is a slope of it."""
MOST_PEAKS = 6
NO_THROTTLE = (
    "Not shown by throttle: it is not logged, moved by less than 3 %, or too few windows are known."
)
WHERE = {"raw": "ahead of the autopilot's filters", "filtered": "behind the autopilot's filters"}
MOVES = "moves up with throttle: motors or propellers"
FALLS = "moves down as throttle goes up: motors, folded at half of the logging rate"
STAYS = "stays where throttle moves by a third: frame, mount or a payload"


@dataclass(frozen=True)
class NoisePeak:
    """A peak of the spectrum.

    Attributes
    ----------
    axis : str
        Where it is highest.
    frequency_hz : float
        Of its top; known to one resolution either way.
    height : float
        Power over that of the floor about it.
    source : str
        What it is likely to be, by what; empty where the flight does not tell.
    """

    axis: str
    frequency_hz: float
    height: float
    source: str


@dataclass(frozen=True, eq=False, repr=False)
class GyroNoise(Result, schema="flightid.gyro_noise/1"):
    """Spectrum of a gyroscope in the air.

    Attributes
    ----------
    label : str
        Where it was logged; empty where no stream is fast enough.
    rate_hz, resolution_hz : float
        Sampling rate, and width of a bin.
    n_windows : int
        Windows behind it.
    freedom : float
        Degrees of freedom of each value.
    frequency_hz : ndarray, shape (n_f,)
    spectrum : ndarray, shape (3, n_f)
        One-sided, (rad/s)² per Hz, about x, y and z.
    throttle : ndarray, shape (n_bins,)
        Mean throttle of each bin; empty where too little is known of it.
    by_throttle : ndarray, shape (n_bins, n_f)
        Mean of the three axes in each bin.
    peaks : tuple of NoisePeak
        Highest first.
    reason : str
        Why there is no spectrum.
    gyro : {"raw", "filtered"}
        Whether it was logged ahead of the autopilot's filters or behind them.

    Example
    -------
    >>> review.noise.peaks                                            # doctest: +SKIP
    """

    label: str = ""
    rate_hz: float = 0.0
    resolution_hz: float = 0.0
    n_windows: int = 0
    freedom: float = 0.0
    frequency_hz: Array = field(default_factory=lambda: np.zeros(0))
    spectrum: Array = field(default_factory=lambda: np.zeros((3, 0)))
    throttle: Array = field(default_factory=lambda: np.zeros(0))
    by_throttle: Array = field(default_factory=lambda: np.zeros((0, 0)))
    peaks: tuple[NoisePeak, ...] = ()
    reason: str = ""
    gyro: Gyro = "filtered"

    @property
    def is_told(self) -> bool:
        """Whether the log holds a spectrum."""
        return self.frequency_hz.size > 0

    def of_axis(self, axis: str) -> GyroSpectrum:
        """Spectrum about one axis, as controllers take it."""
        return GyroSpectrum(self.frequency_hz, self.spectrum[AXES.index(axis)], self.gyro)

    def band(self, level: float | None = None) -> tuple[Array, Array]:
        """Lower and upper edge of the spectrum's interval, shape (3, n_f) each.

        Parameters
        ----------
        level : float, optional
            Probability that it holds the truth; default: that of the page, else 0.95.

        Reference
        ---------
        Bendat & Piersol, *Random Data*, 4th ed., eq. 8.159.
        """
        low, high = tails(shown(level))
        above, below = (self.freedom / chi_squared_quantile(q, self.freedom) for q in (low, high))
        return self.spectrum * below, self.spectrum * above

    def summary(self) -> Table:
        """Peaks with their names, and what they rest on."""
        columns = (
            Column("axis"),
            Column("peak", "Hz", 4),
            Column("±", "Hz", 2),
            Column("over its floor", "dB", 3),
            Column("likely"),
        )
        rows = tuple(
            (
                peak.axis,
                peak.frequency_hz,
                self.resolution_hz,
                10.0 * float(np.log10(peak.height)),
                peak.source or None,
            )
            for peak in self.peaks
        )
        return Table("Noise of the gyroscope", columns, rows, self._notes())

    def _notes(self) -> tuple[str, ...]:
        if not self.is_told:
            return (f"No spectrum: {self.reason}.",)
        folded = f" What is faster than {0.5 * self.rate_hz:.3g} Hz shows folded below it."
        what = (
            f"{self.label}, {WHERE[self.gyro]}: {self.n_windows} windows of "
            f"{1.0 / self.resolution_hz:.2g} s at {self.rate_hz:.4g} Hz."
            + (folded if self.rate_hz < 1000.0 else "")
        )
        level = "" if self.throttle.size > 1 else NO_THROTTLE
        none = "" if self.peaks else f"No peak stands out of the floor above {LOWEST_HZ:g} Hz."
        return tuple(filter(None, (what, level, none)))

    def __repr__(self) -> str:
        """Stream, windows and peaks on one line."""
        if not self.is_told:
            return f"GyroNoise({self.reason})"
        tops = ", ".join(f"{peak.frequency_hz:.3g} Hz" for peak in self.peaks)
        return f"GyroNoise({self.label}, {self.n_windows} windows, peaks {tops or 'none'})"


def gyro_noise(log: Log, spans: tuple[Span, ...]) -> GyroNoise:
    """Spectrum of the fastest gyroscope in the air, its peaks named by motors or throttle."""
    if not spans:
        return GyroNoise(reason="nothing was flown")
    windows = gyro_windows(log, spans)
    if isinstance(windows, str):
        return GyroNoise(reason=windows)
    frequency, powers = _periodograms(windows)
    freedom = _freedom(len(powers), windows.overlap)
    mean = powers.mean(axis=0)
    throttle = find(log, "thrust")
    used = _throttle_of(windows, throttle)
    bins, by_throttle = _by_throttle(used, powers.mean(axis=1))
    turns = _motor_hz(log, spans)
    tops = _peaks(frequency, mean, freedom)
    named = tuple(
        NoisePeak(AXES[axis], top, height, _source(top, frequency, powers[:, axis], used, turns))
        for axis, top, height in tops
    )
    resolution = float(frequency[1] - frequency[0])
    return GyroNoise(
        windows.label, windows.rate_hz, resolution, len(powers), freedom,
        frequency, mean, bins, by_throttle, named, gyro=windows.gyro,
    )  # fmt: skip


def _periodograms(windows: GyroWindows) -> tuple[Array, Array]:
    """Frequencies and one-sided power of every window, shape (n, 3, n_f), Hann."""
    length = windows.samples.shape[2]
    taper = np.hanning(length)
    centred = windows.samples - windows.samples.mean(axis=2, keepdims=True)
    spectra = np.fft.rfft(centred * taper, axis=2)
    scale = 2.0 / (windows.rate_hz * np.sum(taper**2))
    frequency = np.fft.rfftfreq(length, 1.0 / windows.rate_hz)
    return np.asarray(frequency[1:]), np.asarray(scale * np.abs(spectra[:, :, 1:]) ** 2)


def _freedom(count: int, overlap: float) -> float:
    """Degrees of freedom of a mean of Hann windows (Percival & Walden 1993, eq. 292b)."""
    return 2.0 * count if overlap == 0.0 else max(2.0, 36.0 * count**2 / (19.0 * count - 1.0))


def _throttle_of(windows: GyroWindows, throttle: Signal | None) -> Array:
    """Mean throttle of each window; empty where it is not logged."""
    if throttle is None:
        return np.zeros(0)
    middles = windows.start_s + 0.5 * windows.window_s
    return np.interp(middles, throttle.time_s, throttle.values)


def _by_throttle(throttle: Array, powers: Array) -> tuple[Array, Array]:
    """Mean power in bins of equally many windows, from little to much throttle."""
    count = min(BINS, throttle.size // FEWEST_IN_BIN)
    if count < 2 or np.ptp(throttle) < LEAST_THROTTLE:
        return np.zeros(0), np.zeros((0, powers.shape[1]))
    parts = np.array_split(np.argsort(throttle, kind="stable"), count)
    return (
        np.array([throttle[part].mean() for part in parts]),
        np.array([powers[part].mean(axis=0) for part in parts]),
    )


def _peaks(frequency: Array, mean: Array, freedom: float) -> list[tuple[int, float, float]]:
    """Axis, frequency and height of what stands out of its floor, highest first."""
    inside_band = (frequency >= LOWEST_HZ) & (frequency <= HIGHEST * 2.0 * frequency[-1])
    count = int(np.count_nonzero(inside_band))
    if count < 8:
        return []
    limit = chi_squared_quantile(1.0 - FALSE_PEAKS / (3 * count), freedom) / freedom
    found: list[tuple[int, float, float]] = []
    for axis, power in enumerate(mean):
        ratio = power / floor_beneath(frequency, power)
        higher = (ratio[1:-1] >= ratio[:-2]) & (ratio[1:-1] > ratio[2:])
        tops = np.flatnonzero(higher & inside_band[1:-1]) + 1
        found += [
            (axis, float(frequency[k]), float(ratio[k]))
            for k in tops
            if ratio[k] > max(limit, STANDING_OUT)
        ]
    found.sort(key=lambda top: -top[2])
    kept: list[tuple[int, float, float]] = []
    apart = 3.0 * float(frequency[1] - frequency[0])
    for top in found:
        if all(abs(top[1] - other[1]) > apart for other in kept):
            kept.append(top)
    return kept[:MOST_PEAKS]


def floor_beneath(frequency: Array, power: Array) -> Array:
    """Running median on a logarithmic grid: what lies beneath narrow peaks."""
    grid = np.geomspace(frequency[0], frequency[-1], 400)
    level = np.interp(grid, frequency, np.log(np.maximum(power, np.finfo(float).tiny)))
    width = 2 * int(0.5 * np.log1p(FLOOR_WIDTH) / np.log(grid[1] / grid[0]) + 1.0) + 1
    around = np.pad(level, width // 2, mode="symmetric")
    middle = np.median(sliding_window_view(around, width), axis=1)
    return np.asarray(np.exp(np.interp(frequency, grid, middle)))


def _motor_hz(log: Log, spans: tuple[Span, ...]) -> tuple[float, float] | None:
    """From the slowest to the fastest that motors turned in the air, turns a second."""
    found: list[Array] = []
    if "ESC" in log and "RPM" in log.messages["ESC"].fields:
        table = log.table("ESC")
        found.append(table["RPM"][inside(table.time_s, spans)])
    if "esc_status" in log:
        table = log.table("esc_status", (log.messages["esc_status"].instances or (None,))[0])
        flying = inside(table.time_s, spans)
        names = [name for name in table.columns if name.endswith(".esc_rpm")]
        found += [table[name][flying] for name in names]
    turning = np.concatenate([rpm[np.isfinite(rpm) & (rpm > 0)] for rpm in found] or [np.zeros(0)])
    if turning.size < 10:
        return None
    low, high = np.percentile(turning, [5, 95]) / 60.0
    return float(low), float(high)


def _source(
    top: float, frequency: Array, powers: Array, throttle: Array, turns: tuple[float, float] | None
) -> str:
    """What makes a peak: motors that turn so fast, or what moves with throttle."""
    slack = float(frequency[1] - frequency[0])
    if turns is not None:
        for times, word in ((1, "motors turn"), (2, "two blades"), (3, "three blades")):
            if times * turns[0] - slack <= top <= times * turns[1] + slack:
                return f"{word}: ESCs say {turns[0]:.3g} to {turns[1]:.3g} turns a second"
    near = (frequency >= 0.75 * top) & (frequency <= 1.3 * top)
    if throttle.size < 12 or np.ptp(throttle) < 0.1 * np.mean(throttle) or near.sum() < 5:
        return ""
    tops = frequency[near][np.argmax(powers[:, near], axis=1)]
    rank, chance = rank_correlation(throttle, tops)
    if np.isfinite(rank) and chance < FALSE_PEAKS:
        return MOVES if rank > 0.0 else FALLS
    still = np.ptp(tops) <= 4.0 * slack and np.ptp(throttle) > 0.3 * np.mean(throttle)
    return STAYS if still else ""
