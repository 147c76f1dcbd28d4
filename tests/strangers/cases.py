"""All conditions: `CASES`, and `LIGHTS` whose light alone is counted, of every module here."""

from __future__ import annotations

import importlib
import pkgutil

import tests.strangers
from tests.strangers.counting import Case


def _found(kind: str) -> tuple[Case, ...]:
    cases: list[Case] = []
    for module in sorted(item.name for item in pkgutil.iter_modules(tests.strangers.__path__)):
        if module not in ("cases", "coverage_page", "__main__"):
            family = importlib.import_module(f"tests.strangers.{module}")
            cases += getattr(family, kind, ())
    return tuple(cases)


CASES, LIGHTS = _found("CASES"), _found("LIGHTS")


def families() -> tuple[tuple[str, tuple[Case, ...]], ...]:
    """Conditions by module: the first sentence of its words, and its cases and lights."""
    found = []
    for module in sorted(item.name for item in pkgutil.iter_modules(tests.strangers.__path__)):
        if module in ("cases", "coverage_page", "__main__"):
            continue
        family = importlib.import_module(f"tests.strangers.{module}")
        cases = (*getattr(family, "CASES", ()), *getattr(family, "LIGHTS", ()))
        if cases:
            title = " ".join((family.__doc__ or module).split("\n\n")[0].split())
            found.append((title.split(": `")[0].split("; ")[0].rstrip("."), cases))
    return tuple(found)
