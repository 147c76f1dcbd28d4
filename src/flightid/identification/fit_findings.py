"""Verdicts on a fit against the published guides, each with what to do."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TypeVar

import numpy as np
import scipy
from numpy.typing import NDArray

from flightid.conventions import Light
from flightid.evidence.gather import (
    CONVERGED,
    CORRELATED,
    CRAMER_RAO,
    INSENSITIVE,
    MINIMUM_DOUBTED,
    MORE_STEPS,
    NOISE_KNOWN,
)
from flightid.findings import Finding, told_apart
from flightid.frozen import dataclass
from flightid.identification.multistart import End
from flightid.uncertainty.estimate import Estimate
from flightid.uncertainty.influence import NEXT

Group = TypeVar("Group", bound=Sequence[End])

APPROXIMATE = "random error"
UNKNOWN = "nothing"
"""Where intervals come from that are rough, or are not there."""
CRAMER_RAO_GUIDE_PERCENT = 20.0
INSENSITIVITY_GUIDE_PERCENT = 10.0
CORRELATION_GUIDE = 0.98
AVERAGE_COST_GUIDE = 100.0
EXCELLENT_COST = 50.0
SINGLE_COST_GUIDE = 150.0
SINGLE_COST_LIMIT = 200.0
"""Tischler & Remple, 2nd ed., §12.2.5, §12.3.4 and §13.7."""
MISFIT_GUIDE = 25.0
"""Half of what is nearly indistinguishable, where noise explains none of it."""
MISFIT_RATIO = 2.0
"""Times what noise explains: its own size is an estimate."""
FAR_RATIO = 100.0
"""Times what noise explains from which a misfit that is seen makes the fit red."""
CERTAIN_RATIO = 4.0
"""Times what noise explains from which no interval by noise holds: its bars are half too short."""
CERTAIN = 1e-6
"""Chance of such a cost by noise below which the structure is at fault."""
CHANCE = 0.01
"""Share of flights of a model that is right whose noise costs more than noise explains."""

MISSED_ACTION = "look for missing dynamics, a wrong hold, responses that stand out, more starts"
"""What to do where a model misses what the data show."""
STARTS_FIRST = "try more starts first (starts = 16), or start values from equation error"
"""What to do about a cost of responses: it costs least, and a wrong minimum looks like the rest."""

_NEAR_COST = 1.1
DETERMINED = 0.2
"""Half-width of a 95 % interval, as a share of the value, below which the data do determine it."""


@dataclass(frozen=True)
class NoiseCost:
    """Mean and deviation of the cost that random errors alone give a model that is right.

    Example
    -------
    >>> NoiseCost(100.0, 20.0).explains(120.0), NoiseCost(10.0, 2.0).explains(42.0)
    (True, False)
    """

    mean: float
    deviation: float

    def explains(self, cost: float) -> bool:
        """Whether chance gives as large a cost in more than one of a hundred flights."""
        return self.chance(cost) > CHANCE

    def chance(self, cost: float) -> float:
        """Share of flights of a model that is right whose noise costs as much or more."""
        if not (self.mean > 0.0 and self.deviation > 0.0):
            return 0.0
        # A sum of squares of few independent parts: chi-square of the same mean and variance.
        scale = self.deviation**2 / (2.0 * self.mean)
        return float(scipy.special.chdtrc(self.mean / scale, cost / scale))


def judge_cost(
    costs: Mapping[str, float], average: float, noise: Mapping[str, NoiseCost] | None = None
) -> list[Finding]:
    """Verdicts on the costs beside what noise explains: their average, and each that stands out.

    Parameters
    ----------
    costs : mapping of str to float
        By response.
    average : float
    noise : mapping of str to NoiseCost, optional
        By response, where errors are known.
    """
    known = noise or {}
    found = [_judge_average(average, _averaged(known), withheld=bool(why_misfit(average, known)))]
    for name, cost in costs.items():
        explained = name in known and known[name].explains(cost)
        if len(costs) > 1 and cost > SINGLE_COST_GUIDE and not explained:
            light = Light.RED if cost > SINGLE_COST_LIMIT else Light.AMBER
            action = (
                f"{STARTS_FIRST}; then narrow its band to where it is coherent, or leave it out"
            )
            found.append(Finding("cost-response", light, f"{name}: cost {cost:.0f}", action))
    if any(each.light is Light.RED for each in found):
        worst = max(costs, key=lambda name: costs[name])
        what = f"the search ended at a minimum of average cost {average:.0f}"
        what += f", {worst} {costs[worst]:.0f}: it need not be the lowest"
        found.append(Finding(MINIMUM_DOUBTED, Light.AMBER, what, STARTS_FIRST))
    return found


def why_misfit(average: float, noise: Mapping[str, NoiseCost]) -> str:
    """Why intervals by noise do not hold where the model misses far more; empty where they do.

    Parameters
    ----------
    average : float
        Of the costs.
    noise : mapping of str to NoiseCost
        By response; empty where errors are not known.

    Assumes
    -------
    Misfit moves estimates as noise of its size would (Birge (1932), Physical Review 40, p. 207):
    from `CERTAIN_RATIO` on bars would have to be twice as long. A misfit keeps its sign over a
    band, so that the truth may lie much further off: bars are withheld, not stretched.

    Example
    -------
    >>> why_misfit(1.2, {"p/a": NoiseCost(1.0, 0.2)})
    ''
    >>> why_misfit(50.0, {"p/a": NoiseCost(0.2, 0.04)})
    'the model misses far more of the response (average cost 50) than random errors explain (0.2)'
    """
    known = _averaged(noise)
    if known is None or average <= CERTAIN_RATIO * known.mean or known.chance(average) > CERTAIN:
        return ""
    return (
        f"the model misses far more of the response (average cost {average:.3g}) than random "
        f"errors explain ({known.mean:.3g})"
    )


def judge_missed(findings: Sequence[Finding], average: float, missed: str) -> list[Finding]:
    """The same verdicts where a model misses more than errors of the points and what they share.

    Parameters
    ----------
    findings : sequence of Finding
    average : float
        Of the costs.
    missed : str
        What it misses.

    Example
    -------
    >>> green = Finding("cost", Light.GREEN, "average cost 20, nearly indistinguishable")
    >>> (said,) = judge_missed([green], 20.0, "the model misses q")
    >>> said.light.value, said.message
    ('amber', 'average cost 20: the model misses q, so there are no intervals')
    """
    what = f"average cost {average:.3g}: {missed}, so there are no intervals"
    said = Finding("cost", Light.AMBER, what, MISSED_ACTION)
    is_green = [each.code == "cost" and each.light is Light.GREEN for each in findings]
    return [said if green else each for green, each in zip(is_green, findings, strict=True)]


def _averaged(noise: Mapping[str, NoiseCost]) -> NoiseCost | None:
    """Of the average cost; errors of different responses may be one and the same."""
    if not noise:
        return None
    means, deviations = zip(*((each.mean, each.deviation) for each in noise.values()), strict=True)
    return NoiseCost(float(np.mean(means)), float(np.mean(deviations)))


def _judge_average(average: float, noise: NoiseCost | None, *, withheld: bool) -> Finding:
    if noise is not None and noise.explains(average):
        what = f"average cost {average:.3g}; random errors alone give {noise.mean:.3g} on average"
        what += f", and as much in {100.0 * noise.chance(average):.2g} % of flights"
        return Finding("cost", Light.GREEN, what)
    if average > AVERAGE_COST_GUIDE:
        return Finding(
            "cost",
            Light.RED,
            f"average cost {told_apart(average, AVERAGE_COST_GUIDE)} is above the guide of 100",
            "do not use its numbers, whose intervals assume that the structure holds: "
            f"{STARTS_FIRST}; then add missing dynamics, narrow the band, or look for a wrong sign "
            "or unit",
        )
    seen = noise is not None and average > MISFIT_RATIO * noise.mean + MISFIT_GUIDE
    if noise is not None and (seen or withheld):
        words = "the model misses what the data show"
        return Finding(
            "cost",
            Light.RED if seen and average > FAR_RATIO * noise.mean else Light.AMBER,
            f"average cost {average:.3g}, of which random errors explain {noise.mean:.3g}: {words}"
            + (", so there are no intervals" if withheld else ""),
            MISSED_ACTION,
        )
    if average <= EXCELLENT_COST:
        words = f"average cost {average:.3g}, nearly indistinguishable"
    else:
        words = f"average cost {average:.3g}, within the guide of 100"
    return Finding("cost", Light.GREEN, words)


def judge_parameters(parameters: Mapping[str, Estimate]) -> list[Finding]:
    """Verdicts on each parameter: not seen, at a bound, insensitive, badly bounded."""
    found = []
    for p in parameters.values():
        if p.status == "not seen":
            text = (
                f"{p.name} has no influence on what was fitted: {p.value:.4g} {p.unit} is its start"
            )
            found.append(Finding("not-seen", Light.RED, text, NEXT))
        if p.status == "at bound":
            found.append(
                Finding(
                    "at-bound",
                    Light.AMBER,
                    f"{p.name} ended at its bound {p.value:.4g} {p.unit}",
                    "widen the bound if physics allows, else fix the parameter there",
                )
            )
        found += _judge_guides(p)
    return found


def _judge_guides(p: Estimate) -> list[Finding]:
    insensitive, bounded = p.insensitivity_percent, p.cramer_rao_percent
    if insensitive is not None and insensitive > INSENSITIVITY_GUIDE_PERCENT:
        seen = told_apart(insensitive, INSENSITIVITY_GUIDE_PERCENT)
        code, what = INSENSITIVE, f"insensitivity {seen} % is above the guide of 10 %"
        action = "fix it or drop it from the model: the data hardly see it"
    elif bounded is not None and bounded > CRAMER_RAO_GUIDE_PERCENT:
        seen = told_apart(bounded, CRAMER_RAO_GUIDE_PERCENT)
        code, what = CRAMER_RAO, f"Cramér–Rao bound {seen} % is above the guide of 20 %"
        action = "it is correlated with others: fix or tie one of them, or widen the band"
    else:
        return []
    share = _half_width_share(p)
    if share is not None and share < DETERMINED:
        # The guides know nothing of the noise: a quiet record can determine what they would drop.
        what = f"{p.name} is known to ±{100 * share:.2g} % (95 %), though its {what}"
        return [Finding(code, Light.GREEN, what)]
    return [Finding(code, Light.AMBER, f"{p.name}: {what}", action)]


def _half_width_share(p: Estimate) -> float | None:
    if p.interval95 is None or p.value == 0.0:
        return None
    low, high = p.interval95
    return 0.5 * (high - low) / abs(p.value)


def judge_correlation(
    names: Sequence[str],
    correlation: NDArray[np.float64],
    parameters: Mapping[str, Estimate],
) -> list[Finding]:
    """One verdict for each pair that the data can hardly tell apart."""
    pairs = np.argwhere(np.triu(np.abs(correlation) > CORRELATION_GUIDE, k=1)).tolist()
    found = []
    for i, j in pairs:
        shares = [_half_width_share(parameters[names[k]]) for k in (i, j)]
        told = told_apart(abs(correlation[i, j]), CORRELATION_GUIDE, decimals=3)
        sign = "−" if correlation[i, j] < 0.0 else "+"
        size = f"correlated by {sign}{told}, above the guide of 0.98"
        if all(share is not None and share < DETERMINED for share in shares):
            known = " and ".join(f"±{100 * (share or 0.0):.2g} %" for share in shares)
            what = f"{names[i]} and {names[j]} are known to {known} (95 %), though {size}"
            found.append(Finding(CORRELATED, Light.GREEN, what))
            continue
        what = f"{names[i]} and {names[j]} are {size}"
        action = "fix or tie one of them, or widen the band"
        found.append(Finding(CORRELATED, Light.AMBER, what, action))
    return found


def rivals(groups: Sequence[Group], near: float) -> list[Group]:
    """Minima beside the best one that cost at most `near`."""
    return [group for group in groups[1:] if group[0].is_converged and group[0].cost <= near]


def judge_search(groups: Sequence[Sequence[End]], near: float | None = None) -> list[Finding]:
    """Verdicts on the iteration and on the minima that the starts found.

    Minima up to `near` are rivals of the best; default: within ten percent of its cost.
    """
    best = groups[0][0]
    found = []
    if best.termination not in CONVERGED:
        found.append(
            Finding(
                "not-converged",
                Light.RED,
                f"the iteration ended by {best.termination!r} after {best.iterations} steps",
                MORE_STEPS,
            )
        )
    near = _NEAR_COST * best.cost if near is None else near
    others = rivals(groups, near)
    if others:
        found.append(
            Finding(
                "several-minima",
                Light.AMBER,
                f"{len(others)} other minima lie within 10 % of the best cost",
                "narrow the bounds by physics, or fix a parameter",
            )
        )
    return found


def judge_intervals(
    source: str, *, outputs_apart: bool, noise_taken_for_known: bool = False
) -> list[Finding]:
    """Verdict on where the 95 % intervals come from."""
    taken = [
        Finding(
            NOISE_KNOWN,
            Light.GREEN,
            "the response does not tell from how much noise its errors were estimated (one from a "
            "file or arithmetic does not), so 95 % intervals take that noise for known: of few "
            "bins they are a little short",
            "fit the response as estimated from records",
        )
    ]
    return [
        *_judge_source(source, outputs_apart=outputs_apart),
        *(taken if noise_taken_for_known else ()),
    ]


def _judge_source(source: str, *, outputs_apart: bool) -> list[Finding]:
    if outputs_apart:
        return [
            Finding(
                "intervals-by-output",
                Light.AMBER,
                "errors of different outputs were taken as independent: what moves several at "
                "once, as a gust does, makes the intervals narrow",
                "fit the response as estimated from records, not one from a file or arithmetic",
            )
        ]
    if source == UNKNOWN:
        return [
            Finding(
                "intervals-missing",
                Light.UNKNOWN,
                "the errors of the response are not known, so there are no 95 % intervals",
                "estimate the response from records with covariance=True",
            )
        ]
    if source == APPROXIMATE:
        return [
            Finding(
                "intervals-approximate",
                Light.AMBER,
                "95 % intervals rest on the random error alone and are approximate",
                "estimate the response with covariance=True",
            )
        ]
    return []
