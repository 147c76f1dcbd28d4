"""Frequency responses of connected blocks, each block's own response taken exactly."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from flightid import _native
from flightid.control.loops.block import Block, Hold
from flightid.control.loops.linear_core import Core, assemble, linear_view
from flightid.control.loops.wiring import Wiring
from flightid.errors import DataError, SingularError
from flightid.frozen import dataclass
from flightid.models.linear.linear_system import LinearSystem

Complex = NDArray[np.complex128]
Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class ConnectionBlocks:
    """What the response of a connection is computed from.

    Attributes
    ----------
    core : Core
        All continuous blocks.
    ports : tuple of Block
        Holds and sampled blocks.
    inputs : tuple of str
        Signals from outside.
    """

    core: Core
    ports: tuple[Block, ...]
    inputs: tuple[str, ...]

    @classmethod
    def of(cls, wiring: Wiring) -> ConnectionBlocks:
        """Sort the blocks of a connection."""
        ports = tuple(b for b in wiring.blocks if isinstance(b.part, Hold) or b.sample_time_s)
        inside = [linear_view(block) for block in wiring.blocks if block not in ports]
        given = [name for block in ports for name in block.outputs]
        return cls(assemble(inside, [*wiring.inputs, *given]), ports, wiring.inputs)

    def at(self, outputs: Sequence[str], omega_rad_s: ArrayLike) -> Complex:
        """H from the inputs from outside to some signals, with all loops closed.

        Parameters
        ----------
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
        try:
            found = self._closed(self.core.places(outputs), omega)
        except SingularError:
            found = np.full(1, np.nan, dtype=np.complex128)
        if not np.all(np.isfinite(found)):
            raise DataError(
                "the connection has no finite response at these frequencies",
                found=f"{omega.min():g} to {omega.max():g} rad/s",
                needed="frequencies that are not poles of the blocks or of the closed loops",
            )
        return found

    def _closed(self, places: list[int], omega: Array) -> Complex:
        """Rows driven from outside, by delays and by ports, shape (n_outputs, n_inputs, n_f)."""
        core, rows = self.core, self.core.rows
        given = [name for block in self.ports for name in block.outputs]
        inside = core.delayed_inside([*self.inputs, *given])
        reads = [name for block in self.ports for name in block.inputs]
        # What goes around: late signals, then outputs of ports; each may drive several rows.
        around = core.places([*(rows[k].carrier for k in inside), *reads])
        watched = sorted({*places, *around})
        place = {signal: k for k, signal in enumerate(watched)}
        drives = {name: k for k, name in enumerate(self.inputs)}
        late = {row: len(drives) + k for k, row in enumerate(inside)}
        last = len(drives) + len(late)
        drives |= {name: last + k for k, name in enumerate(given)}
        return _native.closed_responses(
            (core.a, core.b, core.c[watched], core.d[watched]),
            np.array([row.delay_s for row in rows]),
            [late[k] if k in late else drives[row.carrier] for k, row in enumerate(rows)],
            len(self.inputs),
            [place[each] for each in around],
            self._port_responses(len(given), len(reads), omega),
            [place[each] for each in places],
            np.asarray(1j * omega, dtype=np.complex128),
        )

    def _port_responses(self, n_given: int, n_reads: int, omega: Array) -> Complex:
        """From what ports read to what they give, shape (n_given, n_reads, n_f)."""
        shares = np.zeros((n_given, n_reads, len(omega)), dtype=np.complex128)
        row, column = 0, 0
        for block in self.ports:
            p, m = len(block.outputs), len(block.inputs)
            shares[row : row + p, column : column + m] = _port_response(block, omega)
            row, column = row + p, column + m
        return shares


def _port_response(block: Block, omega: Array) -> Complex:
    """H of a hold or a sampled block, shape (n_outputs, n_inputs, n_f)."""
    part = block.part
    if isinstance(part, LinearSystem):
        return part.frequency_response(omega)
    assert isinstance(part, Hold)
    half = omega * part.sample_time_s / 2.0
    held = np.sinc(half / np.pi) * np.exp(-1j * (half + omega * part.delay_s))
    return np.asarray(held[None, None, :])
