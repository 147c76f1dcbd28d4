"""Betaflight's filters on gyro and D-term, from its settings (3.1 to 2025.12)."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

from flightid import _native
from flightid.control.autopilots.filter_stages import (
    FilterPath,
    FilterStage,
    notch_stage,
    pole_stage,
)
from flightid.control.autopilots.filters import Section
from flightid.errors import OptionError

TYPES = {0: "PT1", 1: "BIQUAD", 2: "PT2", 3: "PT3"}
"""`lowpass_type` of the configuration, as blackbox headers hold it; the CLI has the words."""
ORDERS = {"PT1": 1, "PT2": 2, "PT3": 3}
HIGHEST_SHARE = 0.48
UNLIMITED_DB = math.inf
Settings = Mapping[str, float | str]


def betaflight_filters(
    settings: Settings,
    *,
    loop_rate_hz: float,
    gyro_rate_hz: float | None = None,
    throttle: float = 0.0,
    motors_hz: Sequence[float] = (),
    peaks_hz: Sequence[float] = (),
    gyro_at_once: bool = False,
) -> tuple[FilterStage, ...]:
    """Filters on the gyro and on the D-term in the order in which Betaflight runs them.

    The second gyro low-pass runs at the gyro's rate, all others at the loop's, but before 4.3.
    Low-passes that move with throttle stand where `throttle` puts them, RPM notches at every
    harmonic of every motor, dynamic notches at the peaks of the axis.

    Parameters
    ----------
    settings : mapping of str to float or str
        By the names of the CLI: ``gyro_lpf1_static_hz``, ``dterm_lpf1_type``,
        ``rpm_filter_q``, … Left out: off.
    loop_rate_hz, gyro_rate_hz : float
        Rate of the PID loop and of the gyro, Hz; the gyro's is the loop's where left out.
    throttle : float
        0 to 1.
    motors_hz : sequence of float
        Turns a second of each motor, by telemetry.
    peaks_hz : sequence of float
        Where the dynamic notches of the axis are.
    gyro_at_once : bool
        Whether all gyro filters run at the gyro's rate, as before 4.3.

    Raises
    ------
    OptionError
        A type of low-pass that there is none of, a throttle outside 0 to 1, a rate that is none.

    Reference
    ---------
    Betaflight, src/main/common/filter.c, sensors/gyro_filter_impl.c, flight/rpm_filter.c,
    flight/dyn_notch_filter.c, flight/pid.c (dynLpfCutoffFreq, without expo before 4.3).

    Example
    -------
    >>> stages = betaflight_filters(
    ...     {"gyro_lpf2_static_hz": 500, "gyro_lpf2_type": "PT1", "dterm_lpf1_static_hz": 75,
    ...      "dterm_lpf1_type": "PT2"}, loop_rate_hz=8000.0)
    >>> [(stage.name, stage.settings) for stage in stages]
    [('gyro_lpf2', 'PT1 at 500 Hz'), ('dterm_lpf1', 'PT2 at 75 Hz')]
    """
    gyro_hz = gyro_rate_hz or loop_rate_hz
    if not (0.0 <= throttle <= 1.0 and loop_rate_hz > 0.0 and gyro_hz >= loop_rate_hz):
        raise OptionError(
            "Betaflight's filters cannot be placed",
            found=f"throttle {throttle}, loop {loop_rate_hz} Hz, gyro {gyro_hz} Hz",
            needed="a throttle from 0 to 1, a loop rate above 0 and a gyro at least as fast",
        )
    own_hz = gyro_hz if gyro_at_once else loop_rate_hz
    stages = (
        _low_pass(settings, "gyro_lpf2", "gyro", gyro_hz, throttle),
        _rpm_notches(settings, own_hz, motors_hz),
        _static_notch(settings, "gyro_notch1", "gyro", own_hz),
        _static_notch(settings, "gyro_notch2", "gyro", own_hz),
        _low_pass(settings, "gyro_lpf1", "gyro", own_hz, throttle),
        _dynamic_notches(settings, own_hz, peaks_hz),
        _static_notch(settings, "dterm_notch", "derivative", loop_rate_hz),
        _low_pass(settings, "dterm_lpf1", "derivative", loop_rate_hz, throttle),
        _low_pass(settings, "dterm_lpf2", "derivative", loop_rate_hz, throttle),
    )
    return tuple(stage for stage in stages if stage.sections)


def _number(settings: Settings, name: str, default: float = 0.0) -> float:
    return float(settings.get(name, default))


def _low_pass(
    settings: Settings, name: str, path: FilterPath, rate_hz: float, throttle: float
) -> FilterStage:
    """A low-pass of one of four kinds, fixed or moving with throttle."""
    least = _number(settings, f"{name}_dyn_min_hz")
    most = _number(settings, f"{name}_dyn_max_hz")
    expo = _number(settings, f"{name}_dyn_expo", 5.0) / 10.0
    cutoff = _number(settings, f"{name}_static_hz")
    if least > 0.0 and most > least:
        curve = throttle * (1.0 - throttle) * expo + throttle
        cutoff = (most - least) * curve + least
    kind = settings.get(f"{name}_type", "PT1")
    word = str(TYPES.get(int(kind), kind) if isinstance(kind, int | float) else kind).upper()
    if word not in TYPES.values():
        raise OptionError(f"{name} has no such type", found=kind, needed=", ".join(TYPES.values()))
    if word == "BIQUAD":
        section = _native.gyro_low_pass_section(rate_hz, cutoff) if cutoff > 0.0 else None
        sections: tuple[Section, ...] = () if section is None else (section,)
    else:
        # −3 dB stays where the cut-off is: each pole is faster by 1/√(2^(1/n) − 1).
        order = ORDERS[word]
        each = cutoff / math.sqrt(2.0 ** (1.0 / order) - 1.0)
        sections = pole_stage(name, each, path, rate_hz, order).sections
    return FilterStage(name, f"{word} at {cutoff:.4g} Hz", path, rate_hz, sections)


def _notch(rate_hz: float, center: float, quality: float) -> Section | None:
    return _native.ardupilot_notch_section(rate_hz, center, quality, UNLIMITED_DB)


def _static_notch(settings: Settings, name: str, path: FilterPath, rate_hz: float) -> FilterStage:
    """A notch by its centre and the lower frequency where it takes 3 dB."""
    center, lower = (_number(settings, f"{name}_{word}") for word in ("hz", "cutoff"))
    quality = center * lower / (center**2 - lower**2) if center > lower > 0.0 else 0.0
    return notch_stage(name, path, rate_hz, [_notch(rate_hz, center, quality)])


def _rpm_notches(settings: Settings, rate_hz: float, motors_hz: Sequence[float]) -> FilterStage:
    """A notch for each harmonic of each motor, faded in above the least frequency."""
    count = round(_number(settings, "rpm_filter_harmonics"))
    least = _number(settings, "rpm_filter_min_hz", 100.0)
    fade = _number(settings, "rpm_filter_fade_range_hz", 50.0)
    quality = _number(settings, "rpm_filter_q", 500.0) / 100.0
    weights = _weights(settings, count)
    found = []
    for motor in motors_hz:
        for number in range(count):
            at = min(max((number + 1) * motor, least), HIGHEST_SHARE * rate_hz)
            weight = weights[number] * (min((at - least) / fade, 1.0) if fade > 0.0 else 1.0)
            found.append(_faded(_notch(rate_hz, at, quality), weight))
    return notch_stage("rpm_filter", "gyro", rate_hz, found)


def _weights(settings: Settings, count: int) -> list[float]:
    """Share of each harmonic's notch, as the CLI has it: ``100,100,100``."""
    told = str(settings.get("rpm_filter_weights", "")).replace("/", ",").split(",")
    read = [min(max(float(each) / 100.0, 0.0), 1.0) for each in told if each.strip()]
    return [*read, *[1.0] * count][:count]


def _faded(section: Section | None, weight: float) -> Section | None:
    """Crossfade of the notch's output with its input."""
    if section is None or weight <= 0.0:
        return None
    b0, b1, b2, a1, a2 = section
    rest = 1.0 - weight
    return (weight * b0 + rest, weight * b1 + rest * a1, weight * b2 + rest * a2, a1, a2)


def _dynamic_notches(settings: Settings, rate_hz: float, peaks_hz: Sequence[float]) -> FilterStage:
    """Notches at the peaks of the on-board spectrum, as many as the settings allow."""
    count = round(_number(settings, "dyn_notch_count"))
    quality = _number(settings, "dyn_notch_q", 300.0) / 100.0
    least = _number(settings, "dyn_notch_min_hz", 100.0)
    most = min(max(_number(settings, "dyn_notch_max_hz", 600.0), least), 0.5 * rate_hz)
    placed = [min(max(peak, least), most) for peak in peaks_hz[:count]]
    return notch_stage(
        "dyn_notch", "gyro", rate_hz, [_notch(rate_hz, each, quality) for each in placed]
    )
