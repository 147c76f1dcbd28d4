"""A connection at its samples, exactly: held signals drive the continuous blocks between them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from flightid.control.loops.block import Block, Hold
from flightid.control.loops.elements import static
from flightid.control.loops.linear_core import Core, assemble, linear_view
from flightid.control.loops.wiring import Wiring
from flightid.errors import ModelError, OptionError
from flightid.models.linear.linear_system import LinearSystem

SAME = 1e-9


def sampled_system(wiring: Wiring, outputs: tuple[str, ...], sample_time_s: float) -> LinearSystem:
    """The recursion of a connection's signals at multiples of T.

    Inputs from outside are held over each sample. Signals are those just after a sample is taken.

    Raises
    ------
    ModelError
        A delay acts on a signal that moves between the samples, so that no finite recursion is
        exact.
    OptionError
        A block has another sample time.
    """
    _require_rate(wiring, sample_time_s)
    inside = [block for block in wiring.blocks if _is_continuous(block, wiring)]
    holds = [block for block in wiring.blocks if isinstance(block.part, Hold)]
    digital = [
        block for block in wiring.blocks if block not in inside and not isinstance(block.part, Hold)
    ]
    held = [block.outputs[0] for block in holds]
    late = {block.outputs[0]: _hold(block).delay_s for block in holds}
    core = assemble([linear_view(block) for block in inside], (*wiring.inputs, *held), late)
    moving = core.delayed_inside((*wiring.inputs, *held))
    if moving:
        listed = ", ".join(
            f"{core.rows[k].delay_s:g} s after {core.rows[k].carrier}" for k in moving
        )
        raise ModelError(
            "a delay acts on a signal that moves between the samples",
            found=listed,
            needed="delays of held signals: no finite recursion is exact here",
            action="put a sample_and_hold before the delay, or use linear_system(pade_order=...)",
        )
    blocks = [_continuous_part(core, wiring.inputs, held, sample_time_s)]
    blocks += [_at_samples(linear_view(block)) for block in digital]
    blocks += [
        static("hold", block.inputs, (_before_hold(block.outputs[0]),), np.eye(1))
        for block in holds
    ]
    joined = assemble(blocks, wiring.inputs)
    places = joined.places(outputs)
    units = {n: wiring.units[n] for n in (*wiring.inputs, *outputs) if n in wiring.units}
    return LinearSystem(
        joined.a, joined.b, joined.c[places], joined.d[places],
        wiring.inputs, outputs, (), joined.states, sample_time_s, units,
    )  # fmt: skip


def _continuous_part(
    core: Core, inputs: tuple[str, ...], held: list[str], sample_time_s: float
) -> Block:
    """The continuous blocks as one recursion, from what is held to their signals."""
    recursion = core.system(core.signals).sampled(sample_time_s)
    fed = tuple(
        _before_hold(row.carrier) if row.carrier in held else row.carrier for row in core.rows
    )
    given = tuple(f"{name} (seen)" if name in inputs else name for name in core.signals)
    return Block("continuous part", fed, given, recursion)


def _before_hold(name: str) -> str:
    return f"{name} (before the hold)"


def _at_samples(block: Block) -> Block:
    """Delays of whole samples as states."""
    part = block.part
    if isinstance(part, LinearSystem) and part.is_discrete:
        return replace(block, part=part.with_pade())
    return block


def _hold(block: Block) -> Hold:
    assert isinstance(block.part, Hold)
    return block.part


def _is_continuous(block: Block, wiring: Wiring) -> bool:
    if isinstance(block.part, Hold) or block.sample_time_s is not None:
        return False
    return not block.is_static or wiring.sample_times_s[block.outputs[0]] is None


def _require_rate(wiring: Wiring, sample_time_s: float) -> None:
    for block in wiring.blocks:
        own = block.part.sample_time_s if isinstance(block.part, LinearSystem | Hold) else None
        if own is not None and abs(own - sample_time_s) > SAME * sample_time_s:
            raise OptionError(
                "a block has another sample time",
                found=f"{own:g} s of {block!r}",
                needed=f"{sample_time_s:g} s everywhere",
                action="sample at that time, or look at frequency_response() of the mixed rates",
            )
