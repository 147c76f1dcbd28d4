"""Edges of the orders that a scan tried."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from contextlib import suppress
from dataclasses import replace
from itertools import product
from typing import Any

from flightid.conventions import Light
from flightid.errors import OptionError
from flightid.findings import Finding
from flightid.models.innovations.structure import SubspaceStructure
from flightid.models.narx.structure import NarxStructure
from flightid.models.polynomial.structure import PolynomialStructure
from flightid.uncertainty.estimate import Estimate

Structure = PolynomialStructure | SubspaceStructure | NarxStructure
EDGE = "at-edge-of-scan"
DELAY = "delay-not-scanned"
ORDERS = ("na", "nb", "nc", "nd", "nf", "nk", "order", "output_lags", "input_lags")


def beyond_edges(taken: Structure, tried: Iterable[Structure]) -> dict[str, int]:
    """The next value of each order at an edge of several; delays have two, from one sample up.

    Structures of one family share the reach of their orders, whatever their kind.

    Example
    -------
    >>> from flightid.models import PolynomialModel
    >>> tried = [
    ...     PolynomialModel.oe("y", "u", nb=nb, nf=2, nk=nk) for nb in (1, 2, 3) for nk in (4, 5)
    ... ]
    >>> beyond_edges(tried[-2], tried)
    {'nb': 4, 'nk': 3}
    """
    alike = [each for each in tried if type(each) is type(taken)]
    found = {}
    for name in ORDERS:
        value = _value(taken, name)
        values = {held for each in alike if (held := _value(each, name)) is not None}
        if value is None or len(values) < 2:
            continue
        if value == max(values):
            found[name] = value + 1
        elif name == "nk" and value == min(values) and value > 1:
            found[name] = value - 1
    return found


def edge_findings(best: Structure, tried: Iterable[Structure]) -> tuple[Finding, ...]:
    """Amber where the best of a scan lies at an edge of it."""
    edges = ", ".join(name.replace("_", " ") for name in beyond_edges(best, tried))
    if not edges:
        return ()
    said = f"the best model has the last {edges} of the scan"
    return (Finding(EDGE, Light.AMBER, said, "scan higher orders and other delays"),)


def delay_findings(
    taken: Structure, parameters: Mapping[str, Estimate], tried: Iterable[Structure]
) -> tuple[Finding, ...]:
    """Amber where one delay alone was tried and the best's first coefficient of B may be zero.

    Without an interval it may be anything.
    """
    delays = {each.nk for each in tried if isinstance(each, PolynomialStructure)}
    if not isinstance(taken, PolynomialStructure) or len(delays) > 1:
        return ()
    late = []
    for i, (name, delay) in enumerate(zip(taken.inputs, taken.nk, strict=True)):
        place = taken.na + sum(taken.nb[:i])
        first = parameters[taken.names[place]].interval95
        if first is None or first[0] <= 0.0 <= first[1]:
            late.append(f"{name} (nk {delay})")
    if not late:
        return ()
    said = f"one delay alone was tried, and it may be longer: {', '.join(late)}"
    return (Finding(DELAY, Light.AMBER, said, "scan delays: nk=range(1, 6)"),)


def neighbours(taken: Structure, further: dict[str, int]) -> list[Structure]:
    """The structure itself, then those with some of the further orders that there can be."""
    made: list[Structure] = []
    for chosen in product(*((False, True) for _ in further)):
        moved: dict[str, Any] = {
            name: _like(getattr(taken, name), value)
            for (name, value), is_moved in zip(further.items(), chosen, strict=True)
            if is_moved
        }
        if isinstance(taken, PolynomialStructure):
            moved["start"] = ()
        with suppress(OptionError):
            made.append(replace(taken, **moved))
    return made


def _value(structure: Structure, name: str) -> int | None:
    held = getattr(structure, name, None)
    value = held[0] if isinstance(held, tuple) and held else held
    return value if isinstance(value, int) else None


def _like(held: object, value: int) -> int | tuple[int, ...]:
    return (value,) * len(held) if isinstance(held, tuple) else value
