"""The linear blocks of a connection as one system; what they cannot hold stays outside as rows.

x' = A x + B v,  signals = C x + D v: the rows v are signals from outside, outputs of blocks that
are no linear system of the same time, and delayed signals.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from flightid.control.loops.block import Block, Equations, Hold
from flightid.control.loops.elements import static
from flightid.errors import ModelError
from flightid.frozen import dataclass
from flightid.models.linear.linear_system import LinearSystem

Array = NDArray[np.float64]
SINGULAR = 1e-12
"""Reciprocal condition number below which an algebraic loop has no solution worth the name."""


class Row(NamedTuple):
    """One driven column of a core; a tuple, as one is looked for among hundreds.

    Attributes
    ----------
    carrier : str
        Signal whose value drives it.
    delay_s : float
        How much later it does, s.
    """

    carrier: str
    delay_s: float = 0.0


@dataclass(frozen=True, eq=False)
class Core:
    """Linear blocks joined, driven by rows.

    Attributes
    ----------
    a, b, c, d : ndarray
        Shapes (n, n), (n, n_rows), (n_signals, n), (n_signals, n_rows).
    rows : tuple of Row
    signals : tuple of str
        Carriers that are not computed here, then the outputs of the linear blocks.
    states : tuple of str
        ``"block.state"``.
    """

    a: Array
    b: Array
    c: Array
    d: Array
    rows: tuple[Row, ...]
    signals: tuple[str, ...]
    states: tuple[str, ...]

    def places(self, names: Iterable[str]) -> list[int]:
        """Rows of C and D by signal."""
        return [self.signals.index(name) for name in names]

    def delayed_inside(self, given: Sequence[str]) -> list[int]:
        """Rows whose carrier is not among some signals."""
        return [place for place, row in enumerate(self.rows) if row.carrier not in given]

    def system(self, outputs: Sequence[str], sample_time_s: float | None = None) -> LinearSystem:
        """The core by itself: one input a row, delays exact."""
        names = tuple(f"{row.carrier}@{row.delay_s:g}" for row in self.rows)
        places = self.places(outputs)
        return LinearSystem(
            self.a, self.b, self.c[places], self.d[places], names,
            tuple(f"y{k}" for k in range(len(places))),
            [row.delay_s for row in self.rows], self.states, sample_time_s,
        )  # fmt: skip


def linear_view(block: Block) -> Block:
    """A block as the linear system that it is near its trim; a hold as its delay."""
    part = block.part
    if isinstance(part, LinearSystem):
        return block
    if isinstance(part, Equations):
        return replace(block, part=part.linear)
    late = (part.sample_time_s / 2.0 + part.delay_s,) if isinstance(part, Hold) else ()
    found = static(block.name, block.inputs, block.outputs, np.eye(1), late)
    return replace(found, units=block.units)


def assemble(
    blocks: Sequence[Block], carriers: Sequence[str], late_s: Mapping[str, float] | None = None
) -> Core:
    """Join linear blocks of one time.

    Parameters
    ----------
    blocks : sequence of Block
        All with a `LinearSystem`.
    carriers : sequence of str
        Signals that come from elsewhere.
    late_s : mapping of str to float, optional
        By how much a signal lags behind its carrier, s: a held one by the computation delay.

    Raises
    ------
    ModelError
        An algebraic loop without a solution.
    """
    late = dict(late_s or {})
    rows: dict[Row, int] = {}
    for name in carriers:
        rows.setdefault(Row(name, late.get(name, 0.0)), len(rows))
    parts = [_part(block).state_space() for block in blocks]
    given = [name for block in blocks for name in block.outputs]
    place = {name: number for number, name in enumerate(given)}
    n_inputs = sum(len(block.inputs) for block in blocks)
    loops = np.zeros((n_inputs, len(given)))
    picked: list[tuple[int, int]] = []
    position = 0
    for block, (*_, delays) in zip(blocks, parts, strict=True):
        for name, delay in zip(block.inputs, delays, strict=True):
            if name in place and delay == 0.0:
                loops[position, place[name]] = 1.0
            else:
                row = Row(name, float(delay) + late.get(name, 0.0))
                picked.append((position, rows.setdefault(row, len(rows))))
            position += 1
    driven = np.zeros((n_inputs, len(rows)))
    for where, row_place in picked:
        driven[where, row_place] = 1.0
    a, b, c, d = (_diagonal([part[k] for part in parts]) for k in range(4))
    inverse = _inverse(np.eye(len(given)) - d @ loops, given)
    seen, direct = inverse @ c, inverse @ d @ driven
    own = np.zeros((len(carriers), len(rows)))
    for number, name in enumerate(carriers):
        own[number, rows[Row(name, late.get(name, 0.0))]] = 1.0
    states = tuple(f"{block.name}.{state}" for block in blocks for state in _part(block).states)
    return _with_direct_parts(
        Core(
            a + b @ loops @ seen,
            b @ (loops @ direct + driven),
            np.vstack([np.zeros((len(carriers), len(a))), seen]),
            np.vstack([own, direct]),
            tuple(rows),
            (*carriers, *given),
            states,
        ),
        carriers,
    )


def _part(block: Block) -> LinearSystem:
    if not isinstance(block.part, LinearSystem):
        raise ModelError("this block is no linear system", found=f"{block!r}: {block}")
    return block.part


def _diagonal(parts: Sequence[Array]) -> Array:
    # SciPy's block_diag costs more than all else that an interconnection computes.
    found = np.zeros((sum(len(part) for part in parts), sum(part.shape[1] for part in parts)))
    row = column = 0
    for part in parts:
        height, width = part.shape
        found[row : row + height, column : column + width] = part
        row, column = row + height, column + width
    return found


def _inverse(matrix: Array, names: Sequence[str]) -> Array:
    if not len(matrix):
        return matrix
    try:
        inverse = np.asarray(np.linalg.inv(matrix))
    except np.linalg.LinAlgError:
        inverse = np.full_like(matrix, np.inf)
    # Norms by all entries bound those by singular values, which take longer.
    if SINGULAR * max(1.0, float(np.linalg.norm(matrix))) * float(np.linalg.norm(inverse)) <= 1.0:
        return inverse
    _, sizes, directions = np.linalg.svd(matrix)
    if sizes[-1] < SINGULAR * max(1.0, sizes[0]):
        share = np.abs(directions[-1])
        loop = [name for name, size in zip(names, share, strict=True) if size > 0.1 * share.max()]
        raise ModelError(
            "an algebraic loop has no solution",
            found=f"gain of one around {', '.join(loop)}",
            needed="a loop gain other than one, or dynamics or a delay in the loop",
        )
    return inverse


def _with_direct_parts(core: Core, carriers: Sequence[str]) -> Core:
    """Delayed signals split: what carriers do to them at once comes from delayed carriers.

    A step from outside then stays a step after the delay, and a gain may as well come later.
    """
    for number, row in enumerate(core.rows):
        if row.carrier in carriers:
            continue
        place = core.signals.index(row.carrier)
        own = [int(k) for k in np.flatnonzero(core.d[place]) if core.rows[k].carrier in carriers]
        still = not core.c[place].any() and not core.d[place].any()
        if own or still:
            return _with_direct_parts(_split(core, number, place, own), carriers)
    return core


def _split(core: Core, number: int, place: int, own: Sequence[int]) -> Core:
    row = core.rows[number]
    rest_d = core.d[place].copy()
    rest_d[own] = 0.0
    moving = f"{row.carrier} (moving part)"
    rows, signals = [*core.rows], [*core.signals]
    b, d, c = core.b, core.d, core.c
    parts = [(Row(core.rows[k].carrier, core.rows[k].delay_s + row.delay_s), core.d[place, k])
             for k in own]  # fmt: skip
    if core.c[place].any() or rest_d.any():
        if moving not in signals:
            signals.append(moving)
            c, d = np.vstack([c, c[place]]), np.vstack([d, rest_d])
        parts.append((Row(moving, row.delay_s), 1.0))
    for wanted, share in parts:
        if wanted not in rows:
            rows.append(wanted)
            b, d = (np.column_stack([each, np.zeros(len(each))]) for each in (b, d))
        b, d = b.copy(), d.copy()
        b[:, rows.index(wanted)] += share * b[:, number]
        d[:, rows.index(wanted)] += share * d[:, number]
    keep = [k for k in range(len(rows)) if k != number]
    kept = tuple(rows[k] for k in keep)
    return replace(core, b=b[:, keep], c=c, d=d[:, keep], rows=kept, signals=tuple(signals))
