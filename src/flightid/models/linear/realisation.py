"""State-space realisation of transfer functions given as numbers."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from flightid.errors import ModelError

Array = NDArray[np.float64]
Matrices = tuple[Array, Array, Array, Array, Array]
Entry = tuple[int, int, float, list[Array], list[Array]]
"""Row, column, gain, numerator factors, denominator factors (highest power first)."""
Block = tuple[Array, Array, float]
"""A, C and D of one transfer function."""

_SAME_DELAY_S = 1e-12


def canonical_form(shape: tuple[int, int], entries: Sequence[Entry]) -> tuple[Array, ...]:
    """A, B, C, D of a matrix of transfer functions, each with its own states.

    Parameters
    ----------
    shape : tuple of int
        Numbers of outputs and inputs.
    entries : sequence of tuple
        Row, column, gain, numerator factors and denominator factors.

    Returns
    -------
    tuple of ndarray
        A (n, n), B (n, n_inputs), C (n_outputs, n), D (n_outputs, n_inputs).

    Raises
    ------
    ModelError
        More zeros than poles, or a denominator that is zero.

    Reference
    ---------
    Kailath, *Linear Systems* (1980), §2.1: controller canonical form.
    """
    return side_by_side(shape, [(*entry[:2], block_of(*entry[2:])) for entry in entries])


def side_by_side(
    shape: tuple[int, int], placed: Sequence[tuple[int, int, Block]]
) -> tuple[Array, ...]:
    """A, B, C, D of transfer functions by row, column and their own realisation."""
    n = sum(len(block[0]) for *_, block in placed)
    a, d = np.zeros((n, n)), np.zeros(shape)
    b, c = np.zeros((n, shape[1])), np.zeros((shape[0], n))
    start = 0
    for row, column, (block_a, block_c, feed) in placed:
        stop = start + len(block_a)
        a[start:stop, start:stop] = block_a
        if stop > start:
            b[start, column] = 1.0
        c[row, start:stop] = block_c
        d[row, column] += feed
        start = stop
    return a, b, c, d


def _product(factors: list[Array]) -> Array:
    """Product of polynomials without leading zeros: most are one factor of many draws."""
    result: Array = np.ones(1)
    for place, factor in enumerate(factors):
        result = np.convolve(result, factor) if place else np.asarray(factor, dtype=np.float64)
    if len(result) and result[0] != 0.0:
        return result
    return np.trim_zeros(result, "f")


def block_of(gain: float, numerator: list[Array], denominator: list[Array]) -> Block:
    """A, C and D of one transfer function, whose input moves the first state.

    Raises
    ------
    ModelError
        More zeros than poles, or a denominator that is zero.
    """
    above, below = gain * _product(numerator), _product(denominator)
    if len(below) == 0:
        raise ModelError("a denominator is zero", needed="a factor that is not zero")
    if len(above) > len(below):
        raise ModelError(
            "a response has more zeros than poles and cannot be simulated",
            found=f"degree {len(above) - 1} over {len(below) - 1}",
            needed="at least as many poles as zeros",
            action="add the lag of sensor or filter to the denominator",
        )
    order = len(below) - 1
    above = np.concatenate([np.zeros(order + 1 - len(above)), above]) / below[0]
    below = below / below[0]
    a = np.zeros((order, order))
    if order:
        a[0] = -below[1:]
        a[1:, :-1] = np.eye(order - 1)
    return a, above[1:] - above[0] * below[1:], float(above[0])


def one_delay_for_each_input(
    columns: Sequence[int], delays_s: Sequence[float], inputs: Sequence[str]
) -> Array:
    """Delay of each input, s, where its responses agree on it.

    Raises
    ------
    ModelError
        A negative delay, or responses of one input with different delays.
    """
    result = np.full(len(inputs), np.nan)
    for column, delay in zip(columns, delays_s, strict=True):
        if delay < 0.0:
            raise ModelError(
                "a negative delay cannot be simulated",
                found=f"{delay:g} s for input {inputs[column]}",
                needed="a delay of at least 0 s",
                action="bound the delay below by zero, or check the stamps of input and output",
            )
        known = result[column]
        if not np.isnan(known) and abs(known - delay) > _SAME_DELAY_S:
            raise ModelError(
                f"responses to input {inputs[column]} have different delays",
                found=f"{known:g} s and {delay:g} s",
                needed="one delay for each input",
                action="share the delay's parameter between the responses of this input",
            )
        result[column] = delay
    return result
