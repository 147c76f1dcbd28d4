"""The search of filter error, and the gust state that coloured innovations ask for."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from flightid.identification.delay_cells import DelayCells, beyond_jumps
from flightid.identification.filter_error.gust_score import Score, score
from flightid.identification.filter_error.gusts import GUST_UNKNOWNS, Gust, candidates
from flightid.identification.filter_error.innovations import InnovationsProblem
from flightid.identification.multistart import DenseEnd
from flightid.identification.records.held_model import LinearPoint
from flightid.identification.regression.rounds import SearchBounds
from flightid.progress import progress

Array = NDArray[np.float64]
TRIAL_ITERATIONS = 12
"""Of each candidate's search, before the best one goes on."""
CALM = -3.0
"""Logarithm of all process noise, over its first guess, below which there may be none."""
STILL = 0.7
"""Part of its reach by which all process noise is lowered where a gust is tried in its place."""
REACHED = 5.0
"""Times its score test's gain that a search for a gust may gain: where one paid, up to 2.3."""
ALLOWED = 50.0
"""Rise of −2 ln p just across a jump that two further steps may make up for."""
NEAR = 0.01
"""Gain of a last step in −2 ln p before gusts are tried or left: far less than they must gain."""


class _LastPoint:
    """Residuals and Jacobian, computed once where both are asked for at one point."""

    def __init__(self, problem: InnovationsProblem, advance: Callable[..., None]) -> None:
        self._problem = problem
        self._advance = advance
        self._x = np.empty(0)
        self._found = (np.empty(0), np.empty((0, 0)))

    def residuals(self, x: Array) -> Array:
        return self._at(x)[0]

    def jacobian(self, x: Array) -> Array:
        return self._at(x)[1]

    def _at(self, x: Array) -> tuple[Array, Array]:
        if not np.array_equal(x, self._x):
            self._found = self._problem.residuals(x, with_slopes=True)
            self._x = x.copy()
            self._advance()
        return self._found


def minimise(
    problem: InnovationsProblem,
    start: Array,
    limits: SearchBounds,
    *,
    iterations: int | None = None,
    enough: float = 0.0,
) -> DenseEnd:
    """Search from one start: parameters inside their bounds, noises inside their reach.

    It ends at `iterations`, or where a step that lowers −2 ln p does so by less than `enough`.
    """
    reach, last, total = problem.reach, np.inf, problem.n_measured

    def is_near(cost: float) -> bool:
        nonlocal last
        gained, last = total * math.log(last / max(cost, 1e-300)), cost
        return 0.0 < gained < enough

    with progress(None, "running the filter") as advance:
        point = _LastPoint(problem, advance)
        return DenseEnd.searched(
            point.residuals,
            point.jacobian,
            start,
            np.concatenate([limits.lower, -reach]),
            np.concatenate([limits.upper, reach]),
            problem.n_residuals,
            limits.maximum_iterations if iterations is None else iterations,
            is_near if enough else None,
        )


def across_jumps(
    problem: InnovationsProblem,
    ends: list[DenseEnd],
    limits: SearchBounds,
    *,
    kinks: bool = False,
) -> list[DenseEnd]:
    """Ends of all starts, the best of them followed across whole samples of delays.

    Across `kinks` once gusts are decided on: before, a delay takes the blame for what they do.
    """

    def search(
        end: DenseEnd, x: Array, bounds: tuple[Array, Array], iterations: int | None
    ) -> DenseEnd | None:
        start = np.concatenate([x, end.x[problem.n_free :]])
        if iterations is not None:
            start = _along_valley(end, start)
            start = np.clip(start, *(np.r_[a, b] for a, b in zip(bounds, edges, strict=True)))
            residuals = problem.residuals(start, with_slopes=False)[0]
            cost = float(residuals @ residuals)
            if not problem.n_measured * math.log(cost / end.cost) < ALLOWED:
                return None
        inside = replace(limits, lower=bounds[0], upper=bounds[1])
        return minimise(problem, start, inside, iterations=iterations)

    edges = -problem.reach, problem.reach
    cells, outer = _cells(problem, kinks=kinks), (limits.lower, limits.upper)
    return [beyond_jumps(ends[0], problem.model, cells, outer, search), *ends[1:]]


def inside_cell(problem: InnovationsProblem, end: DenseEnd, limits: SearchBounds) -> SearchBounds:
    """Bounds within which no held input reaches another sample than at an end."""
    free = [parameter.name for parameter in problem.model.parameters.free]
    values = dict(zip(free, map(float, end.x), strict=False))
    around = _cells(problem).around(problem.model.with_values(values))
    if around is None:
        return limits
    lower, upper = _cells(problem).within((limits.lower, limits.upper), around)
    return replace(limits, lower=lower, upper=upper)


def _cells(problem: InnovationsProblem, *, kinks: bool = False) -> DelayCells:
    steps = tuple({each.sample_time_s for each in problem.data})
    return DelayCells(steps, problem.hold, kinks=kinks)


def _along_valley(end: DenseEnd, moved: Array) -> Array:
    """A point beside an end, all numbers that were not moved brought to where they cost least."""
    step = moved - end.x
    rest = np.flatnonzero(step == 0.0)
    scale = np.maximum(np.linalg.norm(end.jacobian[:, rest], axis=0), np.finfo(float).tiny)
    columns = end.jacobian[:, rest] / scale
    step[rest] = -np.linalg.lstsq(columns.T @ columns, columns.T @ (end.jacobian @ step))[0] / scale
    return np.asarray(end.x + step)


def with_gust(
    problem: InnovationsProblem, groups: list[list[DenseEnd]], limits: SearchBounds
) -> tuple[InnovationsProblem, list[list[DenseEnd]]]:
    """The problem and its ends, with a gust state where the likelihood asks for one.

    At the best end a score test tells of each candidate, without a search, how far −2 ln p falls
    as the gust grows from nothing. A search gains up to a few times that: candidates whose gain
    times `REACHED` does not pay for their unknowns, or is below what a likelier one gained, are
    left. The others begin where the test's own step leads, and anew with hardly any white noise
    where that did not pay. The likeliest goes on until it is `NEAR` its end, and to that end if it
    gains more than its two unknowns may by chance (BIC): it replaces all others then. A test of the
    innovations' colour would not do: a gust as long as the vehicle's own motion bends its
    derivatives and leaves hardly any colour. Nothing is tried where no state has noise. An end that
    is only `NEAR` is followed to its end where no gust replaces it.

    Reference
    ---------
    Schwarz (1978), Annals of Statistics 6; Ljung, *System Identification*, 2nd ed., §16.4; Rao
    (1948), Proc. Cambridge Philosophical Society 44 (score test).
    """
    outer, limits = limits, inside_cell(problem, groups[0][0], limits)
    noisy = slice(problem.n_free, problem.n_free + len(problem.noisy))
    if np.all(groups[0][0].x[noisy] < CALM):
        groups = _followed(problem, groups, limits)
    end = groups[0][0]
    if np.all(end.x[noisy] <= -problem.reach[: len(problem.noisy)] + 1e-6):
        return problem, groups
    needed = GUST_UNKNOWNS * math.log(problem.n_measured)
    scored = [score(replace(problem, gust=gust), end) for gust in _gusts(problem, end)]
    best: tuple[float, InnovationsProblem, DenseEnd] | None = None
    for each in sorted(scored, key=lambda each: -each.gain):
        if REACHED * each.gain < max(needed, best[0] if best else 0.0):
            break
        found = _tried(each, end, needed, limits)
        if found is not None and (best is None or found[0] > best[0]):
            best = (found[0], each.problem, found[1])
    if best is None:
        return problem, _followed(problem, groups, limits)
    _, tried, begun = best
    if not begun.is_converged:
        begun = minimise(tried, begun.x, limits, enough=NEAR)
    if _gained(tried, end, begun) <= needed:
        return problem, _followed(problem, groups, limits)
    return tried, [across_jumps(tried, [minimise(tried, begun.x, limits)], outer)]


def _gusts(problem: InnovationsProblem, end: DenseEnd) -> list[Gust]:
    """Candidates, by the motion that the filter sees."""
    filtered = [found for found, _ in problem.records(end.x, with_slopes=False)]
    values = problem.model.parameters.independent_values()
    values[problem.model.parameters.free_indices] = end.x[: problem.n_free]
    states = np.sqrt(np.mean([np.var(each.states, axis=0) for each in filtered], axis=0))
    step = min(each.sample_time_s for each in problem.data)
    longest = max(each.outputs.shape[1] * each.sample_time_s for each in problem.data)
    return candidates(LinearPoint.of(problem.model, values), states, step, longest)


def _tried(
    scored: Score, end: DenseEnd, needed: float, limits: SearchBounds
) -> tuple[float, DenseEnd] | None:
    """What a few iterations gain in −2 ln p, from the test's step and, where needed, anew."""
    problem, found = scored.problem, []
    calm = end.x.copy()
    calm[: problem.n_free] = [each.value for each in problem.model.parameters.free]
    calm[problem.n_free :][: len(problem.noisy)] = -STILL * problem.reach[: len(problem.noisy)]
    for start in (scored.start, np.concatenate([calm, np.zeros(GUST_UNKNOWNS)])):
        if np.all(np.isfinite(problem.residuals(start, with_slopes=False)[0])):
            tried = minimise(problem, start, limits, iterations=TRIAL_ITERATIONS, enough=NEAR)
            found.append((_gained(problem, end, tried), tried))
            if found[-1][0] > needed:
                break
    return max(found, key=lambda each: each[0]) if found else None


def _gained(problem: InnovationsProblem, end: DenseEnd, tried: DenseEnd) -> float:
    return problem.n_measured * math.log(end.cost / tried.cost)


def anchored(
    problem: InnovationsProblem, groups: list[list[DenseEnd]], limits: SearchBounds
) -> tuple[InnovationsProblem, list[list[DenseEnd]]]:
    """The problem and its ends, all noises told by one that is there.

    Where the output that tells the common factor has no noise after all, all other noises run to
    the upper ends of their reach: the search goes on from there by the loudest output.
    """
    end, reach = groups[0][0], problem.reach
    noises = end.x[problem.n_free :]
    first = len(problem.noisy)
    rest = noises[first : first + len(problem.measured)]
    if not np.any(noises >= reach - 1e-6) or not np.any(rest > 0.0):
        return problem, groups
    loudest = int(np.argmax(rest))
    logs = np.insert(rest, problem.reference, 0.0)
    told = replace(problem, reference=problem.measured[loudest])
    moved = noises - rest[loudest]
    moved[first : first + len(rest)] = logs[list(told.measured)] - rest[loudest]
    if problem.gust is not None:
        moved[-1] = noises[-1]
    start = np.concatenate([end.x[: problem.n_free], np.clip(moved, -reach, reach)])
    found = minimise(told, start, inside_cell(problem, end, limits))
    if not found.cost <= end.cost * (1.0 + 1e-9):
        return problem, groups
    found = replace(found, iterations=end.iterations + found.iterations)
    return told, [[found, *groups[0][1:]], *groups[1:]]


def _followed(
    problem: InnovationsProblem, groups: list[list[DenseEnd]], limits: SearchBounds
) -> list[list[DenseEnd]]:
    """The best end itself, where the search had only come near it."""
    near, rest = groups[0][0], groups[1:]
    end = minimise(problem, near.x, limits)
    return [[replace(end, iterations=near.iterations + end.iterations)], *rest]
