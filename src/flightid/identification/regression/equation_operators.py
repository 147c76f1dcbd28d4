"""What equation error does to both sides of ẋ = f(x, u): a local mean, or a Fourier sum.

Each operator is linear and turns the differences of measured states from sample to sample into
something smooth, and the integrals of the right side over the same intervals into the same. What a
constant error of an equation (a bias, a trim) or the ends of the record add is a known direction,
taken out exactly.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from flightid.conditioning.smoothing import local_derivative, local_mean
from flightid.frozen import dataclass
from flightid.identification.regression.harmonics import FEWEST_SAMPLES, Harmonics
from flightid.identification.regression.sampled_equations import StateMeasurements, require_length

Array = NDArray[np.float64]


class Operator(Protocol):
    """One record's operator."""

    def derivative(self, states: Array) -> Array:
        """Left sides of the state equations, (n_states, n_rows)."""

    def means(self, cells: Array) -> Array:
        """The same of mean derivatives over the sample intervals, time last: (..., n_rows)."""

    def values(self, samples: Array) -> Array:
        """Outputs at the samples, measured or computed, time last: (..., n_rows)."""

    def nuisance(self, *, is_state: bool) -> Array | None:
        """Direction of one unknown constant in each row, (n_rows,), or None."""

    def in_time(self, rows: Array) -> Array:
        """Rows as samples of time, (n_equations, n_times)."""

    def with_motion(self, motion: StateMeasurements) -> Operator:
        """The same operator on another motion of the same length."""


@dataclass(frozen=True)
class LocalMeans:
    """Time domain: derivatives of local parabolas, and the means that belong to them.

    Attributes
    ----------
    motion : StateMeasurements
    half_width : int
        Neighbours on each side.
    output_bias : bool
        Whether each equation has an unknown constant in this record.
    """

    motion: StateMeasurements
    half_width: int
    output_bias: bool = True

    def __post_init__(self) -> None:
        require_length(self.motion, 4 * (self.half_width + 2))

    def derivative(self, states: Array) -> Array:
        """Left sides of the state equations."""
        step, width = self.motion.sample_time_s, self.half_width
        rows = [local_derivative(state, step, half_width=width) for state in states]
        return np.array(rows).reshape(states.shape)[:, width + 1 : -width - 1]

    def means(self, cells: Array) -> Array:
        """The means over neighbouring intervals that the parabola's slope is made of."""
        width = self.half_width
        ahead = np.arange(-width, width + 1)
        weights = np.cumsum(ahead[::-1])[::-1][1:] / np.sum(ahead**2)
        count = self.motion.n_samples - 2 * width - 2
        found = np.zeros((*cells.shape[:-1], count))
        for place, weight in enumerate(weights, start=1):
            found += weight * cells[..., place : place + count]
        return found

    def values(self, samples: Array) -> Array:
        """Local means."""
        return local_mean(samples, half_width=self.half_width)

    def nuisance(self, *, is_state: bool) -> Array | None:  # noqa: ARG002
        """A constant, where biases are free."""
        count = self.motion.n_samples - 2 * self.half_width - 2
        return np.ones(count) if self.output_bias else None

    def in_time(self, rows: Array) -> Array:
        """The rows themselves."""
        return rows

    def with_motion(self, motion: StateMeasurements) -> LocalMeans:
        """The same operator on another motion."""
        return replace(self, motion=motion)


@dataclass(frozen=True)
class FourierRows:
    """Frequency domain: sums over the record at its harmonics; real parts, then imaginary.

    With z = exp(jωT) the sum of x(k+1) − x(k) is (z − 1) x̃ + z [x(end) − x(0)]: what the ends add
    is one real number for all harmonics, and is estimated, for the measured ends are noisy.

    Attributes
    ----------
    motion : StateMeasurements
    band : tuple of float or None
        Lowest and highest frequency, rad/s.
    """

    motion: StateMeasurements
    band: tuple[float, float] | None

    def __post_init__(self) -> None:
        require_length(self.motion, FEWEST_SAMPLES)
        _ = self.grid

    @property
    def grid(self) -> Harmonics:
        """Harmonics in the band."""
        return Harmonics.inside(self.band, self.motion.n_samples, self.motion.sample_time_s)

    def _scale(self) -> float:
        # Integrals over the square root of the length: noise is the same in long and short records.
        return float(1.0 / np.sqrt(self.motion.n_samples * self.motion.sample_time_s))

    def derivative(self, states: Array) -> Array:
        """(z − 1) x̃ over the sample time; the ends are in `nuisance`."""
        grid = self.grid
        moved = (grid.turn - 1.0) / grid.sample_time_s * grid.total(states) * self._scale()
        return np.concatenate([moved.real, moved.imag], axis=-1)

    def means(self, cells: Array) -> Array:
        """Sums of the intervals, each at its beginning."""
        return self.values(cells)

    def values(self, samples: Array) -> Array:
        """Sums over one period."""
        found = self.grid.total(samples) * self._scale()
        return np.concatenate([found.real, found.imag], axis=-1)

    def nuisance(self, *, is_state: bool) -> Array | None:
        """What the ends of the record add to the integral of a derivative."""
        if not is_state:
            return None
        turn = self.grid.turn
        return np.concatenate([turn.real, turn.imag])

    def in_time(self, rows: Array) -> Array:
        """What the band holds."""
        real, imaginary = np.split(rows, 2, axis=1)
        whole = (real + 1j * imaginary) / self._scale()
        return self.grid.in_time(np.asarray(whole, dtype=np.complex128))

    def with_motion(self, motion: StateMeasurements) -> FourierRows:
        """The same operator on another motion."""
        return replace(self, motion=motion)
