"""Notches on the gyro from an autopilot's parameters."""

from __future__ import annotations

from collections.abc import Mapping

from flightid import _native
from flightid.control.autopilots.filters import Section

HIGHEST_SHARE = 0.48
"""ArduPilot leaves notches off above this part of the sample rate."""
DOUBLE, TRIPLE = 1 << 0, 1 << 4
HARMONICS = 16
TRACKING = {
    1: "throttle",
    2: "a rotor-speed sensor",
    3: "the speed controllers' telemetry",
    4: "the on-board spectrum",
    5: "the second rotor-speed sensor",
}


def ardupilot_notches(
    parameters: Mapping[str, float], gyro_rate_hz: float
) -> tuple[tuple[Section, ...], tuple[str, ...]]:
    """Fixed harmonic notches INS_HNTCH and INS_HNTC2, and sentences on those that move.

    Parameters
    ----------
    parameters : mapping of str to float
        Parameters of the vehicle.
    gyro_rate_hz : float
        Rate of the gyro filters, Hz.

    Returns
    -------
    sections : tuple of Section
        In the autopilot's order.
    unmodelled : tuple of str
        Notches that follow something in flight.
    """
    sections: list[Section] = []
    moving = []
    for prefix in ("INS_HNTCH_", "INS_HNTC2_"):
        group = {k.removeprefix(prefix): v for k, v in parameters.items() if k.startswith(prefix)}
        if not group.get("ENABLE"):
            continue
        mode = round(group.get("MODE", 1.0))
        if mode != 0 and group.get("REF", 0.0) != 0:
            moving.append(
                f"{prefix}* follows {TRACKING.get(mode, f'mode {mode}')} in flight: its notches "
                "are not in this view, and its phase lag is missing from margins"
            )
            continue
        sections += _harmonic(group, gyro_rate_hz)
    return tuple(sections), tuple(moving)


def _harmonic(group: Mapping[str, float], rate_hz: float) -> list[Section]:
    bandwidth, options = group.get("BW", 40.0), round(group.get("OPTS", 0.0))
    lowest, highest = 0.52 * bandwidth, HIGHEST_SHARE * rate_hz
    center = min(max(group.get("FREQ", 80.0), lowest), highest)
    count = 2 if options & DOUBLE else 3 if options & TRIPLE else 1
    spread = bandwidth / (32 * center)
    quality = _native.ardupilot_notch_quality(center, bandwidth / count)
    offsets = {1: (0.0,), 2: (-spread, spread), 3: (0.0, -spread, spread)}[count]
    chosen = round(group.get("HMNCS", 3.0))
    found = (
        _native.ardupilot_notch_section(
            rate_hz, center * (number + 1) * (1 + offset), quality, group.get("ATT", 40.0)
        )
        for number in range(HARMONICS)
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
    parameters: Mapping[str, float], gyro_rate_hz: float
) -> tuple[tuple[Section, ...], tuple[str, ...]]:
    """Fixed notches IMU_GYRO_NF0 and NF1 (NF before 1.13), and a sentence on those that move."""
    sections = []
    for frequency, bandwidth in (
        ("IMU_GYRO_NF_FREQ", "IMU_GYRO_NF_BW"),
        ("IMU_GYRO_NF0_FRQ", "IMU_GYRO_NF0_BW"),
        ("IMU_GYRO_NF1_FRQ", "IMU_GYRO_NF1_BW"),
    ):
        settings = parameters.get(frequency, 0.0), parameters.get(bandwidth, 20.0)
        section = _native.px4_notch_section(gyro_rate_hz, *settings)
        if section is not None:
            sections.append(section)
    moving = parameters.get("IMU_GYRO_DNF_EN", 0.0) or parameters.get("IMU_GYRO_DYN_NF", 0.0)
    sentence = (
        "the dynamic gyro notches (IMU_GYRO_DNF) follow the motors: they are not in this view, and "
        "their phase lag is missing from margins"
    )
    return tuple(sections), (sentence,) if moving else ()
