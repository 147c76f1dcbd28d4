"""Scans that go on where what a rule takes lies at the edge of the orders that were tried."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from typing import TypeVar

from flightid.conventions import Light
from flightid.evidence import Check
from flightid.evidence.evidence import GUIDELINES
from flightid.evidence.gather import worse
from flightid.findings import Finding
from flightid.identification import Fit
from flightid.identification.withheld_intervals import without_intervals
from flightid.validation.order_scan.edges import EDGE, Structure, beyond_edges, neighbours
from flightid.validation.order_scan.result import OrderTrial

Scan = TypeVar("Scan")
ROUNDS = 4
"""Of neighbours beyond the edges; each fits two to the number of edges, the taken one again."""
CLEAR = 6.0
"""Gain of BIC or AICc that says a model is better: odds of 1 to 20."""


def widened(
    scan: Scan,
    tried: Callable[[Scan], Iterable[Structure]],
    taken: Callable[[Scan], Structure],
    further: Callable[[Scan, list[Structure]], tuple[Scan, Sequence[OrderTrial]]],
) -> tuple[Scan, tuple[Finding, ...]]:
    """Go on past the edges by one until what is taken lies inside, or a few rounds are over.

    Parameters
    ----------
    scan : OrderScan, NarxSearch or Fit
    tried : callable
        Structures that it tried.
    taken : callable
        What a rule takes of it.
    further : callable
        It with further structures, and their trials where information criteria compare them.

    Returns
    -------
    tuple of scan and tuple of Finding
        All trials; amber where a neighbour that the rule does not take fits clearly better, or
        the last round still ends at an edge.
    """
    for _ in range(ROUNDS):
        best = taken(scan)
        edges = beyond_edges(best, tried(scan))
        if not edges:
            return scan, ()
        made = neighbours(best, edges)
        if len(made) == 1:
            break
        scan, more = further(scan, made)
        if _same(taken(scan), best):
            return scan, _better(best, edges, more)
    edges = beyond_edges(taken(scan), tried(scan))
    said = f"the best still has the last {_named(edges)} of the orders that were tried"
    return scan, (_finding(said),) if edges else ()


def doubted(fit: Fit, findings: tuple[Finding, ...]) -> Fit:
    """The fit with these findings in its evidence, and without intervals where there are any."""
    for each in findings:
        check = Check(GUIDELINES, each.light, each.message, each.action)
        evidence = fit.evidence.with_checks([worse(fit.evidence.check(GUIDELINES), check)])
        bare = without_intervals(fit, each.message)
        told = [known for known in bare.findings if known.code != each.code]
        fit = replace(bare, findings=(*told, each), evidence=evidence)
    return fit


def _same(one: Structure, other: Structure) -> bool:
    return (one.kind, one.orders_text) == (other.kind, other.orders_text)


def _better(
    best: Structure, further: Mapping[str, int], more: Sequence[OrderTrial]
) -> tuple[Finding, ...]:
    """What neighbours beyond the edges would gain."""
    known = {
        each.structure.orders_text: each.likelihood.bic
        for each in more
        if each.likelihood is not None and each.likelihood.bic is not None and each.settled
    }
    own = known.pop(best.orders_text, None)
    if own is None or not known or own - min(known.values()) <= CLEAR:
        return ()
    orders, least = min(known.items(), key=lambda each: each[1])
    said = f"{orders}, beyond the scan's last {_named(further)}, fits better: BIC falls by "
    return (_finding(f"{said}{own - least:.3g}, though free runs do not take it"),)


def _named(further: Mapping[str, int]) -> str:
    return " and ".join(name.replace("_", " ") for name in further)


def _finding(said: str) -> Finding:
    action = "scan higher orders and other delays, or fit a noise model (Box-Jenkins)"
    return Finding(EDGE, Light.AMBER, f"{said}: dynamics may be missing", action)
