"""What a scan of every kind tries beside ARX, ARMAX and OE: BJ, subspace models and NARX."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import product

from flightid.models.innovations.model import InnovationsModel
from flightid.models.innovations.structure import SubspaceStructure
from flightid.models.narx.structure import SIMULATION, NarxStructure
from flightid.models.polynomial.structure import PolynomialStructure
from flightid.validation.order_scan.result import OrderTrial, Range, rank_of, whole_numbers

SEARCHED = ("arx", "armax", "oe")
"""Kinds whose orders are all tried."""


def _best(trials: Sequence[OrderTrial], kinds: Sequence[str]) -> PolynomialStructure | None:
    """Structure of these kinds with the least error in free run."""
    found = [
        (rank_of(trial), place)
        for place, trial in enumerate(trials)
        if trial.free_run_rms is not None and trial.kind in kinds
    ]
    best = trials[min(found)[1]].structure if found else None
    return best if isinstance(best, PolynomialStructure) else None


def box_jenkins_of(
    trials: Sequence[OrderTrial], orders: Mapping[str, Range]
) -> list[PolynomialStructure]:
    """BJ at the best OE's orders: a free run does not see the noise model, only what it leaves."""
    best = _best(trials, ["OE"])
    if best is None:
        return []
    noise = product(*(whole_numbers(name, orders[name]) for name in ("nc", "nd")))
    return [replace(best, nc=nc, nd=nd, start=()) for nc, nd in noise]


def subspace_of(structures: Sequence[PolynomialStructure]) -> list[SubspaceStructure]:
    """Subspace models of every order up to that of the polynomials with their delays."""
    first = structures[0]
    largest = max(max(s.na, *s.nf) for s in structures) + max(max(s.nk) for s in structures) - 1
    return [
        InnovationsModel.subspace(
            first.inputs,
            first.output,
            order=order,
            offsets=first.offsets,
            enforce_stability=first.enforce_stability,
        )
        for order in range(1, max(largest, 1) + 1)
    ]


def narx_of(trials: Sequence[OrderTrial], lags: Sequence[int]) -> list[NarxStructure]:
    """NARX models with as many lags of the output as of each input, after the best delay."""
    best = _best(trials, ["ARX", "ARMAX", "OE", "BJ"])
    if best is None:
        return []
    return [
        NarxStructure(best.inputs, best.output, lag, lag, delay=min(best.nk), focus=SIMULATION)
        for lag in lags
        if lag
    ]
