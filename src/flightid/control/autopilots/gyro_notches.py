"""Notches on the gyro from an autopilot's parameters and from what they followed."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

from flightid import _native
from flightid.control.autopilots.filters import Section
from flightid.control.autopilots.notch_tracking import Centre, NotchTracking
from flightid.frozen import dataclass

HIGHEST_SHARE = 0.48
"""ArduPilot leaves notches off above this part of the sample rate."""
MULTI_SOURCE = 1 << 1
COMPOSITES = ((1 << 0, 2), (1 << 4, 3), (1 << 6, 5))
"""Options of INS_HNTCH_OPTS that put several notches in the place of one; the first set counts."""
HARMONICS = 16
TRACKING = {
    1: "throttle",
    2: "a rotor-speed sensor",
    3: "the speed controllers' telemetry",
    4: "the on-board spectrum",
    5: "the second rotor-speed sensor",
}
PREFIXES = ("INS_HNTCH_", "INS_HNTC2_")
ESC_NOTCHES, SPECTRUM_NOTCHES = 1, 2
LOWEST_PX4_HZ = 10.0
PX4_FIXED = (
    ("IMU_GYRO_NF_FREQ", "IMU_GYRO_NF_BW"),
    ("IMU_GYRO_NF0_FRQ", "IMU_GYRO_NF0_BW"),
    ("IMU_GYRO_NF1_FRQ", "IMU_GYRO_NF1_BW"),
)


@dataclass(frozen=True)
class GyroNotches:
    """Notches on the gyro at one operating point.

    Attributes
    ----------
    sections : tuple of Section
        In the autopilot's order, those that move at the middle of what they followed.
    unknown : tuple of str
        Sentences on notches whose place the log does not tell, or that moved far.
    """

    sections: tuple[Section, ...] = ()
    unknown: tuple[str, ...] = ()


def ardupilot_notches(
    parameters: Mapping[str, float],
    gyro_rate_hz: float,
    tracking: NotchTracking | None = None,
) -> GyroNotches:
    """Harmonic notches INS_HNTCH and INS_HNTC2: fixed ones, and those that follow something.

    A notch follows throttle as FREQ · max(FM_RAT, √(throttle/REF)), rotors and motors as REF times
    their turns a second but not below FREQ · FM_RAT, one notch for each motor where OPTS asks for
    it. Quality and attenuation are those of FREQ and BW wherever it is.

    Parameters
    ----------
    parameters : mapping of str to float
        Parameters of the vehicle.
    gyro_rate_hz : float
        Rate of the gyro filters, Hz.
    tracking : NotchTracking, optional
        What they followed; without it notches that move are left out and named.

    Reference
    ---------
    ArduPilot, libraries/Filter/HarmonicNotchFilter.cpp, AP_Vehicle::update_dynamic_notch (4.5).
    """
    sections: list[Section] = []
    unknown: list[str] = []
    for place, prefix in enumerate(PREFIXES):
        group = {k.removeprefix(prefix): v for k, v in parameters.items() if k.startswith(prefix)}
        if not group.get("ENABLE"):
            continue
        mode = round(group.get("MODE", 1.0))
        if mode == 0 or group.get("REF", 0.0) == 0:
            sections += _harmonic(group, gyro_rate_hz, (_base_hz(group, gyro_rate_hz),))
            continue
        centres = _followed(group, mode, place, tracking or NotchTracking())
        sections += _harmonic(group, gyro_rate_hz, [each.middle for each in centres])
        unknown += _doubt(f"{prefix}*", TRACKING.get(mode, f"mode {mode}"), centres)
    return GyroNotches(tuple(sections), tuple(unknown))


def _base_hz(group: Mapping[str, float], rate_hz: float) -> float:
    """FREQ inside what the firmware makes quality and fixed notches of."""
    lowest, highest = 0.52 * group.get("BW", 40.0), HIGHEST_SHARE * rate_hz
    return min(max(group.get("FREQ", 80.0), lowest), highest)


def _followed(
    group: Mapping[str, float], mode: int, place: int, tracking: NotchTracking
) -> tuple[Centre, ...]:
    """Centres of the first harmonic; none where nothing tells them."""
    frequency, reference = group.get("FREQ", 80.0), group["REF"]
    least = frequency * group.get("FM_RAT", 1.0)
    if place in tracking.centres:
        return tracking.centres[place]
    if mode == 1 and tracking.throttle is not None:
        read = tracking.throttle
        roots = ((value / reference) ** 0.5 for value in (read.middle, read.low, read.high))
        return (Centre(*(frequency * root for root in roots)).scaled(1.0, least),)
    if mode in (2, 5):
        rotor = tracking.rotors.get(0 if mode == 2 else 1)
        return () if rotor is None else (rotor.scaled(reference, least),)
    if mode == 3 and tracking.motors:
        if round(group.get("OPTS", 0.0)) & MULTI_SOURCE:
            return tuple(motor.scaled(1.0, least) for motor in tracking.motors)
        return (_mean(tracking.motors).scaled(reference, least),)
    return ()


def _mean(centres: Sequence[Centre]) -> Centre:
    count = len(centres)
    return Centre(
        sum(each.middle for each in centres) / count,
        sum(each.low for each in centres) / count,
        sum(each.high for each in centres) / count,
    )


def _doubt(name: str, followed: str, centres: Sequence[Centre]) -> Iterable[str]:
    """A sentence where notches are not known, or move too far for one place to stand for all."""
    if not centres:
        yield (
            f"{name} follows {followed} in flight, which the log does not tell: its notches are "
            "not in this view, and the phase lag of the raw gyro's path is missing from margins"
        )
        return
    low, high = min(each.low for each in centres), max(each.high for each in centres)
    if not all(each.is_steady for each in centres):
        yield (
            f"{name} follows {followed} from {low:.3g} to {high:.3g} Hz in flight: this view holds "
            "its notches in the middle"
        )


def _harmonic(
    group: Mapping[str, float], rate_hz: float, centres: Sequence[float]
) -> list[Section]:
    bandwidth, options = group.get("BW", 40.0), round(group.get("OPTS", 0.0))
    base, highest = _base_hz(group, rate_hz), HIGHEST_SHARE * rate_hz
    count = next((number for bit, number in COMPOSITES if options & bit), 1)
    spread = bandwidth / (32 * base)
    quality = _native.ardupilot_notch_quality(base, bandwidth / count)
    middle = (0.0,) if count % 2 else ()
    sides = (side * step * spread for step in range(1, count // 2 + 1) for side in (-1, 1))
    offsets = (*middle, *sides)
    chosen = round(group.get("HMNCS", 3.0))
    found = (
        _native.ardupilot_notch_section(
            rate_hz, center * (number + 1) * (1 + offset), quality, group.get("ATT", 40.0)
        )
        for number in range(HARMONICS)
        for center in centres
        if chosen & (1 << number) and center * (number + 1) < highest
        for offset in offsets
    )
    return [section for section in found if section is not None]


def pid_notch(parameters: Mapping[str, float], index: float) -> tuple[float, float, float]:
    """Centre (Hz), quality and attenuation (dB) of FILTn for NTF and NEF; zeros are off."""
    group = f"FILT{round(index)}_"
    if not round(index) or round(parameters.get(f"{group}TYPE", 0.0)) != 1:
        return (0.0, 0.0, 0.0)
    center = parameters.get(f"{group}NOTCH_FREQ", 0.0)
    quality = parameters.get(f"{group}NOTCH_Q", 2.0)
    attenuation = parameters.get(f"{group}NOTCH_ATT", 40.0)
    if min(center, quality, attenuation) <= 0:
        return (0.0, 0.0, 0.0)
    # The firmware goes by way of a bandwidth, which changes the quality a little.
    return center, _native.ardupilot_notch_quality(center, center / quality), attenuation


def px4_notches(
    parameters: Mapping[str, float],
    gyro_rate_hz: float,
    tracking: NotchTracking | None = None,
    axis: int = 0,
) -> GyroNotches:
    """Dynamic notches IMU_GYRO_DNF, then the fixed ones NF0 and NF1 (NF before 1.13).

    Parameters
    ----------
    parameters : mapping of str to float
    gyro_rate_hz : float
        Hz.
    tracking : NotchTracking, optional
        Turns of the motors, and peaks of the on-board spectrum.
    axis : {0, 1, 2}
        Whose peaks count.

    Reference
    ---------
    PX4, src/modules/sensors/vehicle_angular_velocity/VehicleAngularVelocity.cpp (1.12 to 1.16).
    """
    moving = round(parameters.get("IMU_GYRO_DNF_EN", parameters.get("IMU_GYRO_DYN_NF", 0.0)))
    followed, settings = tracking or NotchTracking(), []
    unknown: list[str] = []
    if moving & ESC_NOTCHES:
        settings += _esc_notches(parameters, followed.motors)
        unknown += _doubt("IMU_GYRO_DNF", "the motors", followed.motors)
    if moving & SPECTRUM_NOTCHES:
        peaks = followed.peaks.get(axis, ())
        width = followed.peaks_bandwidth_hz
        settings += [(each.middle, width) for each in peaks if each.middle > LOWEST_PX4_HZ]
        unknown += _doubt("IMU_GYRO_DNF", "the on-board spectrum", peaks)
    settings += [
        (parameters.get(frequency, 0.0), parameters.get(bandwidth, 20.0))
        for frequency, bandwidth in PX4_FIXED
    ]
    made = (_native.px4_notch_section(gyro_rate_hz, *each) for each in settings)
    return GyroNotches(tuple(each for each in made if each is not None), tuple(unknown))


def _esc_notches(
    parameters: Mapping[str, float], motors: Iterable[Centre]
) -> list[tuple[float, float]]:
    """Frequency and bandwidth of every motor's harmonics; since 1.13 parked at DNF_MIN."""
    width = parameters.get("IMU_GYRO_DNF_BW", 15.0)
    count = min(max(round(parameters.get("IMU_GYRO_DNF_HMC", 3.0)), 1), 10)
    parked = "IMU_GYRO_DNF_MIN" in parameters
    least = max(parameters.get("IMU_GYRO_DNF_MIN", LOWEST_PX4_HZ), width if parked else 0.0)
    found = []
    for motor in motors:
        for number in range(count):
            turned = motor.middle * (number + 1)
            lowest = least + 0.5 * number * width
            if parked or turned > LOWEST_PX4_HZ:
                found.append((max(turned, lowest) if parked else turned, width))
    return found
