"""A linear model behind held, delayed inputs, at the samples: every method's discretisation.

Between its samples an input stands still, runs straight or is smooth; a model's delay moves it by
any part of a sample. Native (`discretisation.rs`) integrates each piece exactly and gives the
weights of the neighbouring samples on one step, with derivatives by parameters and delays.
"""

from __future__ import annotations

from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from flightid import _native
from flightid.frozen import dataclass
from flightid.models import StateSpaceModel

Array = NDArray[np.float64]
T = TypeVar("T", np.float64, np.complex128)


@dataclass(frozen=True)
class LinearPoint:
    """ẋ = A x + B u(t − τ), y = C x + D u(t − τ) at a model's trim, and its derivatives.

    Attributes
    ----------
    a, b, c, d : ndarray, shape (1 + n_free, rows, columns)
        First the matrix, then its derivatives by the free parameters.
    delays_s : ndarray, shape (1 + n_free, n_inputs)

    Example
    -------
    >>> import flightid as fid
    >>> model = fid.StateSpaceModel(states={"p": "rad/s"}, input_units={"u": "rad/s^2"},
    ...     measurements={"p": fid.Output("p", "rad/s")}, equations={"p'": "Lp*p + u"},
    ...     parameters=fid.Parameters([fid.Parameter("Lp", -2.0, "1/s")]))
    >>> LinearPoint.of(model, model.parameters.independent_values()).a.ravel().tolist()
    [-2.0, 1.0]
    """

    a: Array
    b: Array
    c: Array
    d: Array
    delays_s: Array

    @classmethod
    def of(cls, model: StateSpaceModel, values: Array) -> LinearPoint:
        """Of a model at the values of its independent parameters."""
        free = model.parameters.free_indices
        trim = np.array([model.trim.get(name, 0.0) for name in model.point_names])
        n, m = len(model.states), len(model.inputs)
        rows = model.native.linearise(values, trim)[1]
        moved = model.native.sensitivities(values, trim, free)
        rates = np.linalg.solve(-rows[:n, :n], rows[:n, n:])
        whole = np.vstack([rates, np.eye(n + m)])
        d_rates = np.linalg.solve(-rows[:n, :n], moved[:, :n] @ whole)
        d_seen = moved[:, n:] @ whole + rows[n:, :n] @ d_rates
        both = np.concatenate([rates[None], d_rates])
        seen = np.concatenate([(rows[n:] @ whole)[None], d_seen])
        tape = model.parameters.tape(model.delays.values())
        late = np.asarray(tape.jacobian(values, free)).reshape(m, len(free))
        delays = np.vstack([np.asarray(tape.evaluate(values))[None], late.T])
        parts = (both[:, :, :n], both[:, :, n:], seen[:, :, :n], seen[:, :, n:])
        a, b, c, d = map(np.ascontiguousarray, parts)
        return cls(a, b, c, d, np.ascontiguousarray(delays))


@dataclass(frozen=True)
class HeldModel:
    """x⁺ = Φ x + q and y = C x + v, where q and v are sums of neighbouring samples of the inputs.

    Attributes
    ----------
    transition : ndarray, shape (1 + n_free, n, n)
        Φ, then its derivatives; so with all that follows.
    output : ndarray, shape (1 + n_free, p, n)
    places : tuple of (int, int)
        Input, and samples ahead of the step's first, of each weight.
    weights : ndarray, shape (1 + n_free, n_places, n + p)
        On the state at the next sample, then on the outputs at this one.
    """

    transition: Array
    output: Array
    places: tuple[tuple[int, int], ...]
    weights: Array

    @classmethod
    def of(cls, point: LinearPoint, sample_time_s: float, hold: str) -> HeldModel:
        """Discretise, exactly for ``"zero"`` and ``"first"``.

        Raises
        ------
        OptionError
            A negative delay.

        Reference
        ---------
        Franklin, Powell & Workman, *Digital Control of Dynamic Systems*, 3rd ed., §4.3.3, §6.3.
        """
        matrices = (point.a, point.b, point.c, point.d, point.delays_s)
        phi, places, weights = _native.discretise_directions(matrices, sample_time_s, hold)
        return cls(phi, point.c, tuple(places), weights)

    def driven(self, inputs: Array) -> tuple[Array, Array]:
        """What the inputs add to each next state and to each output.

        Before the first sample an input had that sample's value; after the last it keeps it.

        Parameters
        ----------
        inputs : ndarray, shape (n_inputs, n_samples)

        Returns
        -------
        tuple of ndarray, shapes (1 + n_free, n, n_samples) and (1 + n_free, p, n_samples)
        """
        return self.weighed(self.taps(inputs))

    def taps(self, inputs: Array) -> Array:
        """The samples behind each weight, shape (n_places, n_samples)."""
        count = inputs.shape[1]
        at = np.arange(count)
        found = [inputs[row, np.clip(at + ahead, 0, count - 1)] for row, ahead in self.places]
        return np.array(found).reshape(len(found), count)

    def weighed(self, taps: NDArray[T]) -> tuple[NDArray[T], NDArray[T]]:
        """What such samples, or their transforms, add to each next state and to each output."""
        n = self.transition.shape[1]
        found = self.weights.swapaxes(1, 2) @ taps
        return found[:, :n], found[:, n:]

    def steady(self) -> tuple[Array, Array]:
        """The same of a constant 1 in each input: (1 + n_free, n, m) and (1 + n_free, p, m)."""
        n = self.transition.shape[1]
        rows = [row for row, _ in self.places]
        total = np.zeros((len(self.weights), self.weights.shape[2], max(rows, default=-1) + 1))
        for place, row in enumerate(rows):
            total[:, :, row] += self.weights[:, place]
        return total[:, :n], total[:, n:]
