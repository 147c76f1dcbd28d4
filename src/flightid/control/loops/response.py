"""Frequency responses of connected blocks, each block's own response taken exactly."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from flightid.control.loops.block import Block, Equations, Hold
from flightid.control.loops.wiring import Wiring
from flightid.errors import DataError
from flightid.models.linear_system import LinearSystem

Complex = NDArray[np.complex128]


def block_response(block: Block, omega_rad_s: NDArray[np.float64]) -> Complex:
    """H of one block, shape (n_outputs, n_inputs, n_f); what is not linear as a gain of one."""
    part = block.part
    if isinstance(part, LinearSystem):
        return part.frequency_response(omega_rad_s)
    if isinstance(part, Equations):
        return part.linear.frequency_response(omega_rad_s)
    if isinstance(part, Hold):
        half = omega_rad_s * part.sample_time_s / 2.0
        held = np.sinc(half / np.pi) * np.exp(-1j * (half + omega_rad_s * part.delay_s))
        return np.asarray(held[None, None, :])
    return np.ones((1, 1, len(omega_rad_s)), dtype=np.complex128)


def connected_response(wiring: Wiring, outputs: Sequence[str], omega_rad_s: ArrayLike) -> Complex:
    """H from the inputs from outside to some signals, with all loops closed.

    Parameters
    ----------
    wiring : Wiring
    outputs : sequence of str
        Signals.
    omega_rad_s : array_like, shape (n_f,)
        rad/s.

    Returns
    -------
    ndarray of complex, shape (n_outputs, n_inputs, n_f)

    Raises
    ------
    DataError
        A frequency where a block has a pole, or the closed loops have one.
    """
    omega = np.atleast_1d(np.asarray(omega_rad_s, dtype=np.float64))
    given = list(wiring.sources)
    row = {name: place for place, name in enumerate(given)}
    column = {name: place for place, name in enumerate(wiring.inputs)}
    around = np.zeros((len(omega), len(given), len(given)), dtype=np.complex128)
    driven = np.zeros((len(omega), len(given), len(column)), dtype=np.complex128)
    for block in wiring.blocks:
        rows = [row[name] for name in block.outputs]
        own = np.moveaxis(block_response(block, omega), -1, 0)
        for number, name in enumerate(block.inputs):
            if name in row:
                around[:, rows, row[name]] += own[:, :, number]
            else:
                driven[:, rows, column[name]] += own[:, :, number]
    try:
        solved = np.linalg.solve(np.eye(len(given)) - around, driven)
    except np.linalg.LinAlgError as error:
        raise DataError(
            "the connection has no finite response at these frequencies",
            found=f"{omega.min():g} to {omega.max():g} rad/s",
            needed="frequencies that are not poles of the closed loops",
        ) from error
    found_rows = []
    for name in outputs:
        if name in row:
            found_rows.append(solved[:, row[name]].T)
        else:
            unit = np.zeros((len(column), len(omega)), dtype=np.complex128)
            unit[column[name]] = 1.0
            found_rows.append(unit)
    return np.asarray(found_rows).reshape(len(outputs), len(column), len(omega))
