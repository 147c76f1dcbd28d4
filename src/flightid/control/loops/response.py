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
        except (np.linalg.LinAlgError, SingularError):
            found = np.full(1, np.nan, dtype=np.complex128)
        if not np.all(np.isfinite(found)):
            raise DataError(
                "the connection has no finite response at these frequencies",
                found=f"{omega.min():g} to {omega.max():g} rad/s",
                needed="frequencies that are not poles of the blocks or of the closed loops",
            )
        return np.asarray(np.moveaxis(found, 0, -1))

    def _closed(self, places: list[int], omega: Array) -> Complex:
        """Rows driven from outside, by delays and by ports, shape (n_f, n_outputs, n_inputs)."""
        core, rows = self.core, self.core.rows
        given = [name for block in self.ports for name in block.outputs]
        inside = core.delayed_inside([*self.inputs, *given])
        reads = [name for block in self.ports for name in block.inputs]
        # What goes around: late signals, then outputs of ports; each may drive several rows.
        around = [*(rows[k].carrier for k in inside), *reads]
        watched = sorted({*places, *core.places(around)})
        by_row = self._driven(watched, omega)
        late = np.exp(-1j * omega[:, None] * [row.delay_s for row in rows])
        by_row = by_row * late[:, None, :]
        place = {signal: k for k, signal in enumerate(watched)}
        outside = np.zeros((len(rows), len(self.inputs)))
        looped = np.zeros((len(rows), len(inside) + len(given)))
        for k, row in enumerate(rows):
            if row.carrier in self.inputs:
                outside[k, self.inputs.index(row.carrier)] = 1.0
            elif row.carrier in given:
                looped[k, len(inside) + given.index(row.carrier)] = 1.0
            else:
                looped[k, inside.index(k)] = 1.0
        seen = [place[core.signals.index(name)] for name in around]
        direct, back = _gathered(by_row, outside), _gathered(by_row, looped)
        loop, given_from = back[:, seen], direct[:, seen]
        if self.ports:  # else all that goes around is late signals, one for one
            shares = self._port_responses(len(inside), len(given), len(reads), omega)
            loop, given_from = shares @ loop, shares @ given_from
        driven = np.linalg.solve(np.eye(loop.shape[1]) - loop, given_from)
        wanted = [place[each] for each in places]
        return np.asarray(direct[:, wanted] + back[:, wanted] @ driven)

    def _driven(self, watched: list[int], omega: Array) -> Complex:
        """Signals by row, delays left out, shape (n_f, n_watched, n_rows)."""
        core = self.core
        points = np.asarray(1j * omega, dtype=np.complex128)
        c, d = core.c[watched], core.d[watched]
        return np.moveaxis(_native.linear_response(core.a, core.b, c, d, points), -1, 0)

    def _port_responses(self, n_late: int, n_given: int, n_reads: int, omega: Array) -> Complex:
        """From what goes around to what it drives: ones for late signals, then the ports."""
        shares = np.zeros((len(omega), n_late + n_given, n_late + n_reads), dtype=np.complex128)
        shares[:, :n_late, :n_late] = np.eye(n_late)
        row, column = n_late, n_late
        for block in self.ports:
            p, m = len(block.outputs), len(block.inputs)
            found = np.moveaxis(_port_response(block, omega), -1, 0)
            shares[:, row : row + p, column : column + m] = found
            row, column = row + p, column + m
        return shares


def _gathered(by_row: Complex, chosen: Array) -> Complex:
    """Columns of rows that belong together added up; one alone is taken as it is."""
    places = [np.flatnonzero(column) for column in chosen.T]
    if all(len(each) == 1 for each in places):
        return by_row[:, :, np.concatenate(places)] if places else by_row[:, :, :0]
    return np.asarray(by_row @ chosen)


def _port_response(block: Block, omega: Array) -> Complex:
    """H of a hold or a sampled block, shape (n_outputs, n_inputs, n_f)."""
    part = block.part
    if isinstance(part, LinearSystem):
        return part.frequency_response(omega)
    assert isinstance(part, Hold)
    half = omega * part.sample_time_s / 2.0
    held = np.sinc(half / np.pi) * np.exp(-1j * (half + omega * part.delay_s))
    return np.asarray(held[None, None, :])
