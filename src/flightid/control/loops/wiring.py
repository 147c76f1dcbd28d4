"""Which signal comes from where: every name has one source, one unit and one kind of time."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import field
from difflib import get_close_matches
from functools import cached_property

from flightid.control.loops.block import Block, Hold
from flightid.control.loops.linear_core import Core, assemble, linear_view
from flightid.errors import ModelError, UnitError, UnknownNameError
from flightid.frozen import dataclass
from flightid.units import canonical


@dataclass(frozen=True, eq=False)
class Wiring:
    """Blocks joined by the names of their signals.

    Attributes
    ----------
    blocks : tuple of Block
    inputs : tuple of str
        Signals that come from outside.
    sources : mapping of str to int
        Block by the signal that it gives.
    units : mapping of str to str
        Unit by signal, as far as it is known.
    sample_times_s : mapping of str to float or None
        Sample time by signal, s; None for a signal in continuous time. Inputs from outside take
        either.

    Raises
    ------
    ModelError
        A signal with two sources, or a way from sampled to continuous blocks without a hold.
    UnknownNameError
        A signal without a source.
    UnitError
        Two blocks that disagree on the unit of a signal.
    """

    blocks: tuple[Block, ...]
    inputs: tuple[str, ...]
    declared: Mapping[str, str] = field(default_factory=dict)
    sources: Mapping[str, int] = field(init=False)
    units: Mapping[str, str] = field(init=False)
    sample_times_s: Mapping[str, float | None] = field(init=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "sources", _sources(self.blocks, self.inputs))
        _check_inputs(self)
        object.__setattr__(self, "units", _units(self.blocks, self.declared))
        object.__setattr__(self, "sample_times_s", _sample_times(self))

    @property
    def signals(self) -> tuple[str, ...]:
        """All signals: those from outside, then those of the blocks."""
        return (*self.inputs, *self.sources)

    @cached_property
    def core(self) -> Core:
        """All blocks as linear ones of continuous time, delays kept.

        Raises
        ------
        ModelError
            An algebraic loop without a solution.
        """
        return assemble([linear_view(block) for block in self.blocks], self.inputs)

    def require(self, names: Sequence[str], what: str) -> None:
        """Refuse names that are no signal.

        Raises
        ------
        UnknownNameError
            A name that is no signal.
        """
        for name in names:
            if name not in self.sources and name not in self.inputs:
                raise UnknownNameError(
                    f"{what} is no signal of the connection",
                    found=repr(name),
                    needed=_likely(name, self.signals),
                )


def _sources(blocks: tuple[Block, ...], inputs: tuple[str, ...]) -> dict[str, int]:
    found: dict[str, int] = {}
    for place, block in enumerate(blocks):
        for name in block.outputs:
            other = repr(blocks[found[name]]) if name in found else "an input from outside"
            if name in found or name in inputs:
                raise ModelError(
                    f"signal {name!r} has two sources",
                    found=f"{other} and {block!r}",
                    needed="one of the two",
                    action="rename one of them and add the two with sum_of",
                )
            found[name] = place
    if len(set(inputs)) < len(inputs):
        raise ModelError("an input from outside is given twice", found=", ".join(inputs))
    return found


def _check_inputs(wiring: Wiring) -> None:
    for block in wiring.blocks:
        for name in block.inputs:
            if name not in wiring.sources and name not in wiring.inputs:
                raise UnknownNameError(
                    f"signal {name!r} has no source",
                    found=f"{block!r}",
                    needed=_likely(name, wiring.signals),
                    action="list it among the inputs, or add the block that gives it",
                )


def _likely(name: str, known: Sequence[str]) -> str:
    near = get_close_matches(name, known, n=3)
    return f"perhaps {' or '.join(near)}" if near else f"one of {', '.join(known) or 'none'}"


def _units(blocks: tuple[Block, ...], declared: Mapping[str, str]) -> dict[str, str]:
    """Unit by signal; blocks whose signals are alike pass units on."""
    units: dict[str, tuple[str, object]] = {}

    def learn(name: str, unit: str, who: object) -> bool:
        known = units.get(name)
        if known is None:
            units[name] = (unit, who)
            return True
        if known[0] != unit:
            raise UnitError(
                f"two units for signal {name!r}",
                found=f"{known[0]} by {known[1]} and {unit} by {who}",
                needed="one unit",
                action="convert between them with a gain that names both units",
            )
        return False

    for name, unit in declared.items():
        learn(name, canonical(unit), "the connection")
    for block in blocks:
        for name, unit in block.units.items():
            learn(name, unit, block)
    fresh = True
    while fresh:
        fresh = False
        for block in blocks:
            if block.alike:
                ends = (*block.inputs, *block.outputs)
                for name in [each for each in ends if each in units]:
                    unit = units[name][0]
                    fresh |= bool(sum(learn(other, unit, block) for other in ends))
    return {name: unit for name, (unit, _) in units.items()}


def _sample_times(wiring: Wiring) -> dict[str, float | None]:
    """Sample time by signal; blocks without memory take that of what they read."""
    found: dict[str, float | None] = dict.fromkeys(wiring.signals)
    kinds = [(block, block.is_static) for block in wiring.blocks]
    static = [block for block, is_static in kinds if is_static]
    for block in wiring.blocks:
        found.update(dict.fromkeys(block.outputs, block.sample_time_s))
    # A sample time passes at most through every block on its way.
    for _ in static:
        moved = False
        for block in static:
            step = _read_time(block, found)
            moved |= any(found[name] != step for name in block.outputs)
            found.update(dict.fromkeys(block.outputs, step))
        if not moved:
            break
    for block, is_static in kinds:
        own = _read_time(block, found) if is_static else block.sample_time_s
        _check_time(block, block.part.sample_time_s if isinstance(block.part, Hold) else own, found)
    return found


def _read_time(block: Block, times: Mapping[str, float | None]) -> float | None:
    read = [times[name] for name in block.inputs if times[name] is not None]
    return read[0] if read else None


def _check_time(block: Block, own: float | None, times: Mapping[str, float | None]) -> None:
    for name in block.inputs:
        step = times[name]
        if step is None or step == own:
            continue
        if own is None:
            raise ModelError(
                f"sampled signal {name!r} meets a continuous block",
                found=f"every {step:g} s into {block!r}",
                needed="a hold between them",
                action="put a sample_and_hold there",
            )
        raise ModelError(
            f"signal {name!r} has another sample time than what reads it",
            found=f"{step:g} s into {block!r} at {own:g} s",
            needed="one sample time",
            action="sample one of the two anew: sample_and_hold, then a continuous block",
        )
