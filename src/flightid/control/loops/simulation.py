"""Loops in time, with their limits, delays and holds (native: `loop_simulation.rs`).

All linear continuous blocks are one system that is discretised exactly for straight lines (or
steps, where a signal is held) between the steps of the simulation. Delays of any length act exactly
on those lines. Limits, rate limits and equations of motion act at the steps: their error falls with
the square of the step.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from fractions import Fraction

import numpy as np
from numpy.typing import ArrayLike, NDArray

from flightid import _native
from flightid.control.loops.block import Block, Equations, Hold, OutputLimits, RateLimit
from flightid.control.loops.linear_core import Core, assemble
from flightid.control.loops.wiring import Wiring
from flightid.conventions import Role
from flightid.errors import OptionError, ShapeError, UnitError
from flightid.frozen import dataclass
from flightid.models.linear.linear_system import LinearSystem
from flightid.models.state_space.integration_steps import steps_per_sample
from flightid.record import Channel, InputHold, Record, Step
from flightid.record.chosen_hold import chosen_hold
from flightid.simulation.nonlinear import run_equations
from flightid.units import canonical

Array = NDArray[np.float64]
Port = tuple[str, list[int], list[int], int, Array]
Model = tuple[_native.StateSpace, Array, list[float], list[float], list[float], int, list[bool]]
MOST_STEPS = 50_000_000
NONE = np.zeros(0)


@dataclass(frozen=True, eq=False)
class _Clock:
    """Steps of the simulation.

    Attributes
    ----------
    step_s : float
        s.
    every : int
        Steps in a sample of the record.
    """

    step_s: float
    every: int

    def count(self, time_s: float) -> int:
        """Whole steps in a time."""
        return round(time_s / self.step_s)


def simulate_connection(
    wiring: Wiring,
    data: Record,
    outputs: Sequence[str],
    *,
    hold: str | None,
    step_s: float | None,
    initial_state: Mapping[str, ArrayLike],
) -> Record:
    """Run through the inputs of a record; `Interconnection.simulate` says how.

    Raises
    ------
    OptionError
        Another hold, a step without meaning, sample times that no step divides, a state of a block
        that is not there.
    UnitError
        The record has an input in another unit.
    DataError
        The run diverges.
    SingularError
        An algebraic loop through a limit does not settle.
    """
    hold = chosen_hold(data, hold, inputs=wiring.inputs).hold
    _check_units(wiring, data)
    clock = _clock(wiring, data.sample_time_s, step_s)
    linear = [block for block in wiring.blocks if _in_core(block)]
    ports = [block for block in wiring.blocks if not _in_core(block)]
    given = [name for block in ports for name in block.outputs]
    late = {b.outputs[0]: b.part.delay_s for b in ports if isinstance(b.part, Hold)}
    # Delays of a nonlinear model become rows by blocks of their own.
    core = assemble([*linear, *_late_inputs(ports)], (*wiring.inputs, *given), late)
    held = _held(wiring, hold)
    rows = _rows(core, wiring, data, clock, hold)
    listed, models = _ports(core, wiring, ports, clock, held, initial_state)
    a, b, c, d, delays_s = map(np.ascontiguousarray, core.system(core.signals).state_space())
    found = _native.simulate_loops(
        (a, b, c, d, delays_s),
        [row.carrier not in held for row in core.rows],
        rows,
        _initial(linear, core, initial_state, ports),
        listed,
        models,
        core.places(outputs),
        clock.every,
        clock.step_s,
    )
    return _record(wiring, data, outputs, found[:, : data.n_samples], hold, clock)


def _in_core(block: Block) -> bool:
    return isinstance(block.part, LinearSystem) and not block.part.is_discrete


def _check_units(wiring: Wiring, data: Record) -> None:
    for name in wiring.inputs:
        needed = wiring.units.get(name)
        found = _channel(data, name).unit
        if needed is not None and canonical(found) != needed:
            raise UnitError(
                f"input {name!r} of the record has another unit than the loops",
                found=found, needed=needed, action="convert the record to these units",
            )  # fmt: skip


def _clock(wiring: Wiring, sample_s: float, asked_s: float | None) -> _Clock:
    """The largest step below what was asked that divides the record's and all blocks' samples."""
    if asked_s is not None and not (np.isfinite(asked_s) and asked_s > 0.0):
        raise OptionError("the step of the simulation", found=asked_s, needed="above 0 s")
    times = {sample_s}
    for block in wiring.blocks:
        part = block.part
        if isinstance(part, LinearSystem | Hold) and part.sample_time_s is not None:
            times.add(part.sample_time_s)
    whole = _common(sorted(times))
    parts = 1 if asked_s is None else max(1, int(np.ceil(whole / asked_s * (1.0 - 1e-9))))
    return _Clock(whole / parts, round(sample_s / whole) * parts)


def _common(times: Sequence[float]) -> float:
    """Largest time that divides all."""
    shares = [Fraction(each / times[0]).limit_denominator(1000) for each in times]
    for exact, each in zip(shares, times, strict=True):
        if abs(float(exact) * times[0] - each) > 1e-9 * each:
            raise OptionError(
                "no step divides the sample times", found=", ".join(f"{t:g} s" for t in times),
                needed="times in the ratio of small whole numbers",
                action="resample the record to the loop's rate",
            )  # fmt: skip
    common = shares[0]
    for share in shares[1:]:
        common = _greatest(common, share)
    return float(common) * times[0]


def _greatest(first: Fraction, second: Fraction) -> Fraction:
    while second:
        first, second = second, first % second
    return first


def _held(wiring: Wiring, hold: str) -> set[str]:
    """Signals that are steps: all but those that something moves between samples."""
    held = set(wiring.signals)
    if hold == "first":
        held -= set(wiring.inputs)
    while True:
        moved = {
            name
            for block in wiring.blocks
            for name in block.outputs
            if name in held and not _stays_held(block, held)
        }
        if not moved:
            return held
        held -= moved


def _stays_held(block: Block, held: set[str]) -> bool:
    if isinstance(block.part, Hold) or block.sample_time_s is not None:
        return True
    static = isinstance(block.part, OutputLimits) or (
        isinstance(block.part, LinearSystem) and not block.part.order
    )
    return static and all(name in held for name in block.inputs)


def _late_name(block: Block, place: int) -> str:
    return f"{block.inputs[place]} (input {place} of {block.outputs[0]})"


def _late_inputs(ports: Sequence[Block]) -> list[Block]:
    """Delays before nonlinear models."""
    made = []
    for block in ports:
        if isinstance(block.part, Equations):
            for place, late_s in enumerate(block.part.linear.state_space()[4]):
                if late_s:
                    ends = (block.inputs[place],), (_late_name(block, place),)
                    late = LinearSystem(
                        np.zeros((0, 0)), np.zeros((0, 1)), np.zeros((1, 0)), np.eye(1),
                        *ends, [late_s],
                    )  # fmt: skip
                    made.append(Block("delay", *ends, late))
    return made


def _rows(core: Core, wiring: Wiring, data: Record, clock: _Clock, hold: str) -> Array:
    """What drives the core: a column of rest, then inputs at every step; ports are filled later."""
    n_steps = (data.n_samples - 1) * clock.every + 1
    if n_steps > MOST_STEPS:
        raise OptionError("the simulation is too long", found=f"{n_steps} steps",
                          needed=f"at most {MOST_STEPS}")  # fmt: skip
    rows = np.zeros((len(core.rows), n_steps + 1))
    place = np.arange(n_steps) / clock.every
    for number, row in enumerate(core.rows):
        if row.carrier in wiring.inputs:
            samples = data[row.carrier]
            if hold == "zero":
                rows[number, 1:] = samples[np.floor(place + 1e-9).astype(int)]
            else:
                rows[number, 1:] = np.interp(place, np.arange(len(samples)), samples)
    return rows


def _ports(
    core: Core,
    wiring: Wiring,
    blocks: Sequence[Block],
    clock: _Clock,
    held: set[str],
    initial: Mapping[str, ArrayLike],
) -> tuple[list[Port], list[Model]]:
    listed: list[Port] = []
    models: list[Model] = []
    done: set[int] = {k for k, row in enumerate(core.rows) if row.carrier in wiring.inputs}
    for block in blocks:
        part = block.part
        reads = list(block.inputs)
        if isinstance(part, Equations):
            late = part.linear.state_space()[4]
            reads = [_late_name(block, k) if late[k] else name for k, name in enumerate(reads)]
            models.append(
                _model(block, part, clock, [name in held for name in block.inputs], initial)
            )
        places = core.places(reads)
        if isinstance(part, Equations | LinearSystem):
            rows = [core.rows.index(next(r for r in core.rows if r.carrier == n and not r.delay_s))
                    for n in block.outputs]  # fmt: skip
        else:
            # Every row of a held or limited signal is driven alike, whatever its delay.
            rows = [k for k, row in enumerate(core.rows) if row.carrier == block.outputs[0]]
            places = places * len(rows)
        done.update(rows)
        listed.append((*_element(block, clock, len(models), places, rows, initial),))
    for number, row in enumerate(core.rows):
        if number not in done:
            listed.append(("through", core.places([row.carrier]), [number], 1, NONE))
    return listed, models


def _element(
    block: Block,
    clock: _Clock,
    n_models: int,
    reads: list[int],
    rows: list[int],
    initial: Mapping[str, ArrayLike],
) -> Port:
    part = block.part
    if isinstance(part, OutputLimits):
        return "limits", reads, rows, 1, np.array([part.low, part.high])
    if isinstance(part, RateLimit):
        return "rate", reads, rows, 1, np.array([part.rate_per_s * clock.step_s])
    if isinstance(part, Hold):
        return "hold", reads, rows, clock.count(part.sample_time_s), NONE
    if isinstance(part, Equations):
        return "equations", reads, rows, n_models - 1, NONE
    recursion = part.with_pade()
    start = np.zeros(recursion.order)
    start[: part.order] = _start(block, part.order, initial)
    numbers = [np.asarray(each).ravel() for each in recursion.state_space()[:4]]
    every = clock.count(float(part.sample_time_s or 0.0))
    return "recursion", reads, rows, every, np.concatenate([*numbers, start])


def _model(
    block: Block, part: Equations, clock: _Clock, held: list[bool], initial: Mapping[str, ArrayLike]
) -> Model:
    model = part.model
    trim_in = [float(model.trim.get(name, 0.0)) for name in model.inputs]
    states, outputs = run_equations(
        model, np.array(trim_in)[:, None], clock.step_s,
        first_order_hold=True, initial_state=None, substeps=1,
    )  # fmt: skip
    start = states[:, 0] + _start(block, len(states), initial)
    return (
        model.native, model.parameters.independent_values(None), trim_in,
        [float(value) for value in outputs[:, 0]], [float(value) for value in start],
        steps_per_sample(model, clock.step_s, None), held,
    )  # fmt: skip


def _start(block: Block, n: int, initial: Mapping[str, ArrayLike]) -> Array:
    if block.name not in initial:
        return np.zeros(n)
    found = np.asarray(initial[block.name], dtype=np.float64)
    if found.shape != (n,):
        raise ShapeError(f"initial state of block {block.name!r}", found=found.shape, needed=(n,))
    return found


def _initial(
    linear: Sequence[Block], core: Core, initial: Mapping[str, ArrayLike], ports: Sequence[Block]
) -> Array:
    names = [block.name for block in (*linear, *ports)]
    once = [name for name in names if names.count(name) == 1]
    for name in initial:
        if name not in once:
            raise OptionError(
                "an initial state belongs to no one block", found=repr(name),
                needed=f"one of {', '.join(once)}",
            )  # fmt: skip
    parts = [_start(b, b.part.order, initial) for b in linear if isinstance(b.part, LinearSystem)]
    found = np.concatenate([NONE, *parts])
    assert len(found) == len(core.a)
    return np.ascontiguousarray(found)


def _record(
    wiring: Wiring,
    data: Record,
    outputs: Sequence[str],
    found: Array,
    hold: InputHold,
    clock: _Clock,
) -> Record:
    channels = [_channel(data, name) for name in wiring.inputs]
    computed = {}
    for name, values in zip(outputs, found, strict=True):
        if name in wiring.inputs:
            continue
        computed[name] = values
        unit = wiring.units.get(name)
        if unit is None:
            unit = _channel(data, name).unit if name in data.channels else "1"
        channels.append(Channel(name, unit, Role.OUTPUT, "simulated"))
    step = Step("simulate loops", {"hold": hold, "step_s": clock.step_s})
    shape = replace(data.input_shape, hold=hold)
    return data.replace(computed, channels=channels, step=step, input_shape=shape)


def _channel(data: Record, name: str) -> Channel:
    data.matrix([name])  # refuses a name that is not there
    return data.channels[name]
