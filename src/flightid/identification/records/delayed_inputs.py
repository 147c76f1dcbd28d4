"""Inputs at any time of a record, as their hold and the model's delays make them."""

from __future__ import annotations

from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from flightid.errors import ModelError
from flightid.frozen import dataclass
from flightid.models import StateSpaceModel

Array = NDArray[np.float64]
_WHOLE = 1e-9
"""Share of a sample that still counts as none."""
NODES = 8
"""Samples through which a smooth input runs, as in `smooth_input.rs`."""


@dataclass(frozen=True)
class DelayedInputs:
    """Inputs of one record behind the delays of a model at one point.

    Before its first sample an input had that sample's value; after the last it keeps it.

    Attributes
    ----------
    samples : ndarray, shape (n_inputs, n_samples)
    sample_time_s : float
    hold : {"zero", "first", "band_limited"}
    delays_s : ndarray, shape (n_inputs,)
    slopes : ndarray, shape (n_inputs, n_free)
        Derivatives of the delays by the free parameters, s per parameter unit.

    Example
    -------
    >>> late = DelayedInputs(np.array([[0.0, 1.0, 4.0]]), 0.1, "first", np.array([0.05]),
    ...                      np.zeros((1, 0)))
    >>> late.at(0.0)[0].tolist(), late.corners.tolist()
    ([[0.0, 0.5, 2.5]], [0.0, 0.5, 1.0])
    """

    samples: Array
    sample_time_s: float
    hold: str
    delays_s: Array
    slopes: Array

    @classmethod
    def of(
        cls, model: StateSpaceModel, values: Array, samples: Array, sample_time_s: float, hold: str
    ) -> DelayedInputs:
        """Behind the delays of a model at the values of its independent parameters.

        Raises
        ------
        ModelError
            A negative delay.
        """
        tape = model.parameters.tape(model.delays.values())
        delays = np.asarray(tape.evaluate(values))
        if np.any(delays < 0.0):
            found = f"{delays.min():g} s"
            raise ModelError("a delay is negative", found=found, needed="0 s or more")
        slopes = np.asarray(tape.jacobian(values, model.parameters.free_indices))
        return cls(samples, sample_time_s, hold, delays, slopes.reshape(len(samples), -1))

    def split(self, row: int) -> tuple[int, float]:
        """Whole samples in a delay, and the part of a sample that is left."""
        late = float(self.delays_s[row]) / self.sample_time_s
        whole = int(np.floor(late + _WHOLE))
        return whole, max(late - whole, 0.0)

    @property
    def corners(self) -> Array:
        """Places in a sample interval, 0 to 1, between which every input is smooth."""
        inner = {self.split(row)[1] for row in range(len(self.samples))}
        inner = set() if self.hold == "band_limited" else inner
        return np.array(sorted({0.0, 1.0, *(each for each in inner if each > _WHOLE)}))

    def at(self, place: float, side: float = 0.0) -> tuple[Array, Array]:
        """Inputs at a place in every sample interval, and their derivatives by time, kept.

        Parameters
        ----------
        place : float
            0 at the interval's first sample, 1 at its last.
        side : float
            Added to the place to say on which side of a corner it lies.

        Returns
        -------
        tuple of ndarray, shape (n_inputs, n_samples) each
            Unit, and unit per s; steps have no derivative.
        """
        if (place, side) not in self._known:
            self._known[place, side] = self._made(place, side)
        return self._known[place, side]

    @cached_property
    def _known(self) -> dict[tuple[float, float], tuple[Array, Array]]:
        """What `at` has given: rounds and refits ask for the same few places."""
        return {}

    def is_like(self, other: DelayedInputs) -> bool:
        """Whether it gives the same at any place, of the same samples."""
        return (
            self.samples is other.samples
            and (self.sample_time_s, self.hold) == (other.sample_time_s, other.hold)
            and np.array_equal(self.delays_s, other.delays_s)
            and np.array_equal(self.slopes, other.slopes)
        )

    def _made(self, place: float, side: float) -> tuple[Array, Array]:
        values, rates = np.empty_like(self.samples), np.zeros_like(self.samples)
        for row in range(len(self.samples)):
            whole, part = self.split(row)
            after = place + side - part >= -_WHOLE
            near = [self._shifted(row, whole + (not after) - k) for k in (0, 1)]
            if self.hold == "zero":
                values[row] = near[0]
            elif self.hold == "first":
                share = place - part + (not after)
                values[row] = near[0] + share * (near[1] - near[0])
                rates[row] = (near[1] - near[0]) / self.sample_time_s
            else:
                values[row], rates[row] = self._smooth(row, whole, place - part)
        values.flags.writeable = rates.flags.writeable = False
        return values, rates

    def changes(self) -> tuple[Array, Array]:
        """The corner in every sample interval, and what an input does there.

        Returns
        -------
        places : ndarray, shape (n_inputs,)
            0 to 1.
        changes : ndarray, shape (n_inputs, n_samples)
            Jump of a step (unit), or of the slope of straight lines (unit per s).
        """
        places, found = np.zeros(len(self.samples)), np.zeros_like(self.samples)
        for row in range(len(self.samples)):
            whole, places[row] = self.split(row)
            past, now, after = (self._shifted(row, whole + k) for k in (1, 0, -1))
            if self.hold == "zero":
                found[row] = now - past
            elif self.hold == "first":
                found[row] = (after - 2.0 * now + past) / self.sample_time_s
        return places, found

    def _shifted(self, row: int, late: int) -> Array:
        count = self.samples.shape[1]
        return np.asarray(self.samples[row, np.clip(np.arange(count) - late, 0, count - 1)])

    def _smooth(self, row: int, whole: int, place: float) -> tuple[Array, Array]:
        first = int(np.floor(place))
        weights, slopes = lagrange(place - first + 3.0, NODES)
        near = np.array([self._shifted(row, whole - first + 3 - k) for k in range(NODES)])
        return weights @ near, slopes @ near / self.sample_time_s


def lagrange(place: float, count: int) -> tuple[Array, Array]:
    """Weights of the polynomial through samples 0 … count − 1 at a place, and their slopes.

    Example
    -------
    >>> weights, slopes = lagrange(1.5, 4)
    >>> float(weights @ np.arange(4) ** 2), float(slopes @ np.arange(4) ** 2)
    (2.25, 3.0)
    """
    weights, slopes = np.ones(count), np.zeros(count)
    for k in range(count):
        for other in range(count):
            if other != k:
                factor = (place - other) / (k - other)
                slopes[k] = slopes[k] * factor + weights[k] / (k - other)
                weights[k] *= factor
    return weights, slopes
