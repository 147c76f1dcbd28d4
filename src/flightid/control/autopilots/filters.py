"""Exact frequency responses of the discrete filters in autopilots.

Native side: `notch_filter.rs`, `gyro_filter.rs`, `one_pole.rs`.
Frequencies are in rad/s and need not lie below half the sample rate; all responses are exact for a
tone that is sampled at the filter's own rate.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

Omega = NDArray[np.float64]
Response = NDArray[np.complex128]
Section = tuple[float, float, float, float, float]
"""b0, b1, b2, a1, a2 of a second-order section with a0 = 1."""


def delay_operator(omega: Omega, rate_hz: float) -> Response:
    """z⁻¹ on the unit circle: one sample's delay; a loop asks for it at the same ω many times."""
    omega = np.asarray(omega, dtype=np.float64)
    return _turns(omega.tobytes(), rate_hz).reshape(omega.shape)


@lru_cache(maxsize=16)
def _turns(omega: bytes, rate_hz: float) -> Response:
    angle = np.frombuffer(omega) / rate_hz
    turns = np.empty(angle.size, dtype=np.complex128)
    turns.real, turns.imag = np.cos(angle), -np.sin(angle)
    turns.flags.writeable = False
    return turns


def sections_response(sections: Iterable[Section], omega: Omega, rate_hz: float) -> Response:
    """Product of second-order sections."""
    back = delay_operator(omega, rate_hz)
    product = np.ones_like(back)
    for b0, b1, b2, a1, a2 in sections:
        product = product * (b0 + back * (b1 + back * b2)) / (1 + back * (a1 + back * a2))
    return product


def one_pole_weight(cutoff_hz: float, rate_hz: float) -> float:
    """Weight of the newest sample in a one-pole low-pass; 1 where 0 Hz switches it off."""
    if cutoff_hz <= 0:
        return 1.0
    step = 1 / rate_hz
    return step / (step + 1 / (2 * math.pi * cutoff_hz))


def one_pole_section(cutoff_hz: float, rate_hz: float) -> Section:
    """One-pole low-pass as a section."""
    weight = one_pole_weight(cutoff_hz, rate_hz)
    return (weight, 0.0, 0.0, weight - 1.0, 0.0)


def one_pole_response(cutoff_hz: float, omega: Omega, rate_hz: float) -> Response:
    """One-pole low-pass, y ← y + α (x − y)."""
    weight = one_pole_weight(cutoff_hz, rate_hz)
    return np.asarray(weight / (1 - (1 - weight) * delay_operator(omega, rate_hz)))


def difference_response(omega: Omega, rate_hz: float) -> Response:
    """Backward difference over the sample time, 1/s."""
    # 1 − e^(−jx) = 2 j sin(x/2) e^(−jx/2): nothing cancels at low frequencies.
    half = delay_operator(omega, 2.0 * rate_hz)
    return np.asarray(-2j * rate_hz * half.imag * half)


def hold_response(omega: Omega, rate_hz: float) -> Response:
    """Output held between samples (zero-order hold), without the sampler's 1/T."""
    half = 0.5 * omega / rate_hz
    return np.asarray(np.sinc(half / np.pi) * np.exp(-1j * half))
