"""A block of a loop: what stands between named signals, and what it does to them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import field, replace

from flightid.errors import ModelError, OptionError
from flightid.frozen import dataclass
from flightid.models import StateSpaceModel
from flightid.models.linear.linear_system import LinearSystem
from flightid.units import canonical


@dataclass(frozen=True)
class OutputLimits:
    """Output between two values; seen as linear, a gain of one."""

    low: float
    high: float

    def __str__(self) -> str:
        """In words."""
        return f"limited to {self.low:g} … {self.high:g}"


@dataclass(frozen=True)
class RateLimit:
    """Output that follows its input no faster than a rate; seen as linear, a gain of one."""

    rate_per_s: float

    def __str__(self) -> str:
        """In words."""
        return f"rate limited to {self.rate_per_s:g} per s"


@dataclass(frozen=True)
class Hold:
    """Samples its input at every T and holds each sample, late by a computation delay."""

    sample_time_s: float
    delay_s: float = 0.0

    def __str__(self) -> str:
        """In words."""
        late = f", {self.delay_s:g} s late" if self.delay_s else ""
        return f"sampled and held every {self.sample_time_s:g} s{late}"


@dataclass(frozen=True, eq=False)
class Equations:
    """A nonlinear model; its signals are departures from its trim.

    Attributes
    ----------
    model : StateSpaceModel
    linear : LinearSystem
        The model linearised at its trim.
    """

    model: StateSpaceModel
    linear: LinearSystem

    def __str__(self) -> str:
        """In words."""
        return f"equations of {self.model.name}"


Part = LinearSystem | OutputLimits | RateLimit | Hold | Equations


@dataclass(frozen=True, eq=False, repr=False)
class Block:
    """What stands between named signals.

    Made by the functions of `flightid.loops`; `flightid.connect` joins blocks whose signals have
    the same name.

    Attributes
    ----------
    name : str
        What it is, for messages and pictures.
    inputs, outputs : tuple of str
        Signals.
    part : LinearSystem, OutputLimits, RateLimit, Hold or Equations
        What it does; inputs and outputs in the order of the signals.
    units : mapping of str to str
        Unit by signal, as far as it is known.
    alike : bool
        All signals have one unit.

    Raises
    ------
    ModelError
        A signal is given twice among the outputs, or has no name.

    Example
    -------
    >>> import flightid as fid
    >>> fid.loops.low_pass("p", "p_filtered", 20.0)
    Block(low-pass: [p] to [p_filtered])
    """

    name: str
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    part: Part
    units: Mapping[str, str] = field(default_factory=dict)
    alike: bool = False

    def __post_init__(self) -> None:
        for name in (*self.inputs, *self.outputs):
            if not name:
                raise ModelError(f"a signal of block {self.name!r} has no name", found=repr(name))
        if len(set(self.outputs)) < len(self.outputs):
            raise ModelError(
                f"block {self.name!r} gives a signal twice", found=", ".join(self.outputs)
            )
        known = {*self.inputs, *self.outputs}
        for name in self.units:
            if name not in known:
                raise OptionError(
                    f"a unit of block {self.name!r} belongs to no signal of it",
                    found=name,
                    needed=f"one of {', '.join(sorted(known))}",
                )
        units = {name: canonical(unit) for name, unit in self.units.items()}
        object.__setattr__(self, "units", units)

    @property
    def sample_time_s(self) -> float | None:
        """Sample time of a recursion, s; None for everything else."""
        return self.part.sample_time_s if isinstance(self.part, LinearSystem) else None

    @property
    def is_static(self) -> bool:
        """Whether it has neither memory nor delay, so that it works in either time."""
        if isinstance(self.part, LinearSystem):
            late = bool(self.part.state_space()[4].any())
            return not self.part.order and not late and self.sample_time_s is None
        return isinstance(self.part, OutputLimits | RateLimit)

    @property
    def is_linear(self) -> bool:
        """Whether nothing is left out where it is seen as linear."""
        return isinstance(self.part, LinearSystem | Hold)

    def renamed(self, names: Mapping[str, str]) -> Block:
        """Copy with other names of signals; those left out stay."""
        return replace(
            self,
            inputs=tuple(names.get(each, each) for each in self.inputs),
            outputs=tuple(names.get(each, each) for each in self.outputs),
            units={names.get(each, each): unit for each, unit in self.units.items()},
        )

    def __repr__(self) -> str:
        """Name and signals on one line."""
        ends = f"[{', '.join(self.inputs)}] to [{', '.join(self.outputs)}]"
        return f"Block({self.name}: {ends})"

    def __str__(self) -> str:
        """What it does, in words."""
        if isinstance(self.part, LinearSystem):
            return _linear_words(self.part)
        return str(self.part)


def _linear_words(system: LinearSystem) -> str:
    _, _, _, d, delays = system.state_space()
    words = []
    if system.order:
        words.append(f"{system.order} state{'' if system.order == 1 else 's'}")
    elif d.size == 1:
        words.append(f"gain {d.item():.4g}")
    else:
        words.append("gains " + ", ".join(f"{value:.4g}" for value in d.ravel()[:6]))
    if delays.any():
        words.append(f"delay {', '.join(f'{value:.4g}' for value in sorted(set(delays)))} s")
    if system.sample_time_s is not None:
        words.append(f"every {system.sample_time_s:g} s")
    return ", ".join(words)
