"""What one kind of model adds to a fit: the base of the kinds' own."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import field
from typing import Any, Self

from flightid.frozen import dataclass
from flightid.table import Table
from flightid.uncertainty.estimate import Estimate


@dataclass(frozen=True, eq=False)
class Details:
    """Base of what hangs on a `Fit` by composition; alone it adds nothing.

    Attributes
    ----------
    spent : tuple of int
        Parameters that shaped the residuals' own past, and their relation to one input.
    undetermined : str
        Why some numbers of the vehicle have no errors while others have: nothing computed from all
        of them has an interval then. Empty where all are known.
    """

    spent: tuple[int, int] = field(default=(0, 0), kw_only=True)
    undetermined: str = field(default="", kw_only=True)

    @property
    def words(self) -> str:
        """A few words for the fit's line; empty for none."""
        return ""

    def quantities(self, parameters: Mapping[str, Estimate]) -> Sequence[Estimate]:
        """Numbers that the fit's table lists."""
        return tuple(parameters.values())

    def without_intervals(self, reason: str) -> Self:  # noqa: ARG002 - each kind's own
        """The same without error bars of numbers that the fit's parameters have none of."""
        return self

    def notes(self, structure: Any) -> tuple[str, ...]:  # noqa: ANN401, ARG002 - each kind's own
        """Lines below the fit's table."""
        return ()

    def tables(self) -> tuple[Table, ...]:
        """Tables beside the fit's own."""
        return ()

    def to_dict(self) -> dict[str, object]:
        """Plain values."""
        return {}
