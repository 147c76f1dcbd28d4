"""Free runs of a linear model through one record, exact for records of any length.

A mode that grows makes a run forward in time useless: what rounding does to its first sample is
multiplied by exp(σ T). Run backward in time the same mode decays. Where the initial state is
solved for anyway, the growing part of the model is therefore run backward from the end of the
record, on its own coordinates, and the rest forward from the beginning: together they span the
same solutions of the same equations.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import schur, solve_sylvester

from flightid import _native
from flightid.simulation.simulate import Matrices

FORWARD_GROWTH = 1.0
"""Modes that grow by more than exp of this over the record are run backward."""
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


class FreeRun:
    """Answers of a model to its inputs, to constant biases and to its initial state.

    Parameters
    ----------
    matrices : tuple of ndarray
        A, B, C, D and the delay of each input, s.
    n_samples : int
        Length of the record.
    sample_time_s : float
        Time between samples, s.
    first_order_hold : bool
        Inputs are straight lines between samples, not steps.
    backward : bool
        Growing modes run backward from the end: right where the initial state is solved for.

    Reference
    ---------
    Ascher, Mattheij & Russell, Numerical Solution of Boundary Value Problems for Ordinary
    Differential Equations, section 3.4 (dichotomy: growing modes are set at the end).

    Example
    -------
    >>> growing = (np.eye(1), np.eye(1), np.eye(1), np.zeros((1, 1)), np.zeros(1))
    >>> run = FreeRun(growing, 4001, 0.01, first_order_hold=True, backward=True)
    >>> held = run.driven(np.ones((1, 4001))).outputs   # forward: exp(40) - 1 at the end
    >>> bool(np.max(np.abs(held)) <= 1.0)
    True
    """

    def __init__(
        self,
        matrices: Matrices,
        n_samples: int,
        sample_time_s: float,
        *,
        first_order_hold: bool,
        backward: bool,
    ) -> None:
        a, b, c, d, self._delays_s = matrices
        self._d = d
        self._n_samples, self._sample_time_s = n_samples, sample_time_s
        self._first_order_hold = first_order_hold
        duration_s = (n_samples - 1) * sample_time_s
        limit = FORWARD_GROWTH / duration_s if backward and duration_s > 0 else np.inf
        blocks, self._to_states, self.n_growing = _split(a, limit)
        n = self.n_growing
        self._growing, self._rest = blocks[:n, :n], blocks[n:, n:]
        self._from_states = np.linalg.inv(self._to_states)
        self._b = self._from_states @ b
        self._c = c @ self._to_states
        self.e_folds = max(_largest_real(a) * duration_s, 0.0)

    @property
    def n_states(self) -> int:
        """Number of states, and of initial conditions."""
        return len(self._to_states)

    def driven(self, inputs: Array) -> Answer:
        """Answer to the inputs, shape (n_inputs, n_samples), with every free state at zero."""
        n = self.n_growing
        forward, rest = self._simulate(
            self._rest, self._b[n:], self._c[:, n:], self._d, self._delays_s, inputs
        )
        if n == 0:
            return self._answer(forward, np.zeros(0), rest)
        late, growing = self._backward(inputs)
        return self._answer(forward + late, growing, rest)

    def constant(self, index: int) -> Answer:
        """Answer to one state derivative with a constant 1 added."""
        n = self.n_growing
        entry: Array = self._from_states[:, [index]].astype(np.float64)
        nothing = np.zeros((len(self._c), 1))
        held = np.ones((1, self._n_samples))
        outputs, rest = self._simulate(
            self._rest, entry[n:], self._c[:, n:], nothing, np.zeros(1), held
        )
        # A growing mode cannot be singular: it rests where it balances the constant.
        growing = np.zeros(0)
        if n:
            growing = -np.linalg.solve(self._growing, entry[:n, 0]).astype(np.float64)
        return self._answer(outputs + (self._c[:, :n] @ growing)[:, None], growing, rest)

    def free_state(self, index: int) -> Answer:
        """Answer to one free number: a growing mode's end, or another coordinate's beginning."""
        n = self.n_growing
        unit = np.zeros(self.n_states)
        unit[index] = 1.0
        silent = np.zeros((1, self._n_samples))
        nothing = np.zeros((len(self._c), 1))
        block = -self._growing if index < n else self._rest
        place = slice(None, n) if index < n else slice(n, None)
        start = unit[place]
        states, outputs = _native.simulate_linear(
            np.ascontiguousarray(block),
            np.zeros((len(block), 1)),
            np.ascontiguousarray(self._c[:, place]),
            nothing,
            np.zeros(1),
            silent,
            start,
            self._sample_time_s,
            False,
        )
        if index >= n:
            return self._answer(outputs, np.zeros(n), start)
        return self._answer(outputs[:, ::-1], states[:, -1], np.zeros(self.n_states - n))

    def _answer(self, outputs: Array, growing: Array, rest: Array) -> Answer:
        return Answer(outputs, self._to_states @ np.concatenate([growing, rest]))

    def _simulate(
        self, a: Array, b: Array, c: Array, d: Array, delays_s: Array, inputs: Array
    ) -> tuple[Array, Array]:
        """Run from rest; outputs and the state at the first sample."""
        states, outputs = _native.simulate_linear(
            np.ascontiguousarray(a),
            np.ascontiguousarray(b),
            np.ascontiguousarray(c),
            np.ascontiguousarray(d),
            np.ascontiguousarray(delays_s),
            np.ascontiguousarray(inputs),
            np.zeros(len(a)),
            self._sample_time_s,
            self._first_order_hold,
        )
        return outputs, states[:, 0]

    def _backward(self, inputs: Array) -> tuple[Array, Array]:
        """Growing modes from the end; outputs, and their state at the first sample.

        Backward in time a delay is an advance. The run therefore starts late enough after the
        record for the remaining shift to be a delay again; what it starts from is free.
        """
        extra = int(np.ceil(np.max(self._delays_s, initial=0.0) / self._sample_time_s))
        turned = inputs[:, ::-1]
        if not self._first_order_hold:
            # A step holds forward in time, so backward it is known one sample earlier.
            turned = np.hstack([turned[:, 1:], turned[:, -1:]])
        turned = np.hstack([turned, np.repeat(inputs[:, :1], extra, axis=1)])
        n = self.n_growing
        states, outputs = _native.simulate_linear(
            np.ascontiguousarray(-self._growing),
            np.ascontiguousarray(-self._b[:n]),
            np.ascontiguousarray(self._c[:, :n]),
            np.zeros(self._d.shape),
            extra * self._sample_time_s - self._delays_s,
            np.ascontiguousarray(turned),
            np.zeros(n),
            self._sample_time_s,
            self._first_order_hold,
        )
        return outputs[:, extra:][:, ::-1], states[:, -1]


def _largest_real(a: Array) -> float:
    return float(np.max(np.linalg.eigvals(a).real, initial=-np.inf))


def _split(a: Array, limit: float) -> tuple[Array, Array, int]:
    """Block-diagonal A with modes growing faster than `limit` first, its basis, their number."""
    if _largest_real(a) <= limit:
        return a, np.eye(len(a)), 0
    triangular, basis, n = schur(a, output="real", sort=lambda re, _im: re > limit)
    growing, rest = triangular[:n, :n], triangular[n:, n:]
    mix = solve_sylvester(growing, -rest, -triangular[:n, n:])
    shear = np.eye(len(a))
    shear[:n, n:] = mix
    blocks = np.zeros_like(a)
    blocks[:n, :n], blocks[n:, n:] = growing, rest
    return blocks, basis @ shear, n
