"""What subspace identification is asked for: channels, order and options."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypedDict

from flightid.errors import OptionError
from flightid.models.sampled.channels import OFFSETS

METHODS = ("moesp", "n4sid", "cva", "pbsid")
INITIAL_STATES = ("estimate", "zero")
LARGEST_ORDER = 50
LARGEST_HORIZON = 500


class SubspaceOptions(TypedDict, total=False):
    """Options of `SubspaceStructure` by name."""

    method: str
    horizon: int | None
    direct: bool
    refine: bool
    initial_state: str
    offsets: str
    maximum_order: int
    maximum_iterations: int


@dataclass(frozen=True)
class SubspaceStructure:
    """A state-space model in innovations form, for `identify`.

    Made by `InnovationsModel.subspace`.

    Attributes
    ----------
    outputs, inputs : tuple of str
    order : int or None
        Number of states; None: chosen from the singular values.
    method : str
        ``"moesp"`` (past outputs as instruments, PO-MOESP), ``"n4sid"``, ``"cva"`` (canonical
        variates) or ``"pbsid"`` (predictor-based, unbiased under feedback; needs noise).
    horizon : int or None
        Block rows of past and of future; None: 15, less where records are short.
    direct : bool
        Whether inputs act without delay (D).
    refine : bool
        Whether the subspace estimate is the start of a prediction-error fit, which gives intervals.
    initial_state : str
        State at the first sample of each record: ``"estimate"`` or ``"zero"``.
    offsets : str
        What is taken off each channel of each record: its ``"mean"``, its declared ``"trim"`` or
        nothing (``"none"``).
    maximum_order : int
        Largest order that the choice considers.
    maximum_iterations : int
        Of the prediction-error fit.

    Raises
    ------
    OptionError
        Options outside their range.

    Example
    -------
    >>> SubspaceStructure(("y",), ("u",), 2)
    SubspaceStructure(moesp, y from u, 2 states)
    """

    outputs: tuple[str, ...]
    inputs: tuple[str, ...]
    order: int | None = None
    method: str = "moesp"
    horizon: int | None = None
    direct: bool = False
    refine: bool = True
    initial_state: str = "estimate"
    offsets: str = "mean"
    maximum_order: int = 10
    maximum_iterations: int = 100

    def __post_init__(self) -> None:
        channels = [*self.outputs, *self.inputs]
        if len(set(channels)) < len(channels):
            raise OptionError("a channel is named twice", found=", ".join(channels))
        if not self.outputs or not self.inputs:
            raise OptionError("the model has no outputs or no inputs", found=", ".join(channels))
        choices = {"method": METHODS, "initial_state": INITIAL_STATES, "offsets": OFFSETS}
        for name, allowed in choices.items():
            if getattr(self, name) not in allowed:
                needed = ", ".join(allowed)
                raise OptionError(f"unknown {name}", found=getattr(self, name), needed=needed)
        limits = {
            "order": LARGEST_ORDER,
            "maximum_order": LARGEST_ORDER,
            "horizon": LARGEST_HORIZON,
            "maximum_iterations": 10_000,
        }
        for name, limit in limits.items():
            value = getattr(self, name)
            if value is not None and not 1 <= value <= limit:
                raise OptionError(
                    f"{name} is outside its range", found=value, needed=f"1 to {limit}"
                )
        if self.horizon is not None and self.horizon < self.least_horizon:
            raise OptionError(
                "the horizon is too short for the order",
                found=f"horizon {self.horizon}, order {self.order or self.maximum_order}",
                needed=f"a horizon of at least {self.least_horizon}",
                action="raise the horizon, or lower order or maximum_order",
            )

    @property
    def least_horizon(self) -> int:
        """Block rows that can tell the largest order."""
        largest = self.order or self.maximum_order
        return -(-largest // len(self.outputs)) + 1

    def n_parameters(self, order: int) -> int:
        """Number of independent parameters of a model with so many states."""
        p, m = len(self.outputs), len(self.inputs)
        return order * (2 * p + m) + (p * m if self.direct else 0)

    def __repr__(self) -> str:
        """Method, channels and order on one line."""
        states = "order by singular values" if self.order is None else f"{self.order} states"
        channels = f"{', '.join(self.outputs)} from {', '.join(self.inputs)}"
        return f"SubspaceStructure({self.method}, {channels}, {states})"
