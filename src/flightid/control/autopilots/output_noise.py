"""What the gyro's noise makes of an autopilot's output, by path and in its unit."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from flightid.control.autopilots.axis_loop import AxisLoop
from flightid.control.gyro import Gyro
from flightid.frozen import dataclass

Array = NDArray[np.float64]
LEAST_POWER = 1e-3
"""Of a filter (−30 dB): below it a filtered spectrum no longer tells what was ahead of it."""
LOWEST_HZ = 20.0
"""Motion of the vehicle and its loops lies below, noise of motors and frame above."""


@dataclass(frozen=True, eq=False)
class GyroSpectrum:
    """Noise of a gyro by frequency.

    Attributes
    ----------
    frequency_hz : ndarray, shape (n_f,)
        Rising, Hz.
    density : ndarray, shape (n_f,)
        One-sided, (rad/s)² per Hz.
    gyro : {"raw", "filtered"}
        Ahead of the autopilot's gyro filters, or behind them.
    """

    frequency_hz: Array
    density: Array
    gyro: Gyro

    def ahead_of(self, loop: AxisLoop) -> GyroSpectrum:
        """The spectrum ahead of the filters that flew, where it can be told."""
        if self.gyro == "raw":
            return self
        power = np.abs(loop.gyro_response(2.0 * np.pi * self.frequency_hz)) ** 2
        told = power >= LEAST_POWER
        return GyroSpectrum(self.frequency_hz[told], self.density[told] / power[told], "raw")

    def behind(self, loop: AxisLoop) -> tuple[Array, Array]:
        """Frequencies (rad/s) and density of what the controller is given, folded at its rate.

        Below 20 Hz, where the vehicle's own motion stands, the level just above it is taken.

        Returns
        -------
        tuple of ndarray
            As `flightid.tune_pid` takes `gyro_noise`: (n,) each, up to half of the loop's rate.
        """
        omega = 2.0 * np.pi * self.frequency_hz
        gain = np.ones_like(omega) if self.gyro == "filtered" else np.abs(loop.gyro_response(omega))
        density, half = self.density * gain**2, 0.5 * loop.loop_rate_hz
        grid = np.linspace(0.0, half, 401)
        folded = np.zeros_like(grid)
        top = float(self.frequency_hz[-1])
        for fold in range(int(top // half) + 1):
            low = fold * half
            at = low + grid if fold % 2 == 0 else low + half - grid
            folded += np.interp(at, self.frequency_hz, density, right=0.0)
        near = (grid >= LOWEST_HZ) & (grid <= 2.0 * LOWEST_HZ)
        folded[grid < LOWEST_HZ] = np.median(folded[near])
        return 2.0 * np.pi * grid, folded


@dataclass(frozen=True)
class OutputNoise:
    """Noise of the gyro in an axis' output, from 20 Hz up.

    Attributes
    ----------
    axis : str
    unit : str
        Of the output: 1 is full command of a multirotor.
    paths : mapping of str to float
        Rms of each path's part, by the name of its gain, in that unit.
    total : float
        Rms of all together.
    highest_hz : float
        Up to where the spectrum was known.
    """

    axis: str
    unit: str
    paths: Mapping[str, float]
    total: float
    highest_hz: float


def output_noise(
    loop: AxisLoop, spectrum: GyroSpectrum, *, flown: AxisLoop | None = None
) -> OutputNoise:
    """Noise of the gyro in the output, with the loop open.

    Parameters
    ----------
    loop : AxisLoop
        Filters and gains.
    spectrum : GyroSpectrum
        Of the axis.
    flown : AxisLoop, optional
        With the filters behind which a filtered spectrum was logged; default: `loop`.

    Assumes
    -------
    The loop's own answer is left out: above 20 Hz it is far below one. So is the integral, whose
    part is small there but for tones at multiples of the loop's rate, which the loop takes away.

    Reference
    ---------
    Bendat & Piersol, *Random Data*, 4th ed., eq. 6.7 (spectra through linear systems).
    """
    raw = spectrum.ahead_of(flown or loop)
    taken = raw.frequency_hz >= LOWEST_HZ
    frequency, density = raw.frequency_hz[taken], raw.density[taken]
    terms, names = loop.basis(2.0 * np.pi * frequency, gyro="raw", with_hold=False)
    gains = loop.gains
    parts = {
        name: gains[name] * term
        for name, term in zip(names, terms, strict=True)
        if name != loop.names["i"]
    }

    def rms(response: NDArray[np.complex128]) -> float:
        return float(np.sqrt(np.trapezoid(np.abs(response) ** 2 * density, frequency)))

    whole = sum(parts.values(), np.zeros(frequency.size, dtype=np.complex128))
    told = {name: rms(part) for name, part in parts.items() if gains[name]}
    return OutputNoise(
        loop.axis, loop.output_unit, told, rms(whole), float(frequency[-1]) if taken.any() else 0.0
    )
