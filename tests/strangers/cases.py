"""All conditions: `CASES` of every module in this folder that has them."""

from __future__ import annotations

import importlib
import pkgutil

import tests.strangers
from tests.strangers.counting import Case


def _found() -> tuple[Case, ...]:
    cases: list[Case] = []
    for module in sorted(item.name for item in pkgutil.iter_modules(tests.strangers.__path__)):
        if module not in ("cases", "__main__"):
            family = importlib.import_module(f"tests.strangers.{module}")
            cases += getattr(family, "CASES", ())
    return tuple(cases)


CASES = _found()
