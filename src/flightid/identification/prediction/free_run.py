"""Free runs of a linear model through one record, exact for records of any length.

Where the initial state is solved for, modes that grow are followed from the end of the record
backwards (see `flightid.simulation.model_outputs`): together with the other modes, followed
forwards, they span the same solutions of the same equations.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from flightid.frozen import dataclass
from flightid.models.linear.realisation import Matrices
from flightid.simulation.model_outputs import (
    ModeSubset,
    System,
    between_samples,
    driven_outputs,
    free_outputs,
    split_modes,
)

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Answer:
    """One run.

    Attributes
    ----------
    outputs : ndarray, shape (n_outputs, n_samples)
        What it adds to the outputs.
    start : ndarray, shape (n_states,)
        Its state at the first sample.
    """

    outputs: Array
    start: Array


def growth(a: Array, duration_s: float) -> float:
    """How often the fastest growing mode of A grows by e; 0 where none grows.

    Example
    -------
    >>> growth(np.diag([-1.0, 0.5]), 4.0)
    2.0
    """
    return max(float(np.max(np.linalg.eigvals(a).real, initial=-np.inf)) * duration_s, 0.0)


@dataclass(frozen=True, eq=False)
class FreeRun:
    """Answers of a model to its inputs, to its free states and to constant biases.

    Attributes
    ----------
    matrices : tuple of ndarray
        A, B, C, D and the delay of each input, s.
    n_samples : int
        Length of the record.
    sample_time_s : float
        Time between samples, s.
    hold : {"first", "zero"}
        What the inputs do between samples.
    free_start : bool
        The initial state is solved for: growing modes are followed backwards.

    Example
    -------
    >>> growing = (np.eye(1), np.eye(1), np.eye(1), np.zeros((1, 1)), np.zeros(1))
    >>> run = FreeRun(growing, 4001, 0.01, "first", free_start=True)
    >>> held = run.driven(np.ones((1, 4001))).outputs   # forwards: exp(40) - 1 at the end
    >>> bool(np.max(np.abs(held)) <= 1.0)
    True
    """

    matrices: Matrices
    n_samples: int
    sample_time_s: float
    hold: str
    free_start: bool

    @property
    def n_states(self) -> int:
        """Number of states."""
        return len(self.matrices[0])

    @property
    def duration_s(self) -> float:
        """Length of the record, s."""
        return (self.n_samples - 1) * self.sample_time_s

    @property
    def e_folds(self) -> float:
        """How often the fastest growing mode grows by e over the record."""
        return growth(self.matrices[0], self.duration_s)

    def driven(self, inputs: Array) -> Answer:
        """Answer to the inputs, shape (n_inputs, n_samples), with every free state at zero."""
        _, b, _, d, delays_s = self.matrices
        modes = self._modes(b, d, delays_s)
        between = between_samples(inputs, self.hold)
        return self._answer(driven_outputs(modes, between, self.sample_time_s, self.hold))

    def free(self) -> tuple[list[Answer], list[Answer]]:
        """Answers to each free state, and to a constant 1 added to each state derivative."""
        n = self.n_states
        if not n:
            return [], []
        modes = self._modes(np.eye(n), np.zeros((len(self.matrices[2]), n)), np.zeros(n))
        found = [
            self._answer(column)
            for column in free_outputs(modes, self.n_samples, self.sample_time_s)
        ]
        return found[:n], found[n:]

    def _modes(self, b: Array, d: Array, delays_s: Array) -> list[ModeSubset]:
        """Parts of the model with its states as further outputs."""
        a, _, c, _, _ = self.matrices
        watched = (a, b, np.vstack([c, np.eye(len(a))]), np.vstack([d, np.zeros(b.shape)]))
        system = System((), (), watched, delays_s)
        if self.free_start:
            return split_modes(system, self.duration_s)
        return [ModeSubset(watched, delays_s, backwards=False)]

    def _answer(self, found: Array) -> Answer:
        n_outputs = len(self.matrices[2])
        return Answer(found[:n_outputs], found[n_outputs:, 0])
