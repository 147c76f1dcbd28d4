"""Shifts of a verification record: biases, reference shifts and initial state by least squares.

``dx/dt = A x + B (u - u_ref) + b``, ``y = C x + D (u - u_ref) + y_ref`` is linear in b, y_ref and
the initial state, so each one's share of the output is a column and all are solved at once.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from flightid.errors import DataError
from flightid.models.linear.realisation import Matrices
from flightid.validation.verification.free_run import Answer, FreeRun

RANK_TOLERANCE = 1e-10
"""Singular values below this share of the largest count as zero (columns have unit length)."""


@dataclass(frozen=True, eq=False)
class Shifts:
    """What was solved for in one record.

    Attributes
    ----------
    bias : ndarray, shape (n_states,)
        Constant added to the state derivatives; zero where it was not free.
    reference : ndarray, shape (n_outputs,)
        Constant added to the outputs, in their units.
    initial_state : ndarray, shape (n_states,)
        State at the first sample.
    n_free : int
        Numbers that were free.
    rank : int
        How many of them the record tells apart; fewer than `n_free` means that their values are
        one choice among many, while the prediction is not touched.
    e_folds : float
        How often the model's fastest growing mode grows by e over the record; 0 where none grows.
    input_shift : ndarray, shape (n_inputs,), or None
        Of a nonlinear model, whose equations were integrated: constant added to the inputs.

    Example
    -------
    >>> Shifts(np.zeros(1), np.array([0.2]), np.zeros(1), 2, 2).reference
    array([0.2])
    """

    bias: NDArray[np.float64]
    reference: NDArray[np.float64]
    initial_state: NDArray[np.float64]
    n_free: int
    rank: int
    e_folds: float = 0.0
    input_shift: NDArray[np.float64] | None = None


@dataclass(frozen=True)
class Freedom:
    """Which shifts are solved for."""

    bias: bool
    reference: bool
    initial_state: bool


def predict(
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
    n_samples = driven.shape[1]
    run = FreeRun(matrices, n_samples, sample_time_s, hold, freedom.initial_state)
    plain = run.driven(driven)
    n_outputs = len(plain.outputs)
    states, biases = run.free() if freedom.bias or freedom.initial_state else ([], [])
    answers = [
        *(biases if freedom.bias else ()),
        *(states if freedom.initial_state else ()),
        *(_reference_shifts(n_outputs, n_samples, run.n_states) if freedom.reference else ()),
    ]
    if not answers:
        none = np.zeros(run.n_states)
        return plain.outputs, Shifts(none, np.zeros(n_outputs), none, 0, 0, run.e_folds)
    design = np.stack([answer.outputs for answer in answers], axis=-1)
    scale = np.sqrt(weights)[:, None]
    solution, rank = _solve(
        (scale[..., None] * design).reshape(-1, len(answers)),
        (scale * (measured - plain.outputs)).reshape(-1),
    )
    # The state at the first sample is that of all runs together.
    start = plain.start + np.stack([answer.start for answer in answers], axis=-1) @ solution
    shifts = Shifts(
        solution[: run.n_states] if freedom.bias else np.zeros(run.n_states),
        solution[-n_outputs:] if freedom.reference else np.zeros(n_outputs),
        start if freedom.initial_state else np.zeros(run.n_states),
        solution.size,
        rank,
        run.e_folds,
    )
    return plain.outputs + design @ solution, shifts


def _reference_shifts(n_outputs: int, n_samples: int, n_states: int) -> list[Answer]:
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
