"""Scans that go on where what a rule takes lies at the edge of the orders that were tried."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace

from flightid.conventions import Light
from flightid.evidence import Check
from flightid.evidence.evidence import GUIDELINES
from flightid.evidence.gather import worse
from flightid.findings import Finding
from flightid.identification import Fit
from flightid.identification.withheld_intervals import without_intervals
from flightid.validation import OrderScan
from flightid.validation.order_scan.result import OrderTrial, Structure, rank_of

Orders = Mapping[str, tuple[int, ...]]
EDGE = "at-edge-of-scan"
ROUNDS = 4
"""Of neighbours beyond the edges; each fits two to the number of edges, the taken one again."""
CLEAR = 6.0
"""Gain of BIC that says a model is better: odds of 1 to 20."""


def beyond_edges(structure: Structure, tried: Orders) -> dict[str, int]:
    """The next value of each order at an edge of several; delays have two, from one sample up.

    Example
    -------
    >>> from flightid.models import PolynomialModel
    >>> taken = PolynomialModel.oe("y", "u", nb=3, nf=2, nk=4)
    >>> beyond_edges(taken, {"nb": (1, 2, 3), "nf": (1, 2, 3), "nk": (4, 5)})
    {'nb': 4, 'nk': 3}
    """
    found = {}
    for name, values in tried.items():
        held = getattr(structure, name, None)
        value = held[0] if isinstance(held, tuple) and held else held
        if not isinstance(value, int) or len(values) < 2:
            continue
        if value == max(values):
            found[name] = value + 1
        elif name == "nk" and value == min(values) and value > 1:
            found[name] = value - 1
    return found


def widened(
    scan: OrderScan,
    tried: Orders,
    taken: Callable[[OrderScan], OrderTrial],
    run: Callable[[Orders], OrderScan],
) -> tuple[OrderScan, tuple[Finding, ...]]:
    """Go on past the edges by one until what is taken lies inside, or a few rounds are over.

    Parameters
    ----------
    scan : OrderScan
    tried : mapping of str to tuple of int
    taken : callable
        What a rule takes of a scan.
    run : callable
        A scan of other orders of the same records.

    Returns
    -------
    tuple of OrderScan and tuple of Finding
        All trials; amber where a neighbour that the rule does not take fits clearly better, or
        the last round still ends at an edge.
    """
    reach = {name: set(values) for name, values in tried.items()}
    for _ in range(ROUNDS):
        best = taken(scan).structure
        further = beyond_edges(best, {name: tuple(values) for name, values in reach.items()})
        if not further:
            return scan, ()
        more = run({name: _around(best, name, further.get(name)) for name in tried})
        for name, value in further.items():
            reach[name].add(value)
        scan = joined(scan, more)
        if _same(taken(scan).structure, best):
            return scan, _better(best, further, more)
    further = beyond_edges(taken(scan).structure, {k: tuple(v) for k, v in reach.items()})
    said = f"after {ROUNDS} rounds of higher orders the best still has the last {_named(further)}"
    return scan, (_finding(said),) if further else ()


def joined(scan: OrderScan, more: OrderScan) -> OrderScan:
    """The trials of both, ranked together."""
    known = {(each.kind, each.structure.orders_text) for each in scan.trials}
    new = [t for t in more.trials if (t.kind, t.structure.orders_text) not in known]
    first = scan.trials[0]
    best = scan.best if not new or rank_of(first) <= rank_of(new[0]) else more.best
    return replace(scan, trials=tuple(sorted([*scan.trials, *new], key=rank_of)), best=best)


def doubted(fit: Fit, findings: tuple[Finding, ...]) -> Fit:
    """The fit with these findings in its evidence, and without intervals where there are any."""
    for each in findings:
        check = Check(GUIDELINES, each.light, each.message, each.action)
        evidence = fit.evidence.with_checks([worse(fit.evidence.check(GUIDELINES), check)])
        bare = without_intervals(fit, each.message)
        fit = replace(bare, findings=(*bare.findings, each), evidence=evidence)
    return fit


def _around(structure: Structure, name: str, further: int | None) -> tuple[int, ...]:
    held = getattr(structure, name)
    value = held[0] if isinstance(held, tuple) else held
    return (value,) if further is None else tuple(sorted((value, further)))


def _same(one: Structure, other: Structure) -> bool:
    return (one.kind, one.orders_text) == (other.kind, other.orders_text)


def _better(best: Structure, further: Mapping[str, int], more: OrderScan) -> tuple[Finding, ...]:
    """What neighbours beyond the edges would gain."""
    known = {
        each.structure.orders_text: each.criteria.bic
        for each in more.trials
        if each.criteria is not None and each.criteria.bic is not None and each.settled
    }
    own = known.pop(best.orders_text, None)
    if own is None or not known or own - min(known.values()) <= CLEAR:
        return ()
    orders, least = min(known.items(), key=lambda each: each[1])
    said = f"{orders}, beyond the scan's last {_named(further)}, fits better: BIC falls by "
    return (_finding(f"{said}{own - least:.3g}, though free runs do not take it"),)


def _named(further: Mapping[str, int]) -> str:
    return " and ".join(further)


def _finding(said: str) -> Finding:
    action = "scan higher orders and other delays, or fit a noise model (Box-Jenkins)"
    return Finding(EDGE, Light.AMBER, f"{said}: dynamics may be missing", action)
