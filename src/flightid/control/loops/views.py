"""Linear views of a connection: which blocks a core takes whole, and which stay outside it."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache

import numpy as np

from flightid.control.loops.block import Block
from flightid.control.loops.elements import static
from flightid.control.loops.linear_core import Core, Row, assemble
from flightid.control.loops.wiring import Wiring
from flightid.errors import ModelError, OptionError
from flightid.models.linear.linear_system import LinearSystem


def continuous_core(wiring: Wiring) -> Core:
    """All blocks seen as linear in continuous time, delays kept.

    Raises
    ------
    ModelError
        A sampled block.
    """
    for block in wiring.blocks:
        if block.sample_time_s is not None:
            raise ModelError(
                "a sampled block has no place in a continuous system",
                found=f"{block!r}: {block}",
                needed="continuous blocks",
                action="use sampled(), or frequency_response()",
            )
    return wiring.core


def continuous_system(
    wiring: Wiring, outputs: tuple[str, ...], pade_order: int | None
) -> LinearSystem:
    """One continuous linear system; delays at its inputs exact, those inside as states."""
    core = continuous_core(wiring)
    late = [row for row in core.rows if row.delay_s and row.carrier not in wiring.inputs]
    watched = core.places({*outputs, *(row.carrier for row in late)})
    for name in wiring.inputs:
        used = _used(core, name, watched)
        late += [row for row in used if row.delay_s and len(used) > 1]
    if late and pade_order is None:
        raise OptionError(
            "a delay inside the loops has no exact place in a linear system",
            found=", ".join(f"{row.delay_s:g} s after {row.carrier}" for row in late),
            needed="an order of Padé's approximation",
        )
    if late:
        core = _with_late_rows(core, late, wiring.inputs, pade_order or 1)
    return _by_inputs(core, wiring, outputs)


def _used(core: Core, name: str, watched: list[int]) -> list[Row]:
    """Rows of an input that move a state or a watched signal."""
    return [
        row
        for place, row in enumerate(core.rows)
        if row.carrier == name and (core.b[:, place].any() or core.d[watched, place].any())
    ]


def _with_late_rows(core: Core, late: list[Row], inputs: tuple[str, ...], order: int) -> Core:
    """The core with some delayed rows made by states."""
    rest = [row for row in core.rows if row not in late]
    names = {row: f"{row.carrier} late by {row.delay_s:g} s" for row in core.rows}
    whole = core.system(core.signals)
    inner = tuple(f"{name} (core)" for name in core.signals)
    fed = tuple(names[row] if row in late else _feed(row) for row in core.rows)
    blocks = [Block("core", fed, inner, replace(whole, delays_s=[0.0] * len(fed)))]
    for row in late:
        source = row.carrier if row.carrier in inputs else f"{row.carrier} (core)"
        blocks.append(Block("late", (source,), (names[row],), _late(row.delay_s, order)))
    carriers = list(dict.fromkeys([*inputs, *(_feed(row) for row in rest)]))
    joined = assemble(blocks, carriers)
    return _renamed(joined, core, rest)


@lru_cache(256)
def _late(delay_s: float, order: int) -> LinearSystem:
    """A delay by states: a law's are the same around every vehicle that the data allow."""
    made = static("late", ("u",), ("y",), np.eye(1), (delay_s,)).part
    assert isinstance(made, LinearSystem)
    return made.with_pade(order)


def _feed(row: Row) -> str:
    return f"{row.carrier}@{row.delay_s!r}" if row.delay_s else row.carrier


def _renamed(joined: Core, core: Core, rest: list[Row]) -> Core:
    back = {_feed(row): row for row in rest}
    rows = tuple(back.get(row.carrier, row) for row in joined.rows)
    places = joined.places(f"{name} (core)" for name in core.signals)
    states = tuple(name.removeprefix("core.") for name in joined.states)
    return Core(joined.a, joined.b, joined.c[places], joined.d[places], rows, core.signals, states)


def _by_inputs(core: Core, wiring: Wiring, outputs: tuple[str, ...]) -> LinearSystem:
    """Rows of one input joined to it; at most one of them does anything."""
    places = core.places(outputs)
    n_in = len(wiring.inputs)
    b, d, delays = np.zeros((len(core.a), n_in)), np.zeros((len(places), n_in)), np.zeros(n_in)
    for number, name in enumerate(wiring.inputs):
        mine = [k for k, row in enumerate(core.rows) if row.carrier == name]
        for k in mine:
            column = core.d[places, k]
            if core.b[:, k].any() or column.any():
                b[:, number] += core.b[:, k]
                d[:, number] += column
                delays[number] = core.rows[k].delay_s
    units = {n: wiring.units[n] for n in (*wiring.inputs, *outputs) if n in wiring.units}
    return LinearSystem(
        core.a, b, core.c[places], d, wiring.inputs, outputs, delays, core.states, None, units
    )
