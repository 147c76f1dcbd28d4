"""A controller as blocks that stand beside a vehicle, whatever way it was given."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

from flightid.control.loops.block import Block
from flightid.control.loops.connect import blocks_of
from flightid.control.loops.elements import gain
from flightid.errors import UnknownNameError


def controller_blocks(controller: object, units: Mapping[str, str]) -> list[Block]:
    """Blocks of a controller.

    Parameters
    ----------
    controller : mapping, Block, sequence of blocks, model, LinearSystem or Interconnection
        A mapping of gains by input and output is negative feedback.
    units : mapping of str to str
        Unit by channel of the vehicle.

    Returns
    -------
    list of Block
    """
    if isinstance(controller, Mapping):
        return [_gains(name, row, units) for name, row in controller.items()]
    parts = controller if isinstance(controller, Sequence) else [controller]
    return [block for place, each in enumerate(parts) for block in blocks_of(each, place)]


def _gains(name: str, row: Mapping[str, float], units: Mapping[str, str]) -> Block:
    known = {each: units[each] for each in (name, *row) if each in units}
    return gain(tuple(row), name, [[-float(value) for value in row.values()]], units=known)


def require_channels(
    gains: Mapping[str, Mapping[str, float]],
    inputs: Sequence[str],
    outputs: Sequence[str],
    outside: Sequence[str],
) -> None:
    """Refuse gains of what is no channel: a misspelt name would be a set-point that stays at zero.

    Raises
    ------
    UnknownNameError
        A name that is neither a channel of the vehicle nor declared.
    """
    for name, row in gains.items():
        if name not in inputs:
            raise UnknownNameError(
                "a gain moves no input of the vehicle",
                found=repr(name),
                needed=", ".join(inputs),
            )
        for read in row:
            if read not in (*outputs, *inputs, *outside):
                raise UnknownNameError(
                    f"a gain of {name!r} reads no channel of the vehicle",
                    found=repr(read),
                    needed=", ".join((*outputs, *inputs)),
                    action=f"correct the name; a set-point is declared: outside = [{read!r}]",
                )


def moved_by(blocks: Sequence[Block], inputs: Sequence[str], outputs: Sequence[str]) -> list[str]:
    """Inputs of the vehicle that a controller moves.

    Raises
    ------
    UnknownNameError
        It moves none, or reads nothing of the vehicle.
    """
    given = [name for block in blocks for name in block.outputs]
    read = {name for block in blocks for name in block.inputs}
    moved = [name for name in inputs if name in given]
    for what, found, known, fits in (
        ("the controller moves no input of the vehicle", given, inputs, bool(moved)),
        ("the controller reads nothing of the vehicle", sorted(read), outputs,
         bool(read & {*inputs, *outputs})),
    ):  # fmt: skip
        if not fits:
            raise UnknownNameError(
                what, found=", ".join(found) or "nothing", needed=f"one of {', '.join(known)}"
            )
    return moved


def beside(blocks: Sequence[Block], moved: Sequence[str]) -> list[Block]:
    """The blocks with what moves input ``x`` given as ``x_controller``; what they read stays."""
    return [_giving(block, {name: f"{name}_controller" for name in moved}) for block in blocks]


def _giving(block: Block, names: Mapping[str, str]) -> Block:
    units = {n: u for n, u in block.units.items() if n in block.inputs or n not in names}
    units |= {names[n]: block.units[n] for n in block.outputs if n in names and n in block.units}
    outputs = tuple(names.get(each, each) for each in block.outputs)
    return replace(block, outputs=outputs, units=units)
