"""Blocks of a controller one frame at a time: what stands between a model's outputs and inputs."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from flightid.control.closed_loop.controller_blocks import moved_by
from flightid.control.loops.block import Block, Equations, Hold, OutputLimits, RateLimit
from flightid.errors import OptionError
from flightid.simulation.stepper import Stepper

WHOLE = 1e-9
Run = Callable[[Sequence[float]], list[float]]


class BlockController:
    """Blocks between a model's outputs and its inputs, one frame at a time.

    What the blocks give under the name of a model's input is added to it; what they read and
    nothing gives is a command of the pilot. Linear blocks are exact for steps between frames.

    Parameters
    ----------
    blocks : sequence of Block
        Without a circle among themselves.
    model : Model or LinearSystem
        The vehicle, by its channels.
    sample_time_s : float
        Of a frame, s.

    Raises
    ------
    OptionError
        Blocks in a circle, or a hold that does not fall on the frames.
    UnknownNameError
        The blocks move no input, or read no output.

    Example
    -------
    >>> from flightid.control.loops import gain, limiter
    >>> from flightid.models import LinearSystem
    >>> lag = LinearSystem([[-1.0]], [[1.0]], [[1.0]], [[0.0]], ("u",), ("y",))
    >>> law = BlockController([gain("y", "x", -4.0), limiter("x", "u", 1.0)], lag, 0.1)
    >>> law.step({"u": 0.0}, {"y": 0.5})
    {'u': -1.0}
    """

    def __init__(self, blocks: Sequence[Block], model: Any, sample_time_s: float) -> None:  # noqa: ANN401
        self._moved = moved_by(blocks, model.inputs, model.outputs)
        known = {*model.inputs, *model.outputs}
        given = {name for block in blocks for name in block.outputs}
        self.commands = tuple(
            dict.fromkeys(n for b in blocks for n in b.inputs if n not in known | given)
        )
        self._blocks = [
            (block, _stepped(block, sample_time_s))
            for block in _in_order(blocks, {*known, *self.commands}, set(self._moved))
        ]

    def step(self, given: Mapping[str, float], outputs: Mapping[str, float]) -> dict[str, float]:
        """What is added to each input, from the pilot's commands and the model's last outputs."""
        signals, added = {**given, **outputs}, dict.fromkeys(self._moved, 0.0)
        for block, run in self._blocks:
            found = run([signals[name] for name in block.inputs])
            for name, value in zip(block.outputs, found, strict=True):
                # A stick that the law moves stays readable as the pilot moved it.
                target = added if name in added else signals
                target[name] = value
        return added


def _in_order(blocks: Sequence[Block], known: set[str], moved: set[str]) -> list[Block]:
    """The blocks, each behind those whose outputs it reads."""
    left, ordered, ready = list(blocks), [], set(known)
    while left:
        free = [block for block in left if ready.issuperset(block.inputs)]
        if not free:
            raise OptionError(
                "the blocks of the controller go in a circle",
                found=", ".join(block.outputs[0] for block in left),
                needed="blocks one behind the other, as they are flown",
                action="write the circle as one transfer block",
            )
        ordered += free
        ready |= {name for block in free for name in block.outputs} - moved
        left = [block for block in left if block not in free]
    return ordered


def _stepped(block: Block, step_s: float) -> Run:
    part = block.part
    if isinstance(part, OutputLimits):
        return lambda u: [float(np.clip(u[0], part.low, part.high))]
    if isinstance(part, RateLimit):
        return _SlewLimit(part.rate_per_s * step_s)
    if isinstance(part, Hold):
        return _SampleHold(part, step_s)
    runner = Stepper(part.model if isinstance(part, Equations) else part, step_s)

    def run(values: Sequence[float]) -> list[float]:
        return list(runner.step(dict(zip(runner.inputs, values, strict=True))).values())

    return run


class _SlewLimit:
    def __init__(self, reach: float) -> None:
        self._reach, self._last = reach, 0.0

    def __call__(self, u: Sequence[float]) -> list[float]:
        self._last = float(np.clip(u[0], self._last - self._reach, self._last + self._reach))
        return [self._last]


class _SampleHold:
    def __init__(self, hold: Hold, step_s: float) -> None:
        self._every, late = (round(each / step_s) for each in (hold.sample_time_s, hold.delay_s))
        exact = (hold.sample_time_s - self._every * step_s, hold.delay_s - late * step_s)
        if not self._every or max(map(abs, exact)) > WHOLE:
            raise OptionError(
                "a block samples between the frames of the flight",
                found=f"every {hold.sample_time_s:g} s, {hold.delay_s:g} s late",
                needed=f"multiples of {step_s:g} s",
                action="give another sample_rate_hz=…",
            )
        self._row, self._frame = [0.0] * (late + 1), 0
        self._sample = 0.0

    def __call__(self, u: Sequence[float]) -> list[float]:
        if self._frame % self._every == 0:
            self._sample = u[0]
        self._frame += 1
        self._row = [self._sample, *self._row[:-1]]
        return [self._row[-1]]
