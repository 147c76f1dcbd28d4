"""The content tree: what a report says, before anyone decides how it looks.

A `Document` holds sections, a section holds blocks, and every number stands in exactly one block.
`report.text`, `report.html` and `report.json` each draw the whole tree. A column of a table is made
where its result is: in the result's own `summary()`, one `Column` and its cells; all three follow.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import field
from typing import Any

from flightid.conventions import Light
from flightid.findings import Finding, worst
from flightid.frozen import dataclass
from flightid.table import Cell, Table


@dataclass(frozen=True)
class Paragraph:
    """Sentences for people.

    Attributes
    ----------
    text : str
        Plain text; nothing in it is markup.
    """

    text: str


@dataclass(frozen=True)
class Lights:
    """Verdicts against guidelines.

    Attributes
    ----------
    findings : tuple of Finding
        One light each.
    title : str
        What was judged.
    repeats : bool
        They sum up verdicts that stand elsewhere in the report, and are not counted again.
    """

    findings: tuple[Finding, ...]
    title: str = ""
    repeats: bool = False


@dataclass(frozen=True)
class TableBlock:
    """A table.

    Attributes
    ----------
    table : Table
        Title, columns, rows, notes.
    folded : bool
        Long and rarely read: HTML shows its title and opens it on demand.
    """

    table: Table
    folded: bool = False


@dataclass(frozen=True)
class KeyValues:
    """Named single values, such as options or hashes.

    Attributes
    ----------
    items : tuple of (str, Cell)
        Names, units included, and values.
    title : str
        What they describe.
    """

    items: tuple[tuple[str, Cell], ...]
    title: str = ""


@dataclass(frozen=True)
class Figure:
    """A picture.

    Attributes
    ----------
    spec : mapping
        Plain values of a figure as plotly.js takes it: ``data`` and ``layout``.
    caption : str
        What to see in it; text output shows this alone.
    folded : bool
        One of many, or a detail: HTML shows its caption and opens it on demand.
    """

    spec: Mapping[str, Any]
    caption: str
    folded: bool = False

    @property
    def series(self) -> tuple[str, ...]:
        """Names of the series shown, each once, in order."""
        names = (str(trace["name"]) for trace in self.spec.get("data", ()) if trace.get("name"))
        return tuple(dict.fromkeys(names))


Block = Paragraph | Lights | TableBlock | KeyValues | Figure


@dataclass(frozen=True)
class Section:
    """A titled part of a report.

    Attributes
    ----------
    title : str
        Heading.
    blocks : tuple of Block
        Content in order.
    sections : tuple of Section
        Parts below, after the blocks.
    """

    title: str
    blocks: tuple[Block, ...] = ()
    sections: tuple[Section, ...] = ()

    def walk(self) -> Iterator[Block]:
        """Every block of this section and the sections below, in order."""
        yield from self.blocks
        for section in self.sections:
            yield from section.walk()


@dataclass(frozen=True)
class Document:
    """A whole report.

    Attributes
    ----------
    title : str
        Title.
    subtitle : str
        One line below it: which aircraft, which log.
    sections : tuple of Section
        Content in order.
    footer : str
        One line at the end: what made this, and when.
    counted : str
        What is counted where it is not verdicts alike: ``"9 vehicles not judged"``.

    Example
    -------
    >>> light = Lights((Finding("fit", Light.AMBER, "cost 130", "use a longer record"),))
    >>> Document("Roll rate", "quadrotor", (Section("Verdicts", (light,)),)).verdict.value
    'amber'
    """

    title: str
    subtitle: str
    sections: tuple[Section, ...]
    footer: str = field(default="")
    counted: str = field(default="")

    def walk(self) -> Iterator[Block]:
        """Every block, in order."""
        for section in self.sections:
            yield from section.walk()

    @property
    def findings(self) -> tuple[Finding, ...]:
        """Every verdict, in order, those that only repeat others left out."""
        return tuple(
            finding
            for block in self.walk()
            if isinstance(block, Lights) and not block.repeats
            for finding in block.findings
        )

    @property
    def verdict(self) -> Light:
        """The worst light."""
        return worst(self.findings)

    def count(self, light: Light) -> int:
        """Number of verdicts of one light."""
        return sum(finding.light is light for finding in self.findings)

    @property
    def tally(self) -> str:
        """Verdicts counted, for example ``"3 green, 1 amber"``; empty where nothing was judged."""
        if self.counted:
            return self.counted
        order = (Light.GREEN, Light.AMBER, Light.RED, Light.UNKNOWN)
        return ", ".join(
            f"{self.count(light)} {light.words}" for light in order if self.count(light)
        )
