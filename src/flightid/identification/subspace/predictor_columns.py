"""What each free number of a predictor adds to its errors, by the transposed recursion.

Answers c (q − Ā)⁻¹ e_i u to all directions e_i of the state are the state of z⁺ = Āᵀ z + cᵀ u: one
run for each pair of an output and a signal gives the columns of all states, where runs of the
predictor itself would take one for each column.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from flightid import _native
from flightid.errors import DataError
from flightid.frozen import dataclass
from flightid.models.sampled.recursion import run_recursion, spent_after
from flightid.uncertainty.triangle import triangle_of_parts, triangle_of_rows

Array = NDArray[np.float64]
AT_ONCE = 1 << 14
"""Samples that are run and met with each other while they are in the cache."""


@dataclass(frozen=True, eq=False)
class OwnColumns:
    """Errors of a predictor by what is a record's own: initial state and levels of outputs.

    Attributes
    ----------
    closed : ndarray, shape (n, n)
        Ā = A − K C.
    shown : ndarray, shape (p, n)
        C, whitened.
    gain : ndarray, shape (n, p)
        K.
    scale : ndarray, shape (p, p)
        What outputs are whitened by.
    start, levels : bool
        Which of the two are free.
    """

    closed: Array
    shown: Array
    gain: Array
    scale: Array
    start: bool
    levels: bool

    @property
    def count(self) -> int:
        """Columns: initial states, then levels."""
        return self.start * len(self.closed) + self.levels * len(self.shown)

    def columns(self, n_samples: int) -> Array:
        """Columns over the samples of a record in which they show, shape (p, n_shown, count)."""
        lasting = spent_after(self.closed, n_samples) if self.start else 0
        into = np.zeros((len(self.shown), n_samples if self.levels else lasting, self.count))
        if self.start:
            rest = np.zeros((len(self.shown), len(self.closed), lasting))
            begun = run_recursion(self.closed.T, rest, self.shown)
            into[:, :lasting, : len(self.closed)] = begun.swapaxes(1, 2)
        if self.levels:
            held = np.repeat(self.shown[:, :, None], n_samples, axis=2)
            answers = run_recursion(self.closed.T, held)
            first = self.count - len(self.shown)
            into[:, :, first:] = self.scale[:, None] - answers.swapaxes(1, 2) @ self.gain
        return into


@dataclass(frozen=True, eq=False)
class InputColumns:
    """Errors of a predictor by the entries of B, those of D, and a record's own numbers.

    The last column are the errors without any of these.

    Attributes
    ----------
    closed : ndarray, shape (n, n)
    c : ndarray, shape (p, n)
    gain : ndarray, shape (n, p)
    direct, levels : bool
        Whether D and levels of outputs are free.
    """

    closed: Array
    c: Array
    gain: Array
    direct: bool
    levels: bool

    def triangle(self, y: Array, u: Array) -> Array:
        """Triangle of the columns over a record, from outputs (p, n_samples) and inputs.

        Raises
        ------
        DataError
            The predictor runs away.
        """
        n_samples = y.shape[1]
        if n_samples <= AT_ONCE:
            return triangle_of_rows(np.concatenate([part.T for part in self._parts(y, u)]))
        lasting = spent_after(self.closed, n_samples)
        run = np.ascontiguousarray(self.closed.T), self.c, self.gain
        products = _native.input_products(run, y, u, self.direct, self.levels, lasting)
        return triangle_of_parts(lambda: (part.T for part in self._parts(y, u)), products)

    def _parts(self, y: Array, u: Array) -> Iterator[Array]:
        """Columns of each output over some samples."""
        (p, n), m = self.c.shape, len(u)
        n_free = n * m + p * m * self.direct
        count = n_free + n + p * self.levels + 1
        lasting = spent_after(self.closed, y.shape[1])
        begun, driven, state = self.c, np.zeros((p, m + self.levels, n)), np.zeros(n)
        for first in range(0, y.shape[1], AT_ONCE):
            span = slice(first, first + AT_ONCE)
            outputs, signals = y[:, span], u[:, span]
            if self.levels:
                signals = np.concatenate([signals, np.ones((1, signals.shape[1]))])
            answers, driven = self._run(self.closed.T, self._pushes(signals), driven)
            own, state = self._run(self.closed, self.gain @ outputs, state)
            starts = np.zeros((p, n, outputs.shape[1]))
            if first < lasting:
                starts, begun = self._run(self.closed.T, starts, begun)
            for output in range(p):
                rows = np.zeros((count, outputs.shape[1]))
                rows[: n * m] = answers[output, :m].swapaxes(0, 1).reshape(n * m, -1)
                if self.direct:
                    turned = self.gain.T @ answers[output, :m]
                    rows[n * m : n_free] = -turned.swapaxes(0, 1).reshape(p * m, -1)
                    rows[n * m + output * m : n * m + output * m + m] += u[:, span]
                rows[n_free : n_free + n] = starts[output]
                if self.levels:
                    rows[n_free + n : -1] = -self.gain.T @ answers[output, m]
                    rows[n_free + n + output] += 1.0
                rows[-1] = outputs[output] - self.c[output] @ own
                yield rows

    def _pushes(self, signals: Array) -> Array:
        """cᵀ s of each output and signal, (p, n_signals, n, n_samples)."""
        return self.c[:, None, :, None] * signals[None, :, None, :]

    @staticmethod
    def _run(transition: Array, pushes: Array, begun: Array) -> tuple[Array, Array]:
        """States under pushes (…, n, n_samples), and that after the last of them."""
        *_, n, n_samples = pushes.shape
        flat = pushes.reshape(-1, n, n_samples)
        states = run_recursion(transition, flat, begun.reshape(-1, n))
        last = states[:, :, -1] @ transition.T + flat[:, :, -1]
        if not np.all(np.isfinite(last)):
            raise DataError("a predictor runs away", needed="poles inside the unit circle")
        return states.reshape(pushes.shape), last.reshape(pushes.shape[:-1])
