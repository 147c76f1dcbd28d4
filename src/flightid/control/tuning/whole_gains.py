"""Whole numbers near gains that were found, for autopilots that keep no others."""

from __future__ import annotations

from dataclasses import replace
from itertools import product

import numpy as np

from flightid.control.tuning.controller_paths import ControllerPaths
from flightid.control.tuning.gain_search_result import GainSearchResult
from flightid.control.tuning.loop_problem import LoopProblem

SHARES = (1.0, 0.97, 0.94, 0.9)
"""Of the gains found: where no neighbour meets every requirement, a smaller one may."""
WHOLE = 1e-9
"""Distance from a whole number below which a gain is one."""
ROUNDED = "whole numbers"


def whole_gains(
    problem: LoopProblem, paths: ControllerPaths, found: GainSearchResult
) -> GainSearchResult:
    """The whole numbers beside a result that meet its requirements best, in its own units.

    Parameters
    ----------
    problem : LoopProblem
        The plants of the search.
    paths : ControllerPaths
    found : GainSearchResult
    """
    one = np.array([paths.loop.unit_of(role) for role in paths.roles])
    counts = [np.clip(share * found.gains, problem.low, problem.high) / one for share in SHARES]
    near = {
        tuple(map(float, each))
        for around in counts
        for each in product(*zip(np.floor(around + WHOLE), np.ceil(around - WHOLE), strict=True))
    }
    candidates = np.clip(np.array(sorted(near)) * one, problem.low, problem.high)
    judged = problem.judge(candidates)
    slack = judged.slack.min(axis=(0, 2))
    worth = judged.objective.min(axis=1)
    # What meets everything goes first, by its worth; the others by what they lack.
    met = (slack >= 0.0) & found.exists
    best = max(range(slack.size), key=lambda k: (met[k], worth[k] if met[k] else slack[k]))
    least = dict(zip(judged.names, map(float, judged.slack[:, best].min(axis=1)), strict=True))
    exists = bool(met[best])
    binding = found.binding if exists or not found.exists else (*found.binding, ROUNDED)
    return replace(found, gains=candidates[best], exists=exists, binding=binding, slack=least)
