"""What the starts of a search found."""

from __future__ import annotations

from collections.abc import Mapping

from flightid.frozen import dataclass


@dataclass(frozen=True)
class LocalMinimum:
    """A minimum that one or more starts found.

    Attributes
    ----------
    objective : float
        What was minimised, there.
    count : int
        Number of starts that ended there.
    values : mapping of str to float
        Free parameters there.
    termination : str
        Why the iteration ended.

    Example
    -------
    >>> LocalMinimum(12.5, 3, {"K": 2.0}, "cost").count
    3
    """

    objective: float
    count: int
    values: Mapping[str, float]
    termination: str

    def to_dict(self) -> dict[str, object]:
        """Plain values."""
        return {
            "objective": self.objective,
            "count": self.count,
            "values": dict(self.values),
            "termination": self.termination,
        }
