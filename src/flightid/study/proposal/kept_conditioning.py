"""Steps of ``[[conditioning]]`` that a proposal keeps: its trials see the records behind them."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from flightid.frozen import dataclass
from flightid.models.save import toml_value
from flightid.study.conditioning import Conditioning, read_conditioning
from flightid.study.proposal.stretches import Segments, Stretch
from flightid.study.reading import TableReader


@dataclass(frozen=True, eq=False)
class KeptConditioning:
    """Tables as they are asked for, whose `records` are manoeuvres, ``FILE: MANOEUVRE``.

    A proposal cuts manoeuvres into records of its own, so that nobody can know their names before.

    Attributes
    ----------
    asked : tuple of mapping
    """

    asked: tuple[Mapping[str, Any], ...] = ()

    def tables(self, named: Sequence[tuple[str, Stretch]]) -> Iterator[dict[str, Any]]:
        """Tables with records by name; those whose manoeuvres are in none of them are left out."""
        for table in self.asked:
            meant = table.get("records")
            names = [name for name, part in named if meant and place_of(part) in meant]
            if names or not meant:
                yield {**table, "records": names} if names else dict(table)

    def steps(self, segments: Segments) -> tuple[Conditioning, ...]:
        """What is carried out on the records of a group.

        Raises
        ------
        StudyError
            A key is unknown or a value does not fit.
        """
        named = [(name, part) for name, part, _ in segments.all]
        where = "[[conditioning]]"
        return tuple(read_conditioning(TableReader(t, where)) for t in self.tables(named))

    def lines(self, named: Sequence[tuple[str, Stretch]]) -> Iterator[str]:
        """Tables of the study."""
        for table in self.tables(named):
            yield from ("", "[[conditioning]]")
            yield from (f"{key} = {toml_value(value)}" for key, value in table.items())


def place_of(part: Stretch) -> str:
    """A manoeuvre by its file and its name there."""
    return f"{part.path.name}: {part.record.name}"
