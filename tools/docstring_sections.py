"""Section names of our doc strings as the site's reader knows them (an extension of griffe).

We write ``Example`` and ``Reference`` in the singular; the reader takes the plural for a section
and would show anything else as running text.
"""

from __future__ import annotations

import re
from typing import Any

import griffe

EXAMPLE = "Examples\n--------\n"
PLURALS = {"Example": "Examples", "Reference": "References"}
HEADING = re.compile(r"^(Example|Reference)\n-+$", re.MULTILINE)


def known(document: str) -> str:
    """Doc string with the headings that the reader knows."""

    def plural(match: re.Match[str]) -> str:
        name = PLURALS[match.group(1)]
        return f"{name}\n{'-' * len(name)}"

    text = HEADING.sub(plural, document)
    if EXAMPLE not in text:  # an example that stands in the text
        text = re.sub(r"\n\n(?=>>> )", f"\n\n{EXAMPLE}", text, count=1)
    return text


class DocstringSections(griffe.Extension):
    """Renames sections before doc strings are read."""

    def on_object(self, *, obj: griffe.Object, **kwargs: Any) -> None:  # noqa: ANN401
        """Rename the sections of one object."""
        del kwargs
        if obj.docstring:
            obj.docstring.value = known(obj.docstring.value)


class FrozenClasses(griffe.Extension):
    """Shows constructors of classes by `flightid.frozen` as those of dataclasses."""

    def on_class_instance(self, *, cls: griffe.Class, **kwargs: Any) -> None:  # noqa: ANN401
        """Call our decorator by the name that the reader knows."""
        del kwargs
        for decorator in cls.decorators:
            for part in _names(decorator.value):
                if part.canonical_path == "flightid.frozen.dataclass":
                    part.parent = None
                    part.name = "dataclasses.dataclass"


def _names(value: object) -> list[griffe.ExprName]:
    found = value.function if isinstance(value, griffe.ExprCall) else value
    return [found] if isinstance(found, griffe.ExprName) else []
