"""Records of a study by name, and groups of them that one name stands for."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field

from flightid.record import Record


@dataclass(frozen=True, eq=False)
class Flown(Mapping[str, Record]):
    """Conditioned records.

    Attributes
    ----------
    by_name : mapping of str to Record
    groups : mapping of str to tuple of str
        Names of the records that the name of a group stands for.

    Example
    -------
    >>> first, second = (Record.from_arrays([0.0, 0.1], outputs={"y": [y, 0.0]}) for y in (1, 2))
    >>> flown = Flown({"a": first, "b": second}, {"both": ("a", "b")})
    >>> len(flown.of(["both"])), len(flown.of(["a"])), list(flown)
    (2, 1, ['a', 'b'])
    """

    by_name: Mapping[str, Record]
    groups: Mapping[str, tuple[str, ...]] = field(default_factory=dict)

    def of(self, names: Iterable[str]) -> list[Record]:
        """Records of these names, those of groups one after the other."""
        return [self.by_name[member] for name in names for member in self.groups.get(name, (name,))]

    def __getitem__(self, name: str) -> Record:
        """One record by its own name."""
        return self.by_name[name]

    def __iter__(self) -> Iterator[str]:
        """Names of all records."""
        return iter(self.by_name)

    def __len__(self) -> int:
        """Number of records."""
        return len(self.by_name)
