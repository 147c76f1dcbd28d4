"""How strongly each frequency was injected, by the records themselves."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from flightid.frozen import dataclass
from flightid.record import Record

Array = NDArray[np.float64]
POINTS = 120
HALF_WIDTH, FEWEST_LINES = 1.15, 2
"""Ratio to the ends of the lines that are averaged about a frequency, and how many on each side."""
SWEPT = 0.1
"""Of the most of ω·S(ω), from which a frequency counts as swept: a sweep has a quarter at its
ends."""


@dataclass(frozen=True, eq=False)
class InjectedPower:
    """Spectrum of what was injected by way of one input, over all records.

    Attributes
    ----------
    omega_rad_s : ndarray, shape (n_f,)
        Frequencies, increasing, rad/s.
    density : ndarray, shape (n_f,)
        Mean power per Hz over half the square of the largest amplitude, 1/Hz: one-sided, over the
        time of all records, for every record adds noise where it sweeps nothing. A logarithmic
        sweep from f₁ to f₂ Hz makes 1/(f ln(f₂/f₁)) of it.
    seconds : float
        Of all records together, s.
    """

    omega_rad_s: Array
    density: Array
    seconds: float

    def at(self, omega_rad_s: Array) -> Array:
        """Density at frequencies, rad/s, in 1/Hz; nothing outside those that are known."""
        return np.interp(omega_rad_s, self.omega_rad_s, self.density, left=0.0, right=0.0)

    def is_swept(self, omega_rad_s: Array) -> NDArray[np.bool_]:
        """Whether frequencies, rad/s, lie where the excitation has power."""
        most = float(np.max(self.omega_rad_s * self.density, initial=0.0))
        return np.asarray((omega_rad_s * self.at(omega_rad_s) > SWEPT * most) & (most > 0.0))

    def to_dict(self) -> dict[str, Any]:
        """Plain values."""
        return {
            "omega_rad_s": self.omega_rad_s.tolist(),
            "density": self.density.tolist(),
            "seconds": self.seconds,
        }

    @classmethod
    def from_dict(cls, values: Mapping[str, Any]) -> InjectedPower:
        """Back from plain values."""
        return cls(
            np.array(values["omega_rad_s"], dtype=np.float64),
            np.array(values["density"], dtype=np.float64),
            float(values["seconds"]),
        )


def injected_power(records: Sequence[Record], inputs: Sequence[str]) -> dict[str, InjectedPower]:
    """Spectra of the excitations in records, by the input that each moves most.

    Parameters
    ----------
    records : sequence of Record
        With the signals that were injected as excitations.
    inputs : sequence of str

    Returns
    -------
    dict of str to InjectedPower
        Inputs that no excitation moves are not in it.

    Example
    -------
    >>> t = np.arange(0.0, 60.0, 0.01)
    >>> rate = math.log(50.0) / 60.0
    >>> swept = np.sin(2.0 * np.pi * 0.2 * np.expm1(rate * t) / rate)
    >>> record = Record.from_arrays(t, inputs={"u": swept}, outputs={"y": swept},
    ...                             excitations={"injected": swept})
    >>> of = injected_power([record], ["u"])["u"]
    >>> bool(0.9 < of.at(np.array([2.0 * np.pi]))[0] * math.log(50.0) < 1.1)
    True
    """
    moved: dict[str, list[tuple[Array, float]]] = {}
    for record in records:
        for name in record.excitations:
            values = np.asarray(record[name], dtype=np.float64)
            if np.ptp(values) > 0.0 and (chosen := _most_moved(record, values, inputs)):
                moved.setdefault(chosen, []).append((values, record.sample_time_s))
    seconds = math.fsum(len(each.time_s) * each.sample_time_s for each in records)
    return {name: _power(signals, seconds) for name, signals in moved.items()}


def _most_moved(record: Record, values: Array, inputs: Sequence[str]) -> str | None:
    """The input that hangs together with an excitation most, at whatever delay."""
    size = 1 << (len(values) - 1).bit_length()
    excited = np.fft.rfft(values - values.mean(), size)
    most, chosen = 0.0, None
    for name in inputs:
        if name not in record.inputs:
            continue
        channel = np.asarray(record[name], dtype=np.float64)
        channel = channel - channel.mean()
        length = float(np.linalg.norm(channel))
        if not length:
            continue
        together = np.fft.irfft(np.conj(excited) * np.fft.rfft(channel, size), size)
        if (alike := float(np.max(np.abs(together))) / length) > most:
            most, chosen = alike, name
    return chosen


def _power(signals: Sequence[tuple[Array, float]], seconds: float) -> InjectedPower:
    longest = max(len(values) * step for values, step in signals)
    fastest = min(step for _, step in signals)
    omega = np.geomspace(2.0 * FEWEST_LINES * math.pi / longest, math.pi / fastest, POINTS)
    amplitude = max(float(np.max(np.abs(values))) for values, _ in signals)
    energy = np.zeros(POINTS)
    for values, step in signals:
        lines = 2.0 * step**2 * np.abs(np.fft.rfft(values - values.mean())) ** 2
        place = omega / (2.0 * math.pi) * len(values) * step
        first = np.minimum(np.floor(place / HALF_WIDTH), np.rint(place) - FEWEST_LINES)
        last = np.maximum(np.ceil(place * HALF_WIDTH), np.rint(place) + FEWEST_LINES)
        low = np.clip(first, 1, len(lines) - 1).astype(int)
        high = np.clip(last, low + 1, len(lines)).astype(int)
        summed = np.append(0.0, np.cumsum(lines))
        energy += (summed[high] - summed[low]) / (high - low)
    return InjectedPower(omega, energy / seconds / (0.5 * amplitude**2), seconds)
