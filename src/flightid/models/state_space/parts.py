"""Small parts of a state-space model: outputs, pairs and its matrices as numbers."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from flightid.errors import ModelError
from flightid.frozen import dataclass
from flightid.units import canonical

Array = NDArray[np.float64]


def derivative(state: str) -> str:
    """Name of the derivative of a state."""
    return f"{state}'"


@dataclass(frozen=True)
class Output:
    """What is measured: a formula of states, inputs, state derivatives and parameters.

    Attributes
    ----------
    expression : str
        Formula.
    unit : str
        Unit of its value.

    Example
    -------
    >>> Output("v' - g*phi", "ft/s**2").unit
    'ft/s^2'
    """

    expression: str
    unit: str = "1"

    def __post_init__(self) -> None:
        object.__setattr__(self, "unit", canonical(self.unit))


@dataclass(frozen=True)
class ResponsePair:
    """A pair of channels whose response is fitted.

    Example
    -------
    >>> print(ResponsePair("p", "lat"))
    p/lat
    """

    output: str
    input: str

    @property
    def name(self) -> str:
        """``"output/input"``."""
        return f"{self.output}/{self.input}"

    def __str__(self) -> str:
        """Same as `name`."""
        return self.name


class StateSpaceMatrices(NamedTuple):
    """M ẋ = F x + G u(t − τ), y = H₁ ẋ + H₀ x + D u(t − τ), in the units of the channels.

    Example
    -------
    >>> matrices = StateSpaceMatrices.split(
    ...     np.array([[1.0, 2.0, -3.0], [0.0, 1.0, 0.0]]), np.array([0.0, 0.0, 0.1]), 1, 1)
    >>> matrices.f, matrices.g, matrices.delays_s
    (array([[-2.]]), array([[3.]]), array([0.1]))
    """

    m: Array
    f: Array
    g: Array
    h0: Array
    h1: Array
    d: Array
    delays_s: Array

    @classmethod
    def split(cls, slopes: Array, values: Array, n: int, p: int) -> StateSpaceMatrices:
        """From derivatives of residuals and outputs by ẋ, x, u, and the values with delays last.

        Parameters
        ----------
        slopes : ndarray, shape (n + p, 2 n + n_inputs)
            Residuals are left minus right side.
        values : ndarray
            The delays are its last n_inputs entries.
        n, p : int
            Numbers of states and outputs.
        """
        m_inputs = slopes.shape[1] - 2 * n
        late = values[len(values) - m_inputs :]
        rows, measured = slopes[:n], slopes[n : n + p]
        return cls(
            rows[:, :n].copy(),
            0.0 - rows[:, n : 2 * n],
            0.0 - rows[:, 2 * n :],
            measured[:, n : 2 * n].copy(),
            measured[:, :n].copy(),
            measured[:, 2 * n :].copy(),
            late.copy(),
        )


def pair_places(
    pairs: Sequence[str], outputs: Sequence[str], inputs: Sequence[str]
) -> list[tuple[int, int]]:
    """Places of output and input of each pair ``"output/input"``.

    Raises
    ------
    ModelError
        A pair that does not exist, or is given twice.
    """
    places = []
    for pair in pairs:
        output, _, source = pair.partition("/")
        if output not in outputs or source not in inputs:
            raise ModelError(
                "name of a response is not 'output/input'",
                found=repr(pair),
                needed=f"one of {', '.join(outputs)} over one of {', '.join(inputs)}",
            )
        places.append((outputs.index(output), inputs.index(source)))
    if len(set(places)) < len(places):
        raise ModelError("a response is given twice", found=", ".join(pairs))
    return places
