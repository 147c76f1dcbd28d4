"""Initial states and biases of a model that each record has for itself."""

from __future__ import annotations

import math

from flightid.errors import ModelError
from flightid.frozen import dataclass
from flightid.models.language.reading import read_number, require_keys


@dataclass(frozen=True)
class RecordValue:
    """A number that a fit in the time domain may free in each record.

    Attributes
    ----------
    value : float
        Start, or the value itself where it is not free; in the unit of its state or channel.
    minimum, maximum : float
        Bounds.
    free : bool
        Whether each record has its own.

    Raises
    ------
    ModelError
        Bounds that contradict each other or the value.

    Example
    -------
    >>> RecordValue(0.0, -0.1, 0.1)
    RecordValue(value=0.0, minimum=-0.1, maximum=0.1, free=True)
    """

    value: float = 0.0
    minimum: float = -math.inf
    maximum: float = math.inf
    free: bool = True

    def __post_init__(self) -> None:
        if not math.isfinite(self.value) or not self.minimum <= self.value <= self.maximum:
            raise ModelError(
                "a number of each record lies outside its bounds",
                found=f"{self.value:g} in [{self.minimum:g}, {self.maximum:g}]",
                needed="min ≤ value ≤ max, finite value",
            )

    def to_dict(self) -> dict[str, object]:
        """Plain values; an open bound is left out."""
        bounds = {"min": self.minimum, "max": self.maximum}
        kept = {key: bound for key, bound in bounds.items() if math.isfinite(bound)}
        return {"value": self.value, **kept, "free": self.free}


def read_record_value(subject: str, item: object) -> RecordValue:
    """A number of each record from its table, or from its value alone (then not free).

    Raises
    ------
    ModelError
        A key is unknown or of the wrong type, or the numbers contradict each other.
    """
    if not isinstance(item, dict):
        return RecordValue(read_number(item, subject), free=False)
    require_keys(item, {"value", "min", "max", "free"}, subject)
    free = item.get("free", True)
    if not isinstance(free, bool):
        raise ModelError(f"{subject}.free must be true or false", found=repr(free)[:80])
    return RecordValue(
        read_number(item.get("value", 0.0), f"{subject}.value"),
        read_number(item.get("min", -math.inf), f"{subject}.min"),
        read_number(item.get("max", math.inf), f"{subject}.max"),
        free,
    )
