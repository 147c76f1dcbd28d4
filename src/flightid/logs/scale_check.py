"""Whether streams that show the same turning agree on how far: a check that needs no unit.

Each body rate is integrated over short windows and set beside its other streams and beside the
turning that the attitude shows. Two streams whose spreads differ by more than 5 %, and by more than
their noise can explain, hold different units, or one is wrong.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from flightid.conventions import Light
from flightid.errors import MissingColumnError, UnitError
from flightid.findings import Finding
from flightid.frozen import dataclass
from flightid.logs.channels.channel_map import ChannelMap
from flightid.logs.contents import LogContents
from flightid.logs.extraction import extract
from flightid.record.angle_units import CORRELATION, DEGREES, spread_ratio

Array = NDArray[np.float64]
Stream = tuple[Array, Array]
AXES = ("p", "q", "r")
ANGLES = ("phi", "theta", "psi")
WINDOW_S, SAMPLES_IN_WINDOW, MOST_WINDOWS = 0.3, 10, 5000
"""Shortest window whose turn is compared, s; samples that it holds at least; most windows."""
FEWEST_WINDOWS = 25
"""Windows without which nothing is said."""
TOLERANCE = 0.05
"""Share by which rates may miss a known factor and still have it."""
DEVIATIONS = 3.0
"""Standard errors of the factor, by the noise between the streams, that are allowed for."""
LEAST_RATE = 0.02
"""Spread of a rate, in what its stream counts, below which nothing turns."""


@dataclass(frozen=True)
class ScaleCheck:
    """How far one stream turns for each radian of another.

    Attributes
    ----------
    quantity : str
        Body rate: ``"p"``, ``"q"`` or ``"r"``.
    first, second : str
        Where they were logged.
    factor : float
        Spread of the second over that of the first.
    correlation : float
        Noise moves the factor by no more than this lacks of one.
    n_windows : int
        Windows behind it: few of them scatter the factor too.
    """

    quantity: str
    first: str
    second: str
    factor: float
    correlation: float
    n_windows: int

    @property
    def finding(self) -> Finding | None:
        """Red where the factor cannot be one; None where it can."""
        certain = abs(self.correlation)
        scatter = 1.0 + DEVIATIONS * np.sqrt(max(0.0, 1.0 - certain**2) / self.n_windows)
        least, most = self.factor * certain / scatter, self.factor / certain * scatter
        if self.correlation > 0.0 and least <= 1.0 + TOLERANCE and most >= 1.0 - TOLERANCE:
            return None
        sign = "-" if self.correlation < 0.0 else ""
        hint = ""
        for known in (DEGREES, 1.0 / DEGREES):
            if least <= known * (1.0 + TOLERANCE) and most >= known * (1.0 - TOLERANCE):
                hint = ": degrees beside radians"
        return Finding(
            "scale-contradicted",
            Light.RED,
            f"{self.second} shows {sign}{self.factor:.4g} times the turning of {self.first} "
            f"(correlation {abs(self.correlation):.3f}){hint}",
            "state the true unit or sign in a channel map of your own, or take the other stream",
        )


def check_scales(
    log: LogContents, channels: ChannelMap, span_s: tuple[float, float] | None = None
) -> tuple[ScaleCheck, ...]:
    """Compare all streams of each body rate, and the attitude, over one span.

    Parameters
    ----------
    log : LogContents
    channels : ChannelMap
        Where rates and angles may be found; a map without them gives nothing.
    span_s : (float, float), optional
        Default: what the streams share.

    Returns
    -------
    tuple of ScaleCheck
        Those pairs that correlate enough to be judged.
    """
    known = {channel.name for channel in channels.channels}
    angles = [next(_streams(log, channels, name), None) for name in ANGLES if name in known]
    present = [angle for angle in angles if angle is not None]
    found = []
    for axis, quantity in enumerate(name for name in AXES if name in known):
        streams = list(_streams(log, channels, quantity))
        for label, second in streams[1:]:
            found.append(_compared(quantity, streams[0], (label, second), span_s))
        if streams and len(present) == len(ANGLES):
            found.append(_beside_attitude(axis, quantity, streams[0], present, span_s))
    return tuple(check for check in found if check is not None)


def _streams(log: LogContents, channels: ChannelMap, name: str) -> Iterator[tuple[str, Stream]]:
    """Places of a channel with increasing stamps and finite samples, best first."""
    channel = channels[name]
    for source in channel.sources:
        try:
            samples = extract(log, replace(channel, sources=(source,)))
        except (MissingColumnError, UnitError):
            continue
        good = np.isfinite(samples.time_s) & np.isfinite(samples.values)
        time_s, values = samples.time_s, samples.values
        if not np.all(good):
            time_s, values = time_s[good], values[good]
        if time_s.size > SAMPLES_IN_WINDOW and np.all(time_s[1:] > time_s[:-1]):
            yield str(source), (time_s, values)


def _edges(streams: list[Stream], span_s: tuple[float, float] | None) -> Array | None:
    start = max(float(time_s[0]) for time_s, _ in streams)
    stop = min(float(time_s[-1]) for time_s, _ in streams)
    if span_s is not None:
        start, stop = max(start, span_s[0]), min(stop, span_s[1])
    slowest = max(float(np.median(np.diff(time_s), overwrite_input=True)) for time_s, _ in streams)
    window = max(WINDOW_S, SAMPLES_IN_WINDOW * slowest)
    count = min(MOST_WINDOWS, int((stop - start) / window)) if stop > start else 0
    if count < FEWEST_WINDOWS:
        return None
    return np.asarray(start + window * np.arange(count + 1), dtype=np.float64)


def _turned(stream: Stream, edges: Array) -> Array:
    time_s, rate = stream
    steps = 0.5 * (rate[1:] + rate[:-1]) * np.diff(time_s)
    return np.diff(np.interp(edges, time_s, np.concatenate([[0.0], np.cumsum(steps)])))


def _compared(
    quantity: str,
    first: tuple[str, Stream],
    second: tuple[str, Stream],
    span_s: tuple[float, float] | None,
) -> ScaleCheck | None:
    edges = _edges([first[1], second[1]], span_s)
    if edges is None:
        return None
    turns = _turned(first[1], edges), _turned(second[1], edges)
    return _check(quantity, first[0], second[0], turns, float(edges[1] - edges[0]))


def _beside_attitude(
    axis: int,
    quantity: str,
    rate: tuple[str, Stream],
    angles: list[tuple[str, Stream]],
    span_s: tuple[float, float] | None,
) -> ScaleCheck | None:
    edges = _edges([rate[1], *(angle[1] for angle in angles)], span_s)
    if edges is None:
        return None
    at = [np.interp(edges, *angle[1]) for angle in angles]
    phi, theta, _ = (0.5 * (values[1:] + values[:-1]) for values in at)
    d_phi, d_theta, d_psi = (np.diff(values) for values in at)
    moved = (
        d_phi - np.sin(theta) * d_psi,
        np.cos(phi) * d_theta + np.sin(phi) * np.cos(theta) * d_psi,
        np.cos(phi) * np.cos(theta) * d_psi - np.sin(phi) * d_theta,
    )[axis]
    turns = _turned(rate[1], edges), moved
    return _check(quantity, rate[0], angles[axis][0], turns, float(edges[1] - edges[0]))


def _check(
    quantity: str, first: str, second: str, turns: tuple[Array, Array], window_s: float
) -> ScaleCheck | None:
    if max(float(np.std(turn)) for turn in turns) < LEAST_RATE * window_s:
        return None
    found = spread_ratio(turns[1], turns[0])
    if found is None or abs(found[1]) < CORRELATION:
        return None
    return ScaleCheck(quantity, first, second, *found, turns[0].size)
