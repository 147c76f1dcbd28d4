"""One denominator for all inputs of an OE or BJ model, or one each: what the data prefer."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from flightid.conventions import Light
from flightid.findings import Finding
from flightid.identification.prediction_error.coefficient_covariance import SearchResult
from flightid.identification.prediction_error.likelihoods import coloured_cost
from flightid.models.polynomial.structure import PolynomialStructure
from flightid.models.sampled.channels import SampledChannels

WEAK = 2.0
"""Differences of BIC below this are worth no more than a bare mention."""
Ended = tuple[PolynomialStructure, SearchResult]


def preferred(ends: Sequence[Ended], data: SampledChannels) -> tuple[Ended, tuple[Finding, ...]]:
    """The fit with the smallest BIC, and what to say of the choice.

    The likelihood is that of the prediction errors with their colour taken out, since output error
    leaves noise of any colour. What stands for the time before each record weighs as in Akaike's
    criterion: more samples tell no more of it.

    Parameters
    ----------
    ends : sequence of (PolynomialStructure, SearchResult)
        Fits of alternatives to the same records.
    data : SampledChannels

    Reference
    ---------
    Ljung, *System Identification*, 2nd ed., section 16.4; Kass & Raftery (1995), Bayes factors, J.
    American Statistical Association 90, section 3.2 (differences below 2).
    """
    if len(ends) == 1:
        return ends[0], ()
    costs = [_bic(structure, data, found) for structure, found in ends]
    first, second = np.argsort(costs)[:2]
    best, gap = ends[first], costs[second] - costs[first]
    said = {True: "one denominator for all inputs", False: "a denominator for each input"}
    finding = Finding(
        "denominators-chosen",
        Light.AMBER if gap < WEAK else Light.GREEN,
        f"{said[best[0].is_common]}: its BIC is {gap:.3g} below that of "
        f"{said[not best[0].is_common]}",
        "say denominators, or compare both on unseen records" if gap < WEAK else "",
    )
    return best, (finding,)


def _bic(structure: PolynomialStructure, data: SampledChannels, found: SearchResult) -> float:
    cost, n = coloured_cost(structure, data, found.theta, found.memory, found.skip)
    counted = sum(length - found.skip for length in data.lengths)
    before = counted - found.degrees - structure.n_parameters
    return cost + structure.n_parameters * math.log(n) + 2 * before
