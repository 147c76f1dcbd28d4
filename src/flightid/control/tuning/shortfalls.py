"""What given gains miss of their requirements, in the units of the numbers."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from flightid.control.tuning.limits import Limit, limits, noise_limit
from flightid.control.tuning.loop_problem import LoopAssessment, LoopProblem
from flightid.control.tuning.worst_cases import KINDS, missed_most
from flightid.findings import held

UNITS = {each.field: "" if each.unit == "1" else f" {each.unit}" for each in KINDS}
NAMES = {each.field: each.name for each in KINDS}


def shortfalls(problem: LoopProblem, judged: LoopAssessment) -> tuple[str, ...]:
    """Each requirement that a plant misses: the number of the plant that misses most, and by what.

    Parameters
    ----------
    problem : LoopProblem
    judged : LoopAssessment
        One candidate, judged by the plants of the problem.

    Returns
    -------
    tuple of str
        In the order of the requirements; stability, which is no number, is left out.
    """
    slack = dict(zip(judged.names, judged.slack.squeeze(1), strict=True))
    told = []
    for limit in limits(problem.requirements, judged.metrics, problem.crossover_limit_rad_s):
        least = slack[limit.name]
        if least.min() >= 0.0:
            continue
        value = missed_most(
            limit, least, getattr(judged.metrics[limit.loop], limit.field).squeeze(0)
        )
        name, unit = f"{limit.loop}: {NAMES[limit.field]}", UNITS[limit.field]
        told.append(_short(name, value, unit, limit, least))
    if problem.noise_limit is not None and (least := slack["output noise"]).min() < 0.0:
        noise, most = float(judged.noise.max()), noise_limit(problem.noise_limit)
        told.append(_short(most.name, noise, "", most, least))
    return tuple(told)


def _short(name: str, value: float, unit: str, limit: Limit, slack: NDArray[np.float64]) -> str:
    """The worst plant as tables show it, and what is between that and the limit."""
    digits = limit.digits_beside(value)
    shown = held(value, digits, least=not limit.most) or 0.0
    missing, by = int((slack < 0.0).sum()), f"{abs(shown - limit.shown(digits)):.3g}{unit}"
    beyond = "above" if value > limit.bound else "short of"
    plants = f"{missing} of {len(slack)} plants" if len(slack) > 1 else "the model"
    return f"{name} {shown:.{digits}g}{unit}, {by} {beyond} {limit.told(digits)} ({plants})"
