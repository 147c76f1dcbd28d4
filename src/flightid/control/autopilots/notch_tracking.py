"""What notches that move followed in a flight: throttle, motors, rotors, the on-board spectrum."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import field

import numpy as np
from numpy.typing import NDArray

from flightid.frozen import dataclass
from flightid.inspection.signals import Span, find, inside
from flightid.inspection.stamps import believable
from flightid.logs import Log
from flightid.logs.blackbox.firmware import BLACKBOX

Array = NDArray[np.float64]
STEADY = 1.3
"""Ratio of the 95th to the 5th percentile below which one centre stands for all of them."""
MOST_SOURCES = 12
LEAST_HZ = 1.0
RUNNING = 0.02
"""Throttle below it is no flight."""


@dataclass(frozen=True)
class Centre:
    """A frequency that a notch followed, Hz.

    Attributes
    ----------
    middle, low, high : float
        Median, 5th and 95th percentile.
    """

    middle: float
    low: float
    high: float

    @classmethod
    def of(cls, values: Array) -> Centre | None:
        """Of samples; None where too few are above zero."""
        good = values[np.isfinite(values) & (values > 0.0)]
        if good.size < 2:
            return None
        low, middle, high = np.percentile(good, [5, 50, 95])
        return cls(float(middle), float(low), float(high))

    def scaled(self, factor: float, least: float) -> Centre:
        """Times a factor, not below a frequency."""
        ends = (max(factor * value, least) for value in (self.middle, self.low, self.high))
        return Centre(*ends)

    @property
    def is_steady(self) -> bool:
        """Whether one centre stands for all."""
        return self.high <= STEADY * self.low


@dataclass(frozen=True)
class NotchTracking:
    """What the notches of a flight could follow.

    Attributes
    ----------
    throttle : Centre or None
        Of the mixer, 0 to 1.
    motors : tuple of Centre
        Turns a second of each motor, by the telemetry of the speed controllers.
    rotors : mapping of int to Centre
        Turns a second of ArduPilot's rotor-speed sensors, by instance.
    centres : mapping of int to tuple of Centre
        Of ArduPilot's notches as they were logged, by instance.
    peaks : mapping of int to tuple of Centre
        Of PX4's on-board spectrum, by axis.
    peaks_bandwidth_hz : float
        PX4's bandwidth of their notches.
    """

    throttle: Centre | None = None
    motors: tuple[Centre, ...] = ()
    rotors: Mapping[int, Centre] = field(default_factory=dict)
    centres: Mapping[int, tuple[Centre, ...]] = field(default_factory=dict)
    peaks: Mapping[int, tuple[Centre, ...]] = field(default_factory=dict)
    peaks_bandwidth_hz: float = 15.0


def notch_tracking(log: Log, spans: Sequence[Span]) -> NotchTracking:
    """Read what notches followed in some spans of a log.

    Parameters
    ----------
    log : Log
    spans : sequence of tuple of float
        Where they count, s on the autopilot's clock.
    """
    if log.kind == "px4":
        peaks, width = _px4_peaks(log, spans)
        return NotchTracking(motors=_px4_motors(log, spans), peaks=peaks, peaks_bandwidth_hz=width)
    throttle = find(log, "thrust")
    mixer = None if throttle is None else throttle.within(spans)
    turned = None if mixer is None else Centre.of(mixer[mixer > RUNNING])
    if log.kind in BLACKBOX:
        return NotchTracking(turned, _betaflight_motors(log, spans))
    return NotchTracking(
        turned,
        _instances(log, "ESC", "RPM", spans, 60.0),
        _rotors(log, spans),
        _logged_centres(log, spans),
    )


def _samples(
    log: Log, message: str, name: str, spans: Iterable[Span], instance: int | None = None
) -> Array:
    if message not in log or name not in log.messages[message].fields:
        return np.zeros(0)
    table = log.table(message, instance)
    good = believable(table.time_s) & inside(table.time_s, spans)
    return np.asarray(table[name][good], dtype=np.float64)


def _instances(
    log: Log, message: str, name: str, spans: Iterable[Span], divisor: float
) -> tuple[Centre, ...]:
    """Of each instance that turned."""
    if message not in log:
        return ()
    every = log.messages[message].instances or (None,)
    found = (Centre.of(_samples(log, message, name, spans, each) / divisor) for each in every)
    return tuple(centre for centre in found if centre is not None)


def _rotors(log: Log, spans: Sequence[Span]) -> dict[int, Centre]:
    """RPM sensors: a message with two fields, since 4.5 one with instances."""
    found = {}
    for place, name in enumerate(("rpm1", "rpm2")):
        centre = Centre.of(_samples(log, "RPM", name, spans) / 60.0)
        if centre is not None:
            found[place] = centre
    if not found:
        found = dict(enumerate(_instances(log, "RPM", "RPM", spans, 60.0)))
    return found


def _logged_centres(log: Log, spans: Sequence[Span]) -> dict[int, tuple[Centre, ...]]:
    """Centres as ArduPilot logs them: FTN and FTNS (4.2 to 4.5), FCN and FCNS since."""
    found: dict[int, tuple[Centre, ...]] = {}
    for message, prefix in (("FTN", "NF"), ("FTNS", "NF"), ("FCN", "CF"), ("FCNS", "CF")):
        if message not in log:
            continue
        known = log.messages[message].fields
        several = tuple(
            f"{prefix}{k}" for k in range(1, MOST_SOURCES + 1) if f"{prefix}{k}" in known
        )
        for place in (0, 1):
            rows = _samples(log, message, "I", spans) == place
            columns = (_samples(log, message, name, spans)[rows] for name in several or (prefix,))
            read = tuple(centre for c in columns if (centre := Centre.of(c[c > LEAST_HZ])))
            if read:
                found.setdefault(place, read)
    return found


def _betaflight_motors(log: Log, spans: Sequence[Span]) -> tuple[Centre, ...]:
    """Electrical turns, counted in hundreds a minute; a pair of poles is one."""
    pairs = log.parameters.get("motor_poles", 0.0) / 2.0
    if pairs < 1.0:
        return ()
    every = (
        Centre.of(_samples(log, "main", f"eRPM[{k}]", spans) * 100.0 / 60.0 / pairs)
        for k in range(MOST_SOURCES)
    )
    return tuple(centre for centre in every if centre is not None)


def _px4_motors(log: Log, spans: Sequence[Span]) -> tuple[Centre, ...]:
    if "esc_status" not in log:
        return ()
    names = [n for n in log.messages["esc_status"].fields if n.endswith(".esc_rpm")]
    found = (Centre.of(np.abs(_samples(log, "esc_status", n, spans)) / 60.0) for n in names)
    return tuple(centre for centre in found if centre is not None)


def _px4_peaks(log: Log, spans: Sequence[Span]) -> tuple[dict[int, tuple[Centre, ...]], float]:
    message = "sensor_gyro_fft"
    if message not in log:
        return {}, 15.0
    known = log.messages[message].fields
    found = {}
    for place, axis in enumerate("xyz"):
        names = [n for n in known if n.startswith(f"peak_frequencies_{axis}")]
        read = (Centre.of(_samples(log, message, name, spans)) for name in names)
        found[place] = tuple(centre for centre in read if centre is not None)
    widths = _samples(log, message, "resolution_hz", spans)
    return found, float(np.clip(np.median(widths), 8.0, 30.0)) if widths.size else 15.0
