"""Blocks written out as states, equations and auxiliary quantities of a state-space model."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import field, replace
from typing import Any, TypeVar

from flightid.dimensions import unit_of
from flightid.errors import ModelError
from flightid.formula import formula_names
from flightid.frozen import dataclass
from flightid.models.language.blocks import MAXIMUM_BLOCKS, ModelBlock, Realisation, wrapped
from flightid.models.parameters import Parameter, Parameters
from flightid.models.state_space.linear import Linearisation
from flightid.models.state_space.parts import Output

Value = TypeVar("Value")


def written_out(bare: Linearisation, blocks: Sequence[ModelBlock]) -> dict[str, Any]:
    """What actuators at a model's inputs, and sensors and filters at its outputs, change in it.

    Blocks at one place stand one behind the other, in the order given, in the direction of the
    signal. Numbers of a block become fixed parameters ``<block>_<key>``.

    Parameters
    ----------
    bare : Linearisation
        Model without blocks.
    blocks : sequence of ModelBlock

    Returns
    -------
    dict
        Fields of the model with these blocks that differ from the bare model's.

    Raises
    ------
    ModelError
        A place that does not exist, names that clash, units that clash, a pure delay at an output.
    """
    if len(blocks) > MAXIMUM_BLOCKS or len({block.name for block in blocks}) < len(blocks):
        raise ModelError(
            "too many blocks, or two of one name",
            found=", ".join(block.name for block in blocks)[:200],
            needed=f"at most {MAXIMUM_BLOCKS}, each with its own name",
        )
    work = _Expansion(bare)
    named = tuple(work.named(block) for block in blocks)
    # Actuators before sensors: a sensor measures what the actuators do.
    places = dict.fromkeys(block.at for block in blocks)
    for place in sorted(places, key=lambda name: name not in bare.inputs):
        chain = [block for block in named if block.at == place]
        if place in bare.inputs:
            work.actuators(place, chain)
        elif place in bare.outputs:
            work.sensors(place, chain)
        else:
            raise ModelError(
                f"block {chain[0].name} stands at what is neither input nor output",
                found=repr(place),
                needed=f"one of {', '.join((*bare.inputs, *bare.outputs))}",
            )
    kinds = ["states", "measurements", "equations", "definitions", "parameters", "delays", "trim"]
    return {**{kind: getattr(work, kind) for kind in kinds}, "blocks": named, "bare": bare}


@dataclass
class _Expansion:
    """The tables of a model while blocks are written into them."""

    bare: Linearisation
    states: dict[str, str] = field(init=False)
    measurements: dict[str, Output] = field(init=False)
    equations: dict[str, str] = field(init=False)
    definitions: dict[str, Output] = field(init=False)
    parameters: Parameters = field(init=False)
    delays: dict[str, str] = field(init=False)
    trim: dict[str, float] = field(init=False)

    def __post_init__(self) -> None:
        for name in ("states", "measurements", "equations", "definitions", "delays", "trim"):
            setattr(self, name, dict(getattr(self.bare, name)))
        self.parameters = self.bare.parameters

    def named(self, block: ModelBlock) -> ModelBlock:
        """The block with names of parameters in the place of its numbers."""
        values = dict(block.values)
        new: dict[str, tuple[float, str]] = {}
        for key, (number, unit) in block.numbers.items():
            new[key], values[key] = (number, unit), f"{block.name}_{key}"
        if block.kind == "transfer":
            unit_below = self._unit_of_leading(block)
            for key, letter in (("numerator", "b"), ("denominator", "a")):
                values[key] = self._coefficients(block, key, letter, unit_below, new)
        added = [
            Parameter(f"{block.name}_{key}", number, unit, free=False,
                      note=f"{key} of the {block.kind.replace('_', ' ')} at {block.at}")
            for key, (number, unit) in new.items()
        ]  # fmt: skip
        self.parameters = Parameters([*self.parameters.values(), *added])
        return replace(block, values=values)

    def _unit_of_leading(self, block: ModelBlock) -> str:
        """Unit of the coefficient of the highest power, from any coefficient that is a formula."""
        listed = list(block.values["denominator"])
        for place, entry in enumerate(listed):
            if isinstance(entry, str):
                return _seconds(self._unit(entry, block), place)
        return "1"

    def _coefficients(
        self,
        block: ModelBlock,
        key: str,
        letter: str,
        leading: str,
        new: dict[str, tuple[float, str]],
    ) -> list[object]:
        """Coefficients, numbers replaced by names; zero has any unit and stays."""
        listed = list(block.values[key])
        order = len(block.values["denominator"]) - 1
        found: list[object] = []
        for place, entry in enumerate(listed):
            power = len(listed) - 1 - place
            alone = isinstance(entry, str) or entry == 0
            if not alone:
                name = f"{letter}{power}"
                new[name] = (float(entry), _seconds(leading, power - order))
            found.append(entry if alone else f"{block.name}_{letter}{power}")
        return found

    def _unit(self, text: str, block: ModelBlock) -> str:
        units = self.parameters.units
        for name in formula_names(text):
            if name not in units:
                raise ModelError(
                    f"block {block.name} names what is no parameter",
                    found=repr(name),
                    needed=f"one of {', '.join(units)}",
                )
        return unit_of(text, units, subject=f"block {block.name}")

    def actuators(self, place: str, chain: Sequence[ModelBlock]) -> None:
        """Blocks between an input and the equations."""
        signal, unit = place, self.bare.input_units[place]
        level = self.bare.trim.get(place, 0.0)
        moving = [block for block in chain if block.kind != "delay"]
        if moving:
            self._swap(place, moving[-1].name)
        for block in chain:
            realised = block.realised()
            if realised.delay:
                self._check_delay(block)
                earlier = self.delays[place]
                late = wrapped(realised.delay)
                self.delays[place] = late if earlier == "0" else f"{wrapped(earlier)} + {late}"
                continue
            level = self._settled(block, realised, level)
            signal = self._written(block, realised, signal, unit)

    def _swap(self, place: str, signal: str) -> None:
        """What the vehicle feels is the last block's output; blocks are written after this."""
        self.equations = {
            _swapped(left, place, signal): _swapped(right, place, signal)
            for left, right in self.equations.items()
        }
        for table in (self.definitions, self.measurements):
            for name, output in table.items():
                text = _swapped(output.expression, place, signal)
                table[name] = replace(output, expression=text)

    def sensors(self, place: str, chain: Sequence[ModelBlock]) -> None:
        """Blocks between an output's formula and what is recorded."""
        output = self.measurements[place]
        signal = output.expression
        for block in chain:
            realised = block.realised()
            if realised.delay:
                raise ModelError(
                    f"block {block.name} is a pure delay at an output",
                    found=f"output {place}",
                    needed="a pure delay at an input, or kind 'pade_delay'",
                )
            signal = self._written(block, realised, wrapped(signal), output.unit)
        self.measurements[place] = replace(output, expression=signal)

    def _check_delay(self, block: ModelBlock) -> None:
        unit = self._unit(str(block.values["delay"]), block)
        if unit != "s":
            raise ModelError(f"delay of block {block.name} does not have its unit",
                             found=repr(unit), needed="'s'")  # fmt: skip

    def _settled(self, block: ModelBlock, realised: Realisation, level: float) -> float:
        """Steady output for a steady input; sets the trim of the first state."""
        if realised.order and level:
            above, below = self.parameters.tape(
                (realised.numerator[0], realised.denominator[0])
            ).evaluate(self.parameters.independent_values())
            if below != 0.0:
                self.trim.setdefault(f"{block.name}_1", level / below)
                return level * float(above / below)
        return level

    def _written(self, block: ModelBlock, realised: Realisation, signal: str, unit: str) -> str:
        """Add states, equations and the output of one block; its name."""
        n = realised.order
        names = [f"{block.name}_{k}" for k in range(1, n + 1)]
        below, above = realised.denominator, realised.numerator
        inner = " - ".join([signal, *_products(below[:-1], names)])
        normal = realised.step or realised.rate
        for k, name in enumerate(names):
            last = k == n - 1
            right = inner if last else names[k + 1]
            left = f"{name}'"
            if realised.step:
                left = f"{wrapped(realised.step)}*{left}"
            elif realised.rate:
                right = f"{wrapped(realised.rate)}*{wrapped(right)}"
            elif last:
                left = f"{wrapped(below[-1])}*{left}"
            self.equations[left] = right
            leading = "1" if normal else self._unit(below[-1], block)
            self.states[name] = unit if normal else f"({_seconds(unit, n - k)})/({leading})"
        through = above[-1] if normal or above[-1] == "0" else f"({above[-1]})/({below[-1]})"
        fed = [] if through == "0" else _products([through], [signal])
        back = [_times(through, factor) for factor in below[:-1]]
        pairs = list(zip(above[:-1], back, strict=True))
        added = _products(["0" if a == b else a for a, b in pairs], names)
        taken = _products(["0" if a == b else b for a, b in pairs], names)
        text = " - ".join([" + ".join([*fed, *added] or [f"0*{signal}"]), *taken])
        self.definitions[block.name] = Output(text, unit)
        return block.name


def _seconds(unit: str, power: int) -> str:
    """A unit times a power of the second."""
    return f"({unit})*s**({power})" if power else unit


def _times(first: str, second: str) -> str:
    if "0" in (first, second):
        return "0"
    if "1" in (first, second):
        return second if first == "1" else first
    return f"({first})*({second})"


def _products(factors: Sequence[str], names: Sequence[str]) -> list[str]:
    pairs = [(factor, name) for factor, name in zip(factors, names, strict=False) if factor != "0"]
    return [name if factor == "1" else f"{wrapped(factor)}*{name}" for factor, name in pairs]


def _swapped(text: str, name: str, other: str) -> str:
    """A formula with one name in the place of another."""
    return re.sub(rf"(?<![A-Za-z0-9_]){re.escape(name)}(?![A-Za-z0-9_'])", other, text)


def split_own(
    blocks: Sequence[ModelBlock], table: Mapping[str, Value]
) -> tuple[dict[str, Value], dict[str, Value]]:
    """Entries of a table by state, and those of them that belong to states of blocks.

    Returns
    -------
    tuple of dict
        The model's own, the blocks'.
    """
    own = {f"{block.name}_{k}" for block in blocks for k in range(1, block.realised().order + 1)}
    own |= {f"{name}'" for name in own}
    rest = {name: value for name, value in table.items() if name not in own}
    return rest, {name: value for name, value in table.items() if name in own}
