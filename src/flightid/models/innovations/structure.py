"""What subspace identification is asked for: channels, order and options."""

from __future__ import annotations

from typing import TypedDict

from flightid.errors import OptionError
from flightid.frozen import dataclass
from flightid.models.polynomial.structure import INITIAL_STATES
from flightid.models.sampled.channels import OFFSETS
from flightid.options import Options, option

METHODS = ("moesp", "n4sid", "cva", "pbsid")
LARGEST_ORDER = 50
LARGEST_HORIZON = 500


class SubspaceOptions(TypedDict, total=False):
    """Options of `SubspaceStructure` by name."""

    method: str
    horizon: int | None
    direct: bool | None
    refine: bool
    enforce_stability: bool
    initial_state: str
    offsets: str
    maximum_order: int
    maximum_iterations: int


@dataclass(frozen=True)
class SubspaceStructure(Options):
    """A state-space model in innovations form, for `identify`.

    Made by `InnovationsModel.subspace`.

    Attributes
    ----------
    outputs, inputs : tuple of str
    order : int or None
        Number of states; None: chosen by free run on the last third of each record, kept for it.
    method : str
        ``"moesp"`` (past outputs as instruments, PO-MOESP), ``"n4sid"``, ``"cva"`` (canonical
        variates) or ``"pbsid"`` (predictor-based, unbiased under feedback; needs noise).
    horizon : int or None
        Block rows of past and of future; None: 15, less where records are short.
    direct : bool or None
        Whether inputs act without delay (D); None: by the data.
    refine : bool
        Whether the subspace estimate is the start of a prediction-error fit, which gives intervals.
    enforce_stability : bool
        Poles outside the unit circle are moved inside. A stable estimate stays stable in any case.
    initial_state : str
        State at the first sample of each record: ``"estimate"`` or ``"zero"``.
    offsets : str
        What is taken off each channel of each record: its ``"mean"``, its declared ``"trim"`` or
        nothing (``"none"``). Beside means a constant of each record is fitted, but not
        with ``"mean_as_trim"``.
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
    order: int | None = option(
        None, minimum=1, maximum=LARGEST_ORDER, doc="States; default: by free run on a third kept."
    )
    method: str = option("moesp", choices=METHODS, doc="How the subspace is weighed.")
    horizon: int | None = option(
        None, unit="samples", minimum=1, maximum=LARGEST_HORIZON, doc="Block rows; default: 15."
    )
    direct: bool | None = option(None, doc="Inputs act without delay; default: by the data.")
    refine: bool = option(True, doc="A prediction-error fit follows, which gives intervals.")
    enforce_stability: bool = option(False, doc="Poles outside the unit circle are moved inside.")
    initial_state: str = option(
        "estimate", choices=INITIAL_STATES, doc="State at the first sample of each record."
    )
    offsets: str = option(
        "mean", choices=OFFSETS, doc="What is taken off each channel of each record."
    )
    maximum_order: int = option(
        10, minimum=1, maximum=LARGEST_ORDER, doc="Largest order that the choice considers."
    )
    maximum_iterations: int = option(
        100, minimum=1, maximum=10_000, doc="Most steps of the prediction-error fit."
    )

    @property
    def kind(self) -> str:
        """Its kind in a table of several."""
        return "subspace"

    @property
    def orders_text(self) -> str:
        """Its order in words."""
        return "order by free run" if self.order is None else f"order {self.order}"

    def __post_init__(self) -> None:
        channels = [*self.outputs, *self.inputs]
        if len(set(channels)) < len(channels):
            raise OptionError("a channel is named twice", found=", ".join(channels))
        if not self.outputs or not self.inputs:
            raise OptionError("the model has no outputs or no inputs", found=", ".join(channels))
        super().__post_init__()
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
        states = "order by the data" if self.order is None else f"{self.order} states"
        channels = f"{', '.join(self.outputs)} from {', '.join(self.inputs)}"
        return f"SubspaceStructure({self.method}, {channels}, {states})"
