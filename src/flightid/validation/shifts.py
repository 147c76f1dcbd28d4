"""Shifts of a verification record: biases, reference shifts and initial state by least squares.

``dx/dt = A x + B (u - u_ref) + b``, ``y = C x + D (u - u_ref) + y_ref`` is linear in b, y_ref and
the initial state, so each one's share of the output is a column and all are solved at once.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from flightid import _native
from flightid.errors import DataError
from flightid.simulation.simulate import Matrices

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
    first_order_hold: bool,
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
    first_order_hold : bool
        Inputs are straight lines between samples, not steps.

    Returns
    -------
    tuple of ndarray and Shifts
        Prediction, shape (n_outputs, n_samples), and the shifts.
    """
    a, b, c, d, delays_s = matrices
    n_states, n_outputs = a.shape[0], c.shape[0]
    rest = np.zeros(n_states)
    _, plain = _native.simulate_linear(
        a, b, c, d, delays_s, driven, rest, sample_time_s, first_order_hold
    )
    columns = _columns(a, c, n_outputs, driven.shape[1], sample_time_s, freedom)
    if not columns:
        none = Shifts(rest, np.zeros(n_outputs), rest, 0, 0)
        return plain, none
    design = np.stack(columns, axis=-1)
    scale = np.sqrt(weights)[:, None]
    solution, rank = _solve(
        (scale[..., None] * design).reshape(-1, len(columns)),
        (scale * (measured - plain)).reshape(-1),
    )
    return plain + design @ solution, _sorted(solution, rank, n_states, n_outputs, freedom)


def _columns(
    a: NDArray[np.float64],
    c: NDArray[np.float64],
    n_outputs: int,
    n_samples: int,
    sample_time_s: float,
    freedom: Freedom,
) -> list[NDArray[np.float64]]:
    n_states = a.shape[0]
    found = []
    if freedom.bias:
        # A bias is a constant input that enters every state derivative by itself.
        constant = np.ones((1, n_samples))
        for index in range(n_states):
            entry = np.zeros((n_states, 1))
            entry[index] = 1.0
            _, answer = _native.simulate_linear(
                a,
                entry,
                c,
                np.zeros((n_outputs, 1)),
                np.zeros(1),
                constant,
                np.zeros(n_states),
                sample_time_s,
                False,
            )
            found.append(answer)
    if freedom.initial_state:
        nothing = np.zeros((1, n_samples))
        for index in range(n_states):
            start = np.zeros(n_states)
            start[index] = 1.0
            _, answer = _native.simulate_linear(
                a,
                np.zeros((n_states, 1)),
                c,
                np.zeros((n_outputs, 1)),
                np.zeros(1),
                nothing,
                start,
                sample_time_s,
                False,
            )
            found.append(answer)
    if freedom.reference:
        for index in range(n_outputs):
            shift = np.zeros((n_outputs, n_samples))
            shift[index] = 1.0
            found.append(shift)
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


def _sorted(
    solution: NDArray[np.float64], rank: int, n_states: int, n_outputs: int, freedom: Freedom
) -> Shifts:
    parts = {"bias": np.zeros(n_states), "initial": np.zeros(n_states)}
    place = 0
    for name, is_free in (("bias", freedom.bias), ("initial", freedom.initial_state)):
        if is_free:
            parts[name] = solution[place : place + n_states]
            place += n_states
    reference = solution[place:] if freedom.reference else np.zeros(n_outputs)
    return Shifts(parts["bias"], reference, parts["initial"], solution.size, rank)
