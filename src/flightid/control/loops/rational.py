"""Transfer functions by their coefficients as blocks."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from flightid.control.loops.block import Block
from flightid.errors import ModelError
from flightid.models.linear.linear_system import LinearSystem

Array = NDArray[np.float64]
Units = Mapping[str, str] | None


def transfer(
    inputs: str,
    outputs: str,
    numerator: ArrayLike,
    denominator: ArrayLike,
    *,
    delay_s: float = 0.0,
    sample_time_s: float | None = None,
    units: Units = None,
) -> Block:
    """Transfer function by its coefficients, in s, or in z where it has a sample time.

    Parameters
    ----------
    inputs, outputs : str
        Signals.
    numerator, denominator : array_like, shapes (n,), (m,)
        Coefficients, highest power first.
    delay_s : float
        Delay, s; whole samples where there is a sample time.
    sample_time_s : float, optional
        T, s; continuous when left out.
    units : mapping of str to str, optional
        Unit by signal.

    Raises
    ------
    ModelError
        More zeros than poles, or a denominator that is zero.

    Reference
    ---------
    Kailath, *Linear Systems* (1980), section 2.1: observer canonical form.

    Example
    -------
    >>> transfer("tau", "p", [40.0], [0.2, 1.0], delay_s=0.01).part.poles()
    array([-5.+0.j])
    """
    above = [np.atleast_1d(np.asarray(numerator, dtype=np.float64))]
    below = np.atleast_1d(np.asarray(denominator, dtype=np.float64))
    system = observer_form((inputs,), outputs, above, below, delay_s, sample_time_s)
    return Block("transfer function", (inputs,), (outputs,), system, units or {})


def observer_form(
    inputs: tuple[str, ...],
    output: str,
    above: Sequence[Array],
    below: Array,
    delay_s: float = 0.0,
    sample_time_s: float | None = None,
) -> LinearSystem:
    """One output of several inputs that share a denominator, with as many states as its degree.

    Raises
    ------
    ModelError
        More zeros than poles, or a denominator that is zero.
    """
    monic = np.trim_zeros(below, "f")
    if not len(monic):
        raise ModelError("a denominator is zero", needed="a coefficient that is not zero")
    order = len(monic) - 1
    direct, forced = np.zeros((1, len(inputs))), np.zeros((order, len(inputs)))
    for column, given in enumerate(above):
        trimmed = np.trim_zeros(given, "f")
        if len(trimmed) > order + 1:
            raise ModelError(
                "a transfer function has more zeros than poles",
                found=f"degree {len(trimmed) - 1} over {order}",
                needed="at least as many poles as zeros",
                action="add the lag of the sensor or filter to the denominator",
            )
        whole = np.concatenate([np.zeros(order + 1 - len(trimmed)), trimmed]) / monic[0]
        direct[0, column] = whole[0]
        forced[:, column] = whole[1:] - whole[0] * monic[1:] / monic[0]
    a = np.zeros((order, order))
    if order:
        a[:, 0] = -monic[1:] / monic[0]
        a[:-1, 1:] = np.eye(order - 1)
    c = np.eye(1, order) if order else np.zeros((1, 0))
    late = [delay_s] * len(inputs)
    return LinearSystem(a, forced, c, direct, inputs, (output,), late, sample_time_s=sample_time_s)
