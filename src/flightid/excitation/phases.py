"""Phases of a multisine with a low peak: Schroeder's, improved through norms of rising order.

The largest magnitude is not smooth in the phases, its p-norm is: each round minimises
``log ||x||_p`` by conjugate gradients, one Fourier transform each, and starts the next round with p
doubled. (A quasi-Newton method ends no lower, and its small dense factorisations cost more than
the transforms.) The grid has eight points or more for each cycle of the fastest
harmonic, so that peaks between its points are within one percent.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np
import scipy
from numpy.typing import NDArray

from flightid.frozen import dataclass

NORMS = (4, 8, 16, 32, 64, 128)
POINTS_PER_CYCLE = 8
ITERATIONS_PER_NORM = 50


@dataclass(frozen=True, eq=False)
class Lines:
    """Harmonics of a period with their amplitudes; phases are what varies.

    Attributes
    ----------
    harmonics : ndarray, shape (n_lines,)
        Cycles in a period.
    amplitudes : ndarray, shape (n_lines,)
        Amplitudes of the cosines.
    """

    harmonics: NDArray[np.int64]
    amplitudes: NDArray[np.float64]

    def wave(self, phases: NDArray[np.float64], count: int) -> NDArray[np.float64]:
        """One period at `count` points, more than two for each cycle of the fastest harmonic."""
        transform = np.zeros(count // 2 + 1, dtype=np.complex128)
        transform[self.harmonics] = 0.5 * count * self.amplitudes * np.exp(1j * phases)
        return np.fft.irfft(transform, count)

    def at(self, turn: float, phases: NDArray[np.float64]) -> float:
        """Value at one moment, as a part of the period."""
        return float(self.amplitudes @ np.cos(2 * np.pi * self.harmonics * turn + phases))

    def fine(self) -> int:
        """Points of a grid (a power of two) that shows peaks between samples."""
        return 1 << int(POINTS_PER_CYCLE * self.harmonics[-1] - 1).bit_length()


def relative_peak_factor(signal: NDArray[np.float64]) -> float:
    """(max - min) / (2 sqrt(2) rms): 1 for a sine."""
    return float(np.ptp(signal) / (2 * np.sqrt(2) * np.sqrt(np.mean(signal**2))))


def schroeder_phases(lines: Lines) -> NDArray[np.float64]:
    """Phases that make the signal sweep through its harmonics.

    ``phi_n = phi_{n-1} - 2 pi (k_n - k_{n-1}) sum_{l<n} p_l`` with relative powers p.
    """
    power = lines.amplitudes**2 / np.sum(lines.amplitudes**2)
    before = np.concatenate(([0.0], np.cumsum(power)[:-1]))
    return np.asarray(
        -2 * np.pi * np.cumsum(np.diff(lines.harmonics, prepend=lines.harmonics[0]) * before)
    )


def best_phases(lines: Lines, *, starts: int, seed: int) -> NDArray[np.float64]:
    """Phases with the lowest relative peak factor over Schroeder's and random starts.

    The answer does not depend on the amplitude of the whole, which a design changes last: the
    latest answers are kept.
    """
    relative = lines.amplitudes / np.max(lines.amplitudes)
    return np.array(
        _searched(tuple(lines.harmonics.tolist()), tuple(relative.tolist()), starts, seed)
    )


@lru_cache(maxsize=32)
def _searched(
    harmonics: tuple[int, ...], amplitudes: tuple[float, ...], starts: int, seed: int
) -> tuple[float, ...]:
    lines = Lines(np.array(harmonics), np.array(amplitudes))
    random = np.random.default_rng(seed)
    candidates = [schroeder_phases(lines)]
    candidates += [
        random.uniform(0, 2 * np.pi, lines.harmonics.size) for _ in range(max(0, starts - 1))
    ]
    improved = [*candidates[:1], *(_lower_peak(lines, phases) for phases in candidates)]
    count = lines.fine()
    factors = [relative_peak_factor(lines.wave(phases, count)) for phases in improved]
    return tuple(improved[int(np.argmin(factors))].tolist())


def start_at_zero(lines: Lines, phases: NDArray[np.float64]) -> NDArray[np.float64]:
    """Phases moved so that the signal begins at its first zero with rising sign."""
    count = lines.fine()
    wave = lines.wave(phases, count)
    rising = np.flatnonzero((wave <= 0) & (np.roll(wave, -1) > 0))
    # A sum of harmonics without a mean changes sign: there is always one.
    start = int(rising[0])
    turn = scipy.optimize.brentq(
        lambda at: lines.at(at, phases), start / count, (start + 1) / count, xtol=1e-16, rtol=1e-15
    )
    return np.asarray(phases + 2 * np.pi * lines.harmonics * turn)


def _lower_peak(lines: Lines, phases: NDArray[np.float64]) -> NDArray[np.float64]:
    count = lines.fine()
    for order in NORMS:
        found = scipy.optimize.minimize(
            _log_norm,
            phases,
            args=(lines, order, count),
            jac=True,
            method="CG",
            options={"maxiter": ITERATIONS_PER_NORM},
        )
        phases = found.x
    return phases


def _log_norm(
    phases: NDArray[np.float64], lines: Lines, order: int, count: int
) -> tuple[float, NDArray[np.float64]]:
    """Logarithm of the p-norm and its gradient by the phases."""
    wave = lines.wave(phases, count)
    largest = np.max(np.abs(wave))
    ratio = wave / largest
    # ratio^(order − 1), order a power of two, as a product of squares: it keeps the sign.
    powered = square = ratio
    for _ in range(order.bit_length() - 2):
        square = square * square
        powered = powered * square
    total = np.mean(powered * ratio)
    moment = np.fft.rfft(powered)[lines.harmonics] / count
    slope = -lines.amplitudes * np.imag(np.exp(1j * phases) * np.conj(moment))
    return float(np.log(largest) + np.log(total) / order), slope / (largest * total)
