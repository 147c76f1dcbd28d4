"""Free runs of linear models, with the biases and the initial state that fit the record best.

``dx/dt = A x + B (u - u_ref) + b``, ``y = C x + D (u - u_ref) + y_ref`` is linear in b, y_ref and
the initial state, so each one's share of the output is a column and all are solved at once.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import field

import numpy as np
from numpy.typing import NDArray

from flightid.errors import DataError
from flightid.frozen import dataclass
from flightid.identification.prediction.free_run import Answer, FreeRun
from flightid.identification.prediction.result import Shifts
from flightid.models.linear.realisation import Matrices

RANK_TOLERANCE = 1e-10
"""Singular values below this share of the largest count as zero (columns have unit length)."""


@dataclass(frozen=True)
class Freedom:
    """What is solved for in a record, and on how much of it.

    Attributes
    ----------
    state_bias, output_bias : bool
    initial_state : bool or tuple of int
        All states at the first sample, none, or these.
    given : mapping of int to float
        States at the first sample that are known; the others start at rest.
    stretch : int or None
        First samples that tell what is solved for; None takes the whole record.
    """

    state_bias: bool
    output_bias: bool
    initial_state: bool | tuple[int, ...]
    given: Mapping[int, float] = field(default_factory=dict)
    stretch: int | None = None

    def free_states(self, n_states: int) -> tuple[int, ...]:
        """Places of the states that are solved for."""
        if isinstance(self.initial_state, tuple):
            return self.initial_state
        return tuple(range(n_states)) if self.initial_state else ()


def predict_linear(
    matrices: Matrices,
    driven: NDArray[np.float64],
    measured: NDArray[np.float64],
    sample_time_s: float,
    *,
    freedom: Freedom,
    weights: NDArray[np.float64],
    hold: str,
) -> tuple[NDArray[np.float64], Shifts]:
    """Free run of a model through one record with the best shifts.

    Parameters
    ----------
    matrices : tuple of ndarray
        A, B, C, D and the delay of each input, s.
    driven : ndarray, shape (n_inputs, n_samples)
        Inputs about their trim.
    measured : ndarray, shape (n_outputs, n_samples)
        What the prediction is compared with.
    sample_time_s : float
        Time between samples, s.
    freedom : Freedom
        Which shifts are free.
    weights : ndarray, shape (n_outputs,)
        What the square of one unit of error counts.
    hold : {"first", "zero"}
        What the inputs do between samples.

    Returns
    -------
    tuple of ndarray and Shifts
        Prediction, shape (n_outputs, n_samples), and the shifts.
    """
    n_samples, stretch = driven.shape[1], freedom.stretch
    # Growing modes can be followed backwards only where the whole state is free and the whole
    # record tells it.
    backwards = freedom.initial_state is True and stretch is None
    run = FreeRun(matrices, n_samples, sample_time_s, hold, backwards)
    n_states = run.n_states
    free = freedom.free_states(n_states)
    states, biases = run.free() if freedom.state_bias or free or freedom.given else ([], [])
    plain = _begun(run.driven(driven), states, freedom.given)
    n_outputs = len(plain.outputs)
    answers = [
        *(biases if freedom.state_bias else ()),
        *(states[place] for place in free),
        *(_output_biases(n_outputs, n_samples, n_states) if freedom.output_bias else ()),
    ]
    if not answers:
        none = np.zeros(n_states)
        return plain.outputs, Shifts(none, np.zeros(n_outputs), plain.start, 0, 0, run.e_folds)
    design = np.stack([answer.outputs for answer in answers], axis=-1)
    told = slice(None, stretch)
    scale = np.sqrt(weights)[:, None]
    solution, rank = _solve(
        (scale[..., None] * design[:, told]).reshape(-1, len(answers)),
        (scale * (measured - plain.outputs)[:, told]).reshape(-1),
    )
    # The state at the first sample is that of all runs together.
    start = plain.start + np.stack([answer.start for answer in answers], axis=-1) @ solution
    shifts = Shifts(
        solution[:n_states] if freedom.state_bias else np.zeros(n_states),
        solution[-n_outputs:] if freedom.output_bias else np.zeros(n_outputs),
        start if free else plain.start,
        solution.size,
        rank,
        run.e_folds,
        told_s=None if stretch is None else stretch * sample_time_s,
        is_open=rank < solution.size and rank < column_rank(design.reshape(-1, len(answers))),
    )
    return plain.outputs + design @ solution, shifts


def _begun(plain: Answer, states: list[Answer], given: Mapping[int, float]) -> Answer:
    """The driven run from known states."""
    outputs, start = plain.outputs, plain.start
    for place, value in given.items():
        outputs = outputs + value * states[place].outputs
        start = start + value * states[place].start
    return Answer(outputs, start)


def column_rank(design: NDArray[np.float64]) -> int:
    """How many columns differ, whatever their lengths.

    Example
    -------
    >>> column_rank(np.array([[1.0, 1e6], [1.0, 1e6], [0.0, 0.0]]))
    1
    """
    length = np.linalg.norm(design, axis=0)
    scaled = design / np.where(length > 0.0, length, 1.0)
    return int(np.linalg.matrix_rank(scaled, rtol=RANK_TOLERANCE))


def _output_biases(n_outputs: int, n_samples: int, n_states: int) -> list[Answer]:
    found = []
    for index in range(n_outputs):
        shift = np.zeros((n_outputs, n_samples))
        shift[index] = 1.0
        found.append(Answer(shift, np.zeros(n_states)))
    return found


def _solve(
    design: NDArray[np.float64], target: NDArray[np.float64]
) -> tuple[NDArray[np.float64], int]:
    length = np.linalg.norm(design, axis=0)
    if not (np.all(np.isfinite(length)) and np.all(np.isfinite(target))):
        raise DataError(
            "the free run grows beyond all numbers",
            needed="a record shorter than the time in which an unstable mode explodes",
            action="verify on shorter segments",
        )
    length[length == 0] = 1.0
    solution, _, rank, _ = np.linalg.lstsq(design / length, target, rcond=RANK_TOLERANCE)
    return solution / length, int(rank)
