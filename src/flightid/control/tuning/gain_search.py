"""Search for gains that hold for every plant: a grid, then smooth refinement on active plants.

The worst plant changes from point to point, so the objective has edges. In the epigraph form
(raise t while every plant's objective stays above it) each plant and requirement is a smooth
constraint of its own, and only the few plants that are worst somewhere take part: those that
a solution violates are added until none is.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np
import scipy
from numpy.typing import NDArray

from flightid.control.tuning.gain_search_result import GainSearchResult
from flightid.control.tuning.limits import TARGET
from flightid.control.tuning.loop_problem import LoopAssessment, LoopProblem
from flightid.frozen import dataclass

Array = NDArray[np.float64]
Linear = tuple[Array, Array, Array, Array]
"""Limits, levels and their slopes."""
GRID_P, GRID_I, GRID_D, GRID_A = 14, 5, 4, 3
"""Points of the first grid by P, I, D and angle gain."""
CHUNK = 96
"""Candidates that are judged together."""
STARTS, MORE_STARTS = 2, 4
"""Points from which a search descends, and where these miss a requirement."""
ROUNDS = 8
"""In which plants that gains violate join those of the search."""
HEADROOM = 2e-3
"""Slack kept in the search, for rounding of gains and frequencies between grid points."""
STEP = 1e-4
"""Logarithm by which gains are moved for slopes."""
FIRST_REACH, SMALLEST_REACH = 0.25, 1e-4
"""First and last size of a trusted step, in logarithms of gains."""
SMALLEST_GAIN, SHRINK = 1e-6, 0.25
"""Least rise of the merit that counts, and what a step that fails shrinks to."""
ITERATIONS = 60
"""Most steps of a descent."""
FAR = 1.0
"""Slack beyond the least one at which a limit takes no part in a step."""
PENALTY = 50.0
"""Loss of merit for a violated limit, in e-folds of the objective."""
LARGEST_TD_S, TIME_SCALE_S = 0.5, 0.1
"""Largest ratio of D to P, s, of a loop with the time scale that follows, s."""
TINY_GAIN = 1e-9
"""In place of a gain of zero where its logarithm is taken."""
INTEGRAL = "ratio of I to P"
LOW_END = " (low end)"
"""After the range of a gain that could be lower, where there are no gains."""
IN_WORDS = {"A": "the angle's P"}
EDGE = 0.02
"""Slack below which a requirement binds."""


def search(
    problem: LoopProblem, active: list[int], advance: Callable[[int], None]
) -> GainSearchResult:
    """Find the gains of the highest objective, or of the largest margins for a target.

    Parameters
    ----------
    problem : LoopProblem
    active : list of int
        Plants to begin with: the estimate and the corners of its spread.
    advance : callable
        Told the number of candidates done; the total is `steps`.

    Reference
    ---------
    Åström & Hägglund, *Advanced PID Control* (2006), chapter 7 (constrained optimisation of
    robust gains); Reemtsen & Rückmann, *Semi-Infinite Programming* (1998), chapter 7 (exchange of
    constraints); Fletcher & Sainz de la Maza,
    *Mathematical Programming* 43 (1989), 235–256 (sequential linear programming).
    """
    space = _Space.of(problem)
    coarse = space.grid()
    # The estimate alone tells where to begin: no start need hold for every plant.
    judged = _judge_all(problem, coarse, active[:1], advance)
    starts = _starts(coarse, *judged, problem.requirements.has_target)
    best, rows = _exchanged(problem, space, starts, active, advance)
    found = _report(problem, best)
    if found.exists:
        return found
    # The best of the estimate may lie where other plants allow none: ask the whole grid of all.
    judged = _judge_all(problem, coarse, rows, _unheard)
    starts = _starts(coarse, *judged, problem.requirements.has_target, MORE_STARTS)
    again = _report(problem, _exchanged(problem, space, [best, *starts], rows, _unheard)[0])
    return max(found, again, key=lambda each: min(each.slack.values()))


def _exchanged(
    problem: LoopProblem,
    space: _Space,
    starts: list[Array],
    active: list[int],
    advance: Callable[[int], None],
) -> tuple[Array, list[int]]:
    """Best gains for the active plants, to which those that they violate are added, and these."""
    rows, best = list(active), starts[0]
    for _ in range(ROUNDS):
        best = _refined(problem, space, starts, rows)
        worst = _violating(problem.judge(best[None]), rows)
        advance(CHUNK)
        if not worst:
            break
        rows += worst
        starts = [best, *starts[:1]]
    return best, rows


def _unheard(done: int) -> None:
    """Steps that were not announced."""


def steps(problem: LoopProblem) -> int:
    """Largest number of steps that `search` announces."""
    return len(_Space.of(problem).grid()) + ROUNDS * CHUNK


@dataclass(frozen=True, eq=False)
class _Space:
    """Gains as log P, log(I/P), D/P and log A, each inside the ranges."""

    kinds: tuple[str, ...]
    low: Array
    high: Array
    slower: float
    integral_ratio: float

    @classmethod
    def of(cls, problem: LoopProblem) -> _Space:
        scale, ratio = problem.time_scale, problem.integral_ratio
        return cls(problem.kinds, problem.low, problem.high, scale, ratio)

    @property
    def _lead(self) -> float:
        return TIME_SCALE_S * self.slower

    def _range(self, kind: str) -> tuple[float, float]:
        place = self.kinds.index(kind)
        return float(self.low[place]), float(self.high[place])

    def grid(self) -> Array:
        """Candidates over the whole ranges, shape (n, n_gains)."""
        low_p, high_p = self._range("P")
        gains = np.geomspace(low_p, high_p, GRID_P)
        low_a, high_a = self._range("A") if "A" in self.kinds else (1.0, 1.0)
        angles = np.geomspace(low_a, high_a, GRID_A if "A" in self.kinds else 1)
        times_i = np.geomspace(0.05, 5.0, GRID_I) if "I" in self.kinds else np.ones(1)
        times_d = (
            np.concatenate([[0.0], np.geomspace(0.003, 0.3, GRID_D)])
            if "D" in self.kinds
            else np.zeros(1)
        )
        times = self.slower * times_i, self.slower * times_d
        p, ti, td, a = map(np.ravel, np.meshgrid(gains, *times, angles))
        made = {"P": p, "I": p * np.minimum(1.0 / ti, self.integral_ratio), "D": p * td, "A": a}
        table = np.column_stack([made[kind] for kind in self.kinds])
        inside = np.all((table >= self.low) & (table <= self.high), axis=1)
        # Ranges that fit no such ratio still hold their own corners.
        return table[inside] if inside.any() else np.clip(table, self.low, self.high)

    def to_point(self, gains: Array) -> Array:
        """Gains (n_gains,) to a point."""
        return np.array(
            [self._point(kind, gain, gains) for kind, gain in zip(self.kinds, gains, strict=True)]
        )

    def _point(self, kind: str, gain: float, gains: Array) -> float:
        p = float(gains[self.kinds.index("P")])
        if kind == "I":
            return float(np.log(max(gain, TINY_GAIN) / p))
        return gain / p / self._lead if kind == "D" else float(np.log(gain))

    def to_gains(self, points: Array) -> Array:
        """Points (n, n_gains) to gains inside the ranges."""
        p = np.exp(points[:, self.kinds.index("P")])
        columns = []
        for kind, x in zip(self.kinds, points.T, strict=True):
            if kind == "D":
                columns.append(p * x * self._lead)
            else:
                columns.append(p * np.exp(x) if kind == "I" else np.exp(x))
        return np.asarray(np.clip(np.column_stack(columns), self.low, self.high))

    def bounds(self) -> tuple[Array, Array]:
        """Lowest and highest point."""
        ratio = np.array([1e-3, 1e2]) / self.slower
        given = {
            "I": np.log([ratio[0], np.clip(self.integral_ratio, 2.0 * ratio[0], ratio[1])]),
            "D": np.array([0.0, LARGEST_TD_S / TIME_SCALE_S]),
        }
        given |= {kind: np.log(self._range(kind)) for kind in "PA" if kind in self.kinds}
        low, high = np.array([given[kind] for kind in self.kinds]).T
        return low, high


def _chunks(candidates: Array) -> Iterator[Array]:
    for start in range(0, len(candidates), CHUNK):
        yield candidates[start : start + CHUNK]


def _judge_all(
    problem: LoopProblem, candidates: Array, rows: list[int], advance: Callable[[int], None]
) -> tuple[Array, Array]:
    """Worst slack and worst objective of each candidate."""
    slacks, objectives = [], []
    for part in _chunks(candidates):
        judged = problem.judge(part, rows)
        slacks.append(judged.slack.min(axis=(0, 2)))
        objectives.append(judged.objective.min(axis=1))
        advance(len(part))
    return np.concatenate(slacks), np.concatenate(objectives)


def _starts(
    coarse: Array, slack: Array, objective: Array, has_target: bool, count: int = STARTS
) -> list[Array]:
    """Best candidates of the grid, no two of one shape; where none is feasible, the nearest."""
    feasible = slack >= 0.0
    merit = np.where(feasible & (not has_target), 100.0 + objective, np.minimum(slack, 5.0))
    chosen: dict[tuple[float, ...], Array] = {}
    for k in np.argsort(-merit, kind="stable"):
        # Ratios of the rate loop's gains: optima hide from a search in another shape.
        shape = tuple(np.round(coarse[k, 1:3] / coarse[k, 0], 6))
        chosen.setdefault(shape, coarse[k])
        if len(chosen) == count:
            break
    return list(chosen.values())


def _refined(problem: LoopProblem, space: _Space, starts: list[Array], rows: list[int]) -> Array:
    """Best of the refined starts."""
    ends = np.array([_climb(problem, space, start, rows) for start in starts])
    return np.asarray(ends[int(np.argmax(_merits(problem, ends, rows)))])


def _merits(problem: LoopProblem, gains: Array, rows: list[int]) -> Array:
    return _merit(*_split(problem.judge(gains, rows)))


def _merit(limits: Array, levels: Array) -> Array:
    return np.asarray(levels.min(axis=1) - PENALTY * np.maximum(0.0, -limits.min(axis=1)))


def _split(judged: LoopAssessment) -> tuple[Array, Array]:
    """What must not be negative, and what is to be raised, each (n_candidates, …).

    With a target the margins are raised and the target is a limit, else the objective is raised
    and the margins are limits.
    """
    n = judged.slack.shape[1]
    slack = judged.slack - HEADROOM - 2.0 * ~judged.stable[None]
    targets = np.array([name.endswith(TARGET) for name in judged.names])
    margins = np.hstack(
        [
            slack[~targets].transpose(1, 0, 2).reshape(n, -1),
            np.moveaxis(judged.peaks, 0, -1).reshape(n, -1) - HEADROOM,
        ]
    )
    if not targets.any():
        return margins, judged.objective
    return slack[targets].transpose(1, 0, 2).reshape(n, -1), margins


def _climb(problem: LoopProblem, space: _Space, start: Array, rows: list[int]) -> Array:
    """Sequential linear programming in a trust region; no step makes the merit worse."""

    def judged(at: Array) -> tuple[Array, Array]:
        return _split(problem.judge(space.to_gains(at[None]), rows))

    low, high = space.bounds()
    point, reach = np.clip(space.to_point(start), low, high), FIRST_REACH
    merit = float(_merit(*judged(point)).item())
    linear: Linear | None = None
    for _ in range(ITERATIONS):
        linear = linear or _linearised(problem, space, point, rows)
        box = np.maximum(low - point, -reach), np.minimum(high - point, reach)
        step = _linear_step(linear, *box)
        if step is None or np.abs(step).max() < SMALLEST_REACH:
            break
        met = judged(point + step)
        trial = float(_merit(*met).item())
        if trial <= merit + SMALLEST_GAIN:
            step = _linear_step(_corrected(linear, step, *met), *box)
            if step is not None:
                trial = float(_merit(*judged(point + step)).item())
        if step is not None and trial > merit + SMALLEST_GAIN:
            full = np.abs(step).max() > 0.99 * reach
            point, merit, linear = point + step, trial, None
            reach = min(2.0 * reach, 1.0) if full else reach
        else:
            reach *= SHRINK
            if reach < SMALLEST_REACH:
                break
    return np.asarray(space.to_gains(point[None]).squeeze(0))


def _corrected(linear: Linear, step: Array, limits: Array, levels: Array) -> Linear:
    """The linear problem with the curvature that a rejected step has met at its end.

    Without it steps along a curved limit leave it and are refused, however good they are.
    """
    _, _, limit_slopes, level_slopes = linear
    near_limits, near_levels = (
        limits.squeeze(0) - limit_slopes @ step,
        levels.squeeze(0) - level_slopes @ step,
    )
    return near_limits, near_levels, limit_slopes, level_slopes


def _linearised(problem: LoopProblem, space: _Space, point: Array, rows: list[int]) -> Linear:
    """Limits and levels at a point, and their slopes, shapes (n,) and (n, n_gains)."""
    points = np.vstack([point, point + STEP * np.eye(len(point))])
    limits, levels = _split(problem.judge(space.to_gains(points), rows))
    return (
        limits[0],
        levels[0],
        (limits[1:] - limits[0]).T / STEP,
        (levels[1:] - levels[0]).T / STEP,
    )


def _linear_step(linear: Linear, low: Array, high: Array) -> Array | None:
    """Step that raises the lowest level, violations penalised; None where there is none."""
    limits, levels, limit_slopes, level_slopes = linear
    near = (limits < limits.min() + FAR) & (_lowest(limits, limit_slopes, low, high) < 0.0)
    limits, limit_slopes = limits[near], limit_slopes[near]
    reached = _lowest(levels, level_slopes, low, high)
    ceiling = -np.max(_lowest(-levels, -level_slopes, low, high))
    low_levels = (levels < levels.min() + FAR) & (reached <= ceiling)
    levels, level_slopes = levels[low_levels], level_slopes[low_levels]
    n = limit_slopes.shape[1]
    # Unknowns: the step, the level t, the violation v >= 0.
    above = np.zeros((len(limits) + len(levels), n + 2))
    above[:, :n] = -np.vstack([limit_slopes, level_slopes])
    above[: len(limits), n + 1], above[len(limits) :, n] = -1.0, 1.0
    # A mixed-integer problem without integers: the same solver as `linprog`, checked less often.
    found = scipy.optimize.milp(
        np.concatenate([np.zeros(n), [-1.0, PENALTY]]),
        constraints=(above, -np.inf, np.concatenate([limits, levels])),
        bounds=scipy.optimize.Bounds(
            np.append(low, [-np.inf, 0.0]), np.append(high, [np.inf, np.inf])
        ),
    )
    return None if found.x is None else np.asarray(found.x[:n])


def _lowest(values: Array, slopes: Array, low: Array, high: Array) -> Array:
    """Least value of each line inside a box: what never falls below zero there binds no step."""
    return np.asarray(values + np.minimum(slopes * low, slopes * high).sum(axis=1))


def _violating(judged: LoopAssessment, rows: list[int]) -> list[int]:
    """Plants outside `rows` that are worst in a requirement that fails, or in the objective."""
    new: list[int] = []
    known = set(rows)
    slack, objective = judged.slack.squeeze(1), judged.objective.squeeze(0)
    inside = slack[:, rows].min(axis=1)
    for each, least in zip(slack, inside, strict=True):
        worst = int(np.argmin(each))
        if worst not in known and each[worst] < min(0.0, least):
            new.append(worst)
    lowest = int(np.argmin(objective))
    if lowest not in known and objective[lowest] < objective[rows].min() - 1e-3:
        new.append(lowest)
    return list(dict.fromkeys(new))


def _ends(problem: LoopProblem, gains: Array, *, exists: bool) -> Iterator[str]:
    """Ranges that the gains stand at an end of, where that may be what keeps them there.

    No gains at all may lie below the range of the angle's P or of I, too.
    """
    keeping = "P" if exists else "PIA"
    for kind, value, low, high in zip(problem.kinds, gains, problem.low, problem.high, strict=True):
        name = f"range of {IN_WORDS.get(kind, kind)}"
        if value >= high * (1.0 - 1e-3):
            yield name
        elif kind in keeping and value <= low * (1.0 + 1e-3):
            yield name if exists else name + LOW_END


def _report(problem: LoopProblem, gains: Array) -> GainSearchResult:
    judged = problem.judge(gains[None])
    least = dict(zip(judged.names, judged.slack.squeeze(1).min(axis=1), strict=True))
    exists = bool(min(least.values()) >= 0.0)
    edge = EDGE if exists else 0.0
    binding = tuple(name for name, slack in least.items() if slack < edge + 2 * HEADROOM)
    at_range = tuple(_ends(problem, gains, exists=exists))
    slack = {name: float(each) for name, each in least.items()}
    known = dict(zip(problem.kinds, gains, strict=True))
    if "I" in known and known["I"] >= problem.integral_ratio * known["P"] * (1.0 - 1e-3):
        binding += (INTEGRAL,)
    return GainSearchResult(gains, exists, (*binding, *at_range), slack)
