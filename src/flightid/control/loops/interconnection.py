"""Blocks joined by the names of their signals: responses, linear systems, broken loops, flights."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import field, replace
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from flightid.control.loops.block import Block, Hold
from flightid.control.loops.elements import gain, sum_of
from flightid.control.loops.response import ConnectionBlocks
from flightid.control.loops.sampled_loop import sampled_system
from flightid.control.loops.simulation import simulate_connection
from flightid.control.loops.stability import (
    Parts,
    Stability,
    by_poles,
    delayed_parts,
    with_delays,
)
from flightid.control.loops.views import continuous_core, continuous_system
from flightid.control.loops.wiring import Wiring
from flightid.conventions import Light
from flightid.errors import OptionError, UnknownNameError
from flightid.findings import Finding
from flightid.frozen import dataclass
from flightid.models.linear.hold_equivalent import Hold as InputHold
from flightid.models.linear.linear_system import DEFAULT_PADE_ORDER, LinearSystem
from flightid.record import Record
from flightid.result import Result
from flightid.table import Column, Table

STABILITY_ORDER = 6


@dataclass(frozen=True, eq=False, repr=False)
class Interconnection(
    Result, schema="flightid.interconnection/1", untold={"wiring": "follows from the blocks"}
):
    """Blocks joined by the names of their signals.

    Made by `flightid.connect`. All signals are departures from trim.

    Attributes
    ----------
    blocks : tuple of Block
    inputs : tuple of str
        Signals from outside.
    outputs : tuple of str
        Signals to look at; any signal can be simulated.
    name : str

    Example
    -------
    >>> import flightid as fid
    >>> loop = fid.connect([fid.loops.sum_of("e", "r", "-y"), fid.loops.gain("e", "u", 3.0),
    ...                     fid.loops.transfer("u", "y", [1.0], [1.0, 1.0])],
    ...                    inputs=["r"], outputs=["y"])
    >>> loop
    Interconnection(3 blocks, inputs [r], outputs [y], 1 state)
    >>> loop.frequency_response([0.0])[0, 0, 0].real
    np.float64(0.75)
    """

    blocks: tuple[Block, ...]
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    name: str = "loops"
    wiring: Wiring = field(init=False)

    def __post_init__(self) -> None:
        wiring = Wiring(self.blocks, self.inputs)
        wiring.require(self.outputs, "an output")
        if len(set(self.outputs)) < len(self.outputs):
            raise OptionError("an output is given twice", found=", ".join(self.outputs))
        object.__setattr__(self, "wiring", wiring)

    @property
    def signals(self) -> tuple[str, ...]:
        """All signals, those from outside first."""
        return self.wiring.signals

    @property
    def units(self) -> dict[str, str]:
        """Unit by signal, as far as it is known."""
        return dict(self.wiring.units)

    @property
    def order(self) -> int:
        """Number of states, without those of nonlinear models and of delays."""
        return sum(b.part.order for b in self.blocks if isinstance(b.part, LinearSystem))

    @property
    def sample_time_s(self) -> float | None:
        """Sample time of the sampled blocks and holds, s, where they share one; else None."""
        times = {
            block.part.sample_time_s
            for block in self.blocks
            if isinstance(block.part, LinearSystem | Hold) and block.part.sample_time_s is not None
        }
        return times.pop() if len(times) == 1 else None

    @property
    def findings(self) -> tuple[Finding, ...]:
        """What its linear views leave out."""
        unseen = [block for block in self.blocks if not block.is_linear]
        if not unseen:
            return ()
        listed = "; ".join(f"{block.outputs[0]}: {block}" for block in unseen)
        return (
            Finding(
                "not-linear",
                Light.UNKNOWN,
                f"responses, margins and poles are those of small motion: {listed}",
                "simulate with the amplitudes that are meant",
            ),
        )

    def frequency_response(self, omega_rad_s: ArrayLike) -> NDArray[np.complex128]:
        """H(jω) from inputs to outputs, delays exact.

        A hold counts with its fundamental, without aliases; a sampled block with H(e^(jωT)).
        What is sampled is exact by `sampled(T).frequency_response`.

        Parameters
        ----------
        omega_rad_s : array_like, shape (n_f,)
            rad/s.

        Returns
        -------
        ndarray of complex, shape (n_outputs, n_inputs, n_f)
        """
        return self._responding.at(self.outputs, omega_rad_s)

    @cached_property
    def _responding(self) -> ConnectionBlocks:
        return ConnectionBlocks.of(self.wiring)

    def linear_system(self, pade_order: int | None = DEFAULT_PADE_ORDER) -> LinearSystem:
        """One continuous linear system near trim.

        Delays that act on an input alone stay exact, those inside become states by Padé's
        approximation; a hold is taken as the delay T/2 + T_c.

        Parameters
        ----------
        pade_order : int or None
            None: refuse delays inside.
        """
        known = self._linear_systems
        if pade_order not in known:
            known[pade_order] = continuous_system(self.wiring, self.outputs, pade_order)
        return known[pade_order]

    @cached_property
    def _linear_systems(self) -> dict[int | None, LinearSystem]:
        """Those that were asked for: each axis of a rating asks every vehicle again."""
        return {}

    def sampled(self, sample_time_s: float | None = None) -> LinearSystem:
        """The exact recursion of the signals at the samples, for inputs held over each sample.

        Parameters
        ----------
        sample_time_s : float, optional
            T, s; that of its sampled blocks and holds when left out.

        Returns
        -------
        LinearSystem
            With a sample time.
        """
        step = self.sample_time_s if sample_time_s is None else sample_time_s
        if step is None:
            raise OptionError(
                "the sample time is not known", needed="sample_time_s, or blocks of one sample time"
            )
        return sampled_system(self.wiring, self.outputs, step)

    def stability(self) -> Stability:
        """Poles, and whether all decay; with delays inside each pole is exact and they are counted.

        Where something is sampled, the poles are those of `sampled`.
        """
        return self._stability

    @cached_property
    def _stability(self) -> Stability:
        if self.sample_time_s is not None:
            return by_poles(self.sampled().poles(), self.sample_time_s)
        parts = self.delayed_parts()
        if parts is None:
            core = continuous_core(self.wiring)
            return by_poles(np.linalg.eigvals(core.a).astype(np.complex128), None)
        approximate = self.with_outputs(*self.signals).linear_system(STABILITY_ORDER)
        return with_delays(parts, approximate.poles())

    def delayed_parts(self) -> Parts | None:
        """A, B, C, D and delays of what goes around inside; None where no delay does."""
        if self.sample_time_s is not None:
            return None
        core = continuous_core(self.wiring)
        return delayed_parts(core, self.inputs) if core.delayed_inside(self.inputs) else None

    def poles(self) -> NDArray[np.complex128]:
        """Poles of `stability`: rad/s, or in the z plane."""
        return self.stability().poles

    @property
    def is_stable(self) -> bool:
        """Verdict of `stability`."""
        return self.stability().is_stable

    def broken_at(self, signal: str) -> Interconnection:
        """The loop cut at a signal, with the sign of negative feedback: 1 + L = 0 is critical.

        Parameters
        ----------
        signal : str
            Where a block gives it the loop is cut; everything that reads it reads the new input.

        Returns
        -------
        Interconnection
            One input, the signal, and one output ``"<signal>_returned"``: minus what comes back.

        Raises
        ------
        UnknownNameError
            No block gives such a signal.

        Example
        -------
        >>> import flightid as fid
        >>> loop = fid.connect([fid.loops.sum_of("e", "r", "-y"),
        ...                     fid.loops.transfer("e", "y", [3.0], [1.0, 1.0])],
        ...                    inputs=["r"], outputs=["y"])
        >>> loop.broken_at("y").frequency_response([0.0]).real.item()
        3.0
        """
        self._require_given(signal)
        back = f"{signal}_before_cut"
        returned = f"{signal}_returned"
        blocks = [_given_as(block, signal, back) for block in self.blocks]
        turned = gain(back, returned, -1.0, units=self._unit(signal, back))
        return Interconnection(
            (*blocks, *_at_rest(self.inputs), turned),
            (signal,), (returned,), f"{self.name}, cut at {signal}",
        )  # fmt: skip

    def sensitivity_at(self, signal: str) -> Interconnection:
        """What a disturbance that is added at a signal leaves there: S = 1/(1 + L).

        Parameters
        ----------
        signal : str
            One that a block gives.

        Returns
        -------
        Interconnection
            One input ``"<signal>_disturbance"``, and the signal as output.

        Raises
        ------
        UnknownNameError
            No block gives such a signal.
        """
        self._require_given(signal)
        bare, added = f"{signal}_undisturbed", f"{signal}_disturbance"
        blocks = [_given_as(block, signal, bare) for block in self.blocks]
        return Interconnection(
            (*blocks, *_at_rest(self.inputs), sum_of(signal, bare, added)),
            (added,), (signal,), f"{self.name}, disturbed at {signal}",
        )  # fmt: skip

    def with_outputs(self, *names: str) -> Interconnection:
        """Copy that looks at other signals."""
        return replace(self, outputs=names)

    def simulate(
        self,
        record: Record,
        *,
        outputs: Sequence[str] | None = None,
        hold: InputHold | None = None,
        maximum_step_s: float | None = None,
        initial_state: Mapping[str, ArrayLike] | None = None,
    ) -> Record:
        """Run through the inputs of a record, limits, delays and holds included.

        See `flightid.control.loops.simulation` for how.

        Parameters
        ----------
        record : Record
            Holds the inputs by name, departures from trim; before its first sample all is at rest.
        outputs : sequence of str, optional
            Signals to keep; `outputs` when left out.
        hold : {"first", "zero"}, optional
            What inputs do between samples; default: what the record knows, else "first".
        maximum_step_s : float, optional
            Largest step, s; the record's samples when left out, less where delays or holds need it.
        initial_state : mapping of str to array_like, optional
            States of a block by its name.

        Returns
        -------
        Record
            Inputs as they were and the signals, on the record's time base.
        """
        kept = tuple(self.outputs if outputs is None else outputs)
        self.wiring.require(kept, "a signal to keep")
        return simulate_connection(
            self.wiring,
            record,
            kept,
            hold=hold,
            step_s=maximum_step_s,
            initial_state=initial_state or {},
        )

    def _require_given(self, signal: str) -> None:
        if signal not in self.wiring.sources:
            raise UnknownNameError(
                "no block gives this signal", found=repr(signal),
                needed=f"one of {', '.join(self.wiring.sources)}",
            )  # fmt: skip

    def _unit(self, signal: str, name: str) -> dict[str, str]:
        unit = self.wiring.units.get(signal)
        return {} if unit is None else {name: unit}

    def __repr__(self) -> str:
        """Size on one line."""
        n = self.order
        ends = f"inputs [{', '.join(self.inputs)}], outputs [{', '.join(self.outputs)}]"
        count = f"{len(self.blocks)} block{'' if len(self.blocks) == 1 else 's'}"
        return f"Interconnection({count}, {ends}, {n} state{'' if n == 1 else 's'})"

    def summary(self) -> Table:
        """Table of the blocks with their signals."""
        rows = tuple(
            (block.name, ", ".join(block.inputs), ", ".join(block.outputs), str(block))
            for block in self.blocks
        )
        columns = (Column("block"), Column("reads"), Column("gives"), Column("what it does"))
        notes = (
            f"From outside: {', '.join(self.inputs) or 'nothing'}. "
            f"Looked at: {', '.join(self.outputs)}.",
            *map(str, self.findings),
        )
        return Table(self.name, columns, rows, notes)

    def _computed(self) -> dict[str, object]:
        return {
            "units": self.units,
            "blocks": [
                {
                    "name": block.name,
                    "inputs": block.inputs,
                    "outputs": block.outputs,
                    "what": str(block),
                }
                for block in self.blocks
            ],
            "findings": self.findings,
        }


def _given_as(block: Block, signal: str, other: str) -> Block:
    """The block gives its signal under another name."""
    if signal not in block.outputs:
        return block
    names = {signal: other}
    outputs = tuple(names.get(each, each) for each in block.outputs)
    units = dict(block.units)
    if signal in units and signal not in block.inputs:
        units[other] = units.pop(signal)
    return replace(block, outputs=outputs, units=units)


def _at_rest(inputs: Iterable[str]) -> list[Block]:
    """Sources that give nothing, where something from outside is left at rest."""
    return [gain((), name, np.zeros((1, 0))) for name in inputs]
