"""A connection in which one block does something else: wired once for all vehicles of a fit."""

from __future__ import annotations

from copy import copy
from typing import TypeVar

from flightid.control.loops.block import Block, Equations, Part
from flightid.control.loops.interconnection import Interconnection
from flightid.errors import ModelError
from flightid.models.linear.linear_system import LinearSystem

Thing = TypeVar("Thing")
LEARNED = ("core", "_responding", "_linear_systems", "_stability")
"""What connections and wires work out once for some blocks."""


def with_part(loops: Interconnection, place: int, part: Part) -> Interconnection:
    """Copy of a connection in which one block does something else between the same signals.

    Parameters
    ----------
    loops : Interconnection
    place : int
        Of the block, among its blocks.
    part : LinearSystem, OutputLimits, RateLimit, Hold or Equations
        Of the kind of the block's own: the wires were checked for that one.

    Raises
    ------
    ModelError
        A part of another kind, of other channels or of another sample time.

    Example
    -------
    >>> import flightid as fid
    >>> loop = fid.connect([fid.loops.gain("e", "y", 3.0), fid.loops.sum_of("e", "r", "-y")],
    ...                    inputs=["r"], outputs=["y"])
    >>> other = with_part(loop, 0, fid.loops.gain("e", "y", 9.0).part)
    >>> round(other.frequency_response([1.0]).real.item(), 9)
    0.9
    """
    old = loops.blocks[place]
    block = _changed(old, part=part)
    if _kind(block) != _kind(old):
        raise ModelError(
            f"{old!r} takes no other kind of part",
            found=str(block),
            needed=f"what has the same inputs, outputs and time as: {old}",
        )
    blocks = (*loops.blocks[:place], block, *loops.blocks[place + 1 :])
    return _changed(loops, blocks=blocks, wiring=_changed(loops.wiring, blocks=blocks))


def _changed(thing: Thing, **fields: object) -> Thing:
    """Copy with other fields, of which nothing is checked and nothing is worked out yet."""
    made = copy(thing)
    for name in LEARNED:
        vars(made).pop(name, None)
    for name, value in fields.items():
        object.__setattr__(made, name, value)
    return made


def _kind(block: Block) -> tuple[object, ...]:
    """What wires know of a part."""
    linear = block.part.linear if isinstance(block.part, Equations) else block.part
    ends = (linear.inputs, linear.outputs) if isinstance(linear, LinearSystem) else ()
    return type(block.part), ends, block.sample_time_s, block.is_static
