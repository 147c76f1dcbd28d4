"""Windows of gyroscope samples in the air, from the fastest stream that a log holds."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from flightid.control.gyro import Gyro
from flightid.frozen import dataclass
from flightid.inspection.signals import Signal, Span, inside, places
from flightid.inspection.stamps import believable
from flightid.logs import Log

Array = NDArray[np.float64]
RATES = ("p", "q", "r")
SLOWEST_HZ = 100.0
"""Below it no motor of a multirotor shows: its spectrum ends at half of the rate."""
WINDOW_S = 1.0
GYRO, LONGEST_BATCH = 1, 65536
POST_FILTER = 3
"""ArduPilot numbers batches behind the filters by so many instances more."""
BEHIND, BOTH = 1 << 1, 1 << 2
"""INS_LOG_BAT_OPT: batches from behind the filters, or from both sides of them."""
RAW = ("GYR", "sensor_combined", "sensor_gyro")
"""Messages from ahead of the filters."""
RAW_FIELDS = ("GyrX", "GyrY", "GyrZ")
JITTER = 0.5
"""Of the median step: a window with a larger one is left out."""


@dataclass(frozen=True, eq=False)
class GyroWindows:
    """Windows of equal length of one gyroscope.

    Attributes
    ----------
    label : str
        Where they were logged.
    rate_hz : float
        Samples per second.
    start_s : ndarray, shape (n,)
        First stamp of each window.
    samples : ndarray, shape (n, 3, length)
        Rates about x, y and z, rad/s.
    overlap : float
        Of neighbouring windows.
    gyro : {"raw", "filtered"}
        Ahead of the autopilot's filters, or behind them.
    """

    label: str
    rate_hz: float
    start_s: Array
    samples: Array
    overlap: float
    gyro: Gyro

    @property
    def window_s(self) -> float:
        """Length of a window, s."""
        return float(self.samples.shape[2] / self.rate_hz)


def gyro_windows(log: Log, spans: tuple[Span, ...]) -> GyroWindows | str:
    """Windows of the fastest gyroscope in the air; in words why there are none."""
    batches = list(_batches(log, spans)) if "ISBH" in log and "ISBD" in log else []
    if batches:
        return max(batches, key=lambda each: each.samples.shape[0])
    streams = [_triple(log, place) for place in range(len(places(log, "p")))]
    whole = [stream for stream in (_raw_stream(log), *streams) if stream is not None]
    if not whole:
        return "no gyroscope is logged on three axes"
    fastest = max(whole, key=lambda stream: stream[0].rate_hz)
    if fastest[0].rate_hz < SLOWEST_HZ:
        return (
            f"the fastest gyroscope is logged at {fastest[0].rate_hz:.3g} Hz: motors turn faster "
            "than that shows"
        )
    return _continuous(fastest, spans) or "no second of the flight holds the gyroscope unbroken"


def _triple(log: Log, place: int) -> tuple[Signal, Signal, Signal] | None:
    found = [places(log, name) for name in RATES]
    if any(len(each) <= place for each in found):
        return None
    x, y, z = (each[place] for each in found)
    return (x, y, z) if x.time_s.size == y.time_s.size == z.time_s.size else None


def _raw_stream(log: Log) -> tuple[Signal, Signal, Signal] | None:
    """ArduPilot's first gyroscope as its driver gives it, where INS_RAW_LOG_OPT logs it."""
    if "GYR" not in log or not {"SampleUS", *RAW_FIELDS} <= set(log.messages["GYR"].fields):
        return None
    table = log.table("GYR", min(log.messages["GYR"].instances, default=None))
    time_s = table["SampleUS"] * (1.0 if table.unit("SampleUS") == "s" else 1e-6)
    good = believable(time_s)
    if np.count_nonzero(good) < 2:
        return None
    x, y, z = (
        Signal(name, time_s[good], table[field][good], "rad/s", f"GYR.{field}")
        for name, field in zip(RATES, RAW_FIELDS, strict=True)
    )
    return x, y, z


def _continuous(
    stream: tuple[Signal, Signal, Signal], spans: tuple[Span, ...]
) -> GyroWindows | None:
    """Windows of a second that overlap by half, those with a gap left out."""
    time_s, rate = stream[0].time_s, stream[0].rate_hz
    length = int(WINDOW_S * rate) // 2 * 2
    step = 1.0 / rate
    starts, windows = [], []
    for first, last in spans:
        rows = np.flatnonzero(inside(time_s, [(first, last)]))
        for begin in range(0, rows.size - length, length // 2):
            part = rows[begin : begin + length]
            if np.max(np.abs(np.diff(time_s[part]) - step)) > JITTER * step:
                continue
            starts.append(float(time_s[part[0]]))
            windows.append([signal.values[part] for signal in stream])
    if not windows:
        return None
    label = ", ".join(signal.label for signal in stream)
    gyro: Gyro = "raw" if label.split(".")[0].split("[")[0] in RAW else "filtered"
    return GyroWindows(label, rate, np.array(starts), np.array(windows), 0.5, gyro)


def _batches(log: Log, spans: tuple[Span, ...]) -> Iterator[GyroWindows]:
    """ArduPilot's raw batches of each gyroscope, ahead of the filters; whole ones alone."""
    heads, rows = log.table("ISBH"), log.table("ISBD")
    numbers, order = rows["N"], rows["seqno"]
    data = np.stack([rows[name] for name in ("x", "y", "z")], axis=1)
    good = believable(heads.time_s) & inside(heads.time_s, spans) & (heads["type"] == GYRO)
    for instance in np.unique(heads["instance"][good]):
        mine = np.flatnonzero(good & (heads["instance"] == instance))
        length = int(np.median(heads["smp_cnt"][mine])) if mine.size else 0
        if not 0 < length <= LONGEST_BATCH or instance >= POST_FILTER:
            continue
        starts, windows = [], []
        for row in mine:
            parts = np.flatnonzero(numbers == heads["N"][row])
            parts = parts[np.argsort(order[parts], kind="stable")]
            whole = np.concatenate(data[parts], axis=1) if parts.size else np.zeros((3, 0))
            if whole.shape[1] == length and heads["mul"][row] > 0:
                starts.append(float(heads.time_s[row]))
                windows.append(whole / heads["mul"][row])
        if windows:
            rate = float(np.median(heads["smp_rate"][mine]))
            label = f"ISBD, gyroscope {int(instance)}"
            options = round(log.parameters.get("INS_LOG_BAT_OPT", 0.0))
            gyro: Gyro = "filtered" if options & BEHIND and not options & BOTH else "raw"
            yield GyroWindows(label, rate, np.array(starts), np.array(windows), 0.0, gyro)
