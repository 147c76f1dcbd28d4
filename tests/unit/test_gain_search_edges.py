"""The search for gains, step by step, on problems whose answers are known."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from flightid.control.tuning import gain_search
from flightid.control.tuning.gain_search import _Space
from flightid.control.tuning.limits import TARGET

Array = np.ndarray


def space(kinds: str = "PID", low: Any = (0.01, 0.001, 0.0), high: Any = (1.0, 5.0, 0.2)) -> _Space:
    """Ranges of these gains, of a loop three times as slow as usual; I at most 8 P."""
    return _Space(tuple(kinds), np.array(low), np.array(high), 3.0, 8.0)


def test_points_are_logarithms_and_times() -> None:
    each = space("PIDA", (0.01, 0.001, 0.0, 1.0), (1.0, 5.0, 0.2, 20.0))
    gains = np.array([0.2, 0.5, 0.012, 6.0])
    point = each.to_point(gains)
    # D over P in parts of 0.1 s, three times as slow: 0.06 s are a fifth of 0.3 s.
    assert point == pytest.approx([np.log(0.2), np.log(2.5), 0.2, np.log(6.0)])
    assert each.to_gains(point[None])[0] == pytest.approx(gains)
    outside = each.to_gains(np.array([[0.0, 5.0, 9.0, 9.0], [-9.0, -9.0, 0.0, -1.0]]))
    assert outside.tolist() == [[1.0, 5.0, 0.2, 20.0], [0.01, 0.001, 0.0, 1.0]]
    none = each.to_point(np.array([0.2, 0.0, 0.0, 6.0]))
    assert none[1:3] == pytest.approx([np.log(1e-9 / 0.2), 0.0])
    low, high = each.bounds()
    assert low == pytest.approx([np.log(0.01), np.log(1e-3 / 3.0), 0.0, 0.0])
    assert high == pytest.approx([0.0, np.log(8.0), 5.0, np.log(20.0)])
    for ratio, most in ((1e-9, 2e-3 / 3.0), (1e9, 1e2 / 3.0)):
        bounded = _Space(("P", "I"), each.low[:2], each.high[:2], 3.0, ratio)
        assert bounded.bounds()[1][1] == pytest.approx(np.log(most))


def test_a_grid_of_gains_and_times_inside_the_ranges() -> None:
    wide = space("PIDA", (0.01, 0.0, 0.0, 1.0), (1.0, 99.0, 99.0, 20.0))
    grid = wide.grid()
    assert len(grid) == 14 * 5 * 5 * 3
    p, i, d, a = grid.T
    assert np.unique(p.round(9)) == pytest.approx(np.geomspace(0.01, 1.0, 14))
    assert np.unique(a.round(9)) == pytest.approx(np.geomspace(1.0, 20.0, 3))
    # Integral times of 0.05 to 5 s, three times as slow; the ratio I to P is 8 at most.
    ratios = np.minimum(1.0 / (3.0 * np.geomspace(0.05, 5.0, 5)), 8.0)
    assert np.unique((i / p).round(9)) == pytest.approx(np.sort(ratios), abs=1e-8)
    times = np.concatenate([[0.0], 3.0 * np.geomspace(0.003, 0.3, 4)])
    assert np.unique((d / p).round(9)) == pytest.approx(times, abs=1e-8)
    held = _Space(wide.kinds, wide.low, wide.high, 3.0, 2.0).grid()
    assert np.max(held[:, 1] / held[:, 0]) == pytest.approx(2.0)
    alone = space("P", (0.1,), (0.5,)).grid()
    assert alone.shape == (14, 1)
    narrow = space("PD", (0.1, 0.5), (0.2, 0.6)).grid()
    assert len(narrow) == 14 * 5
    assert set(narrow[:, 1].tolist()) == {0.5}
    inside = space("PD", (0.1, 0.01), (0.2, 0.6)).grid()
    assert len(inside) < 14 * 5
    assert np.all(inside[:, 1] >= 0.01)


def test_starts_are_the_best_of_different_shapes() -> None:
    coarse = np.array([[1.0, 2.0, 0.1], [2.0, 4.0, 0.2], [1.0, 3.0, 0.1], [1.0, 2.0, 0.5]])
    slack, objective = np.array([0.1, 0.2, 0.3, -0.1]), np.array([5.0, 7.0, 6.0, 9.0])

    def found(has_target: bool, slack: Array = slack, count: int = 2) -> list[list[float]]:
        return [
            e.tolist() for e in gain_search._starts(coarse, slack, objective, has_target, count)
        ]

    # Feasible ones by their objective; the first two have one shape.
    assert found(False) == [[2.0, 4.0, 0.2], [1.0, 3.0, 0.1]]
    assert found(False, count=3) == [[2.0, 4.0, 0.2], [1.0, 3.0, 0.1], [1.0, 2.0, 0.5]]
    assert found(False, count=1) == [[2.0, 4.0, 0.2]]
    # With a target by their slack, of which more than five is no better.
    assert found(True) == [[1.0, 3.0, 0.1], [2.0, 4.0, 0.2]]
    assert found(True, np.array([6.0, 7.0, 5.5, 4.9]), 3) == [
        [1.0, 2.0, 0.1],
        [1.0, 3.0, 0.1],
        [1.0, 2.0, 0.5],
    ]
    assert found(False, np.array([0.0, -0.2, -0.1, -0.3])) == [[1.0, 2.0, 0.1], [1.0, 3.0, 0.1]]
    assert len(gain_search._starts(coarse, slack, objective, False)) == 2
    # However low its objective, what is feasible comes first.
    poor = gain_search._starts(coarse[:2], np.array([0.0, -0.1]), np.array([-99.5, 0.0]), False, 1)
    assert poor[0].tolist() == [1.0, 2.0, 0.1]


def assessed(slack: Any, objective: Any, names: Any, peaks: Any = None, stable: Any = None) -> Any:
    """Judged candidates: slack (n_names, n, n_plants), objective (n, n_plants)."""
    slack, objective = np.array(slack, float), np.array(objective, float)
    none = np.zeros((0, *objective.shape))
    return SimpleNamespace(
        slack=slack,
        objective=objective,
        names=names,
        stable=np.ones(objective.shape, bool) if stable is None else np.array(stable),
        peaks=none if peaks is None else np.array(peaks),
    )  # fmt: skip


def test_margins_are_limits_and_a_target_takes_their_place() -> None:
    slack = [[[0.5, 0.3]], [[0.2, 0.4]]]
    plain = assessed(slack, [[7.0, 8.0]], ("a", "b"), [[[0.1, 0.6]]])
    limits, levels = gain_search._split(plain)
    assert limits == pytest.approx(np.array([[0.498, 0.298, 0.198, 0.398, 0.098, 0.598]]))
    assert levels.tolist() == [[7.0, 8.0]]
    aimed = assessed(slack, [[7.0, 8.0]], ("a", f"b {TARGET}"), [[[0.1, 0.6]]])
    limits, levels = gain_search._split(aimed)
    assert limits == pytest.approx(np.array([[0.198, 0.398]]))
    assert levels == pytest.approx(np.array([[0.498, 0.298, 0.098, 0.598]]))
    loops = assessed(np.ones((1, 2, 3)), np.zeros((2, 3)), "a", np.arange(12.0).reshape(2, 2, 3))
    peaks = gain_search._split(loops)[0][:, 3:]
    known = [[0.0, 6.0, 1.0, 7.0, 2.0, 8.0], [3.0, 9.0, 4.0, 10.0, 5.0, 11.0]]
    assert peaks == pytest.approx(np.array(known) - 2e-3)
    shaky = assessed(slack, [[7.0, 8.0]], ("a", "b"), stable=[[True, False]])
    assert gain_search._split(shaky)[0] == pytest.approx(np.array([[0.498, -1.702, 0.198, -1.602]]))
    found = gain_search._merit(
        np.array([[0.1, -0.02], [0.1, 0.2]]), np.array([[3.0, 2.0], [4.0, 5.0]])
    )
    assert found == pytest.approx([2.0 - 50.0 * 0.02, 4.0])


def test_a_linear_step_raises_the_lowest_level_inside_its_box() -> None:
    box = np.array([-0.5, -0.5]), np.array([0.5, 0.5])
    for limits, slopes, levels, level_slopes, known in (
        # Nothing binds: to the box's end.
        ([9.0], [[0.0, 0.0]], [1.0, 1.2], [[1.0, 0.0], [0.0, 1.0]], [0.5, None]),
        # A limit that is met at 0.2.
        ([0.2], [[-1.0, 0.0]], [1.0], [[1.0, 0.0]], [0.2, None]),
        # Two levels that pull apart meet where they are equal.
        ([9.0], [[0.0, 0.0]], [1.0, 1.3], [[1.0, 0.0], [-1.0, 0.0]], [0.15, None]),
        # A violated limit is mended first: fifty times as dear.
        ([-0.1], [[1.0, 0.0]], [1.0], [[-40.0, 0.0]], [0.1, None]),
        ([-0.1], [[1.0, 0.0]], [1.0], [[-60.0, 0.0]], [-0.5, None]),
    ):
        linear = np.array(limits), np.array(levels), np.array(slopes), np.array(level_slopes)
        step = gain_search._linear_step(linear, *box)
        assert step is not None
        assert step[0] == pytest.approx(known[0], abs=1e-6)
    lines = gain_search._lowest(np.array([1.0]), np.array([[2.0, -4.0]]), *box)
    assert lines == pytest.approx([1.0 - 1.0 - 2.0])
    corrected = gain_search._corrected(
        (np.zeros(1), np.zeros(1), np.array([[2.0, 0.0]]), np.array([[0.0, 3.0]])),
        np.array([0.1, 0.2]), np.array([[5.0]]), np.array([[7.0]]),
    )  # fmt: skip
    assert (corrected[0], corrected[1]) == (pytest.approx([4.8]), pytest.approx([6.4]))


class Bowl:
    """One plant: its objective is highest at P = 0.2 and D / P = 0.06 s, with a limit on P."""

    kinds = ("P", "D")
    low, high = np.array([0.01, 0.0]), np.array([1.0, 0.5])
    time_scale, integral_ratio = 3.0, 8.0
    requirements = SimpleNamespace(has_target=False)

    def __init__(self, most: float = 9.0) -> None:
        self.most, self.asked = most, 0

    def judge(self, gains: Array, rows: Any = None) -> Any:
        """Candidates (n, 2)."""
        self.asked += 1
        p, d = gains.T
        worth = -((np.log(p / 0.2)) ** 2) - 3.0 * (d / p / 0.3 - 0.2) ** 2
        slack = np.log(self.most / p)[None, :, None]
        return assessed(slack, worth[:, None], ("limit",))


def test_a_climb_ends_on_the_top_or_at_a_limit() -> None:
    for most, known in ((9.0, 0.2), (0.15, 0.15 * np.exp(-2e-3))):
        problem: Any = Bowl(most)
        each = _Space.of(problem)
        for start in ([0.05, 0.0], [0.8, 0.1]):
            found = gain_search._climb(problem, each, np.array(start), [0])
            assert found[0] == pytest.approx(known, rel=0.02)
            assert found[1] / found[0] == pytest.approx(0.06, rel=0.1)
            reached = problem.judge(found[None])
            assert reached.slack.min() >= 0.0
    problem = Bowl()
    each = _Space.of(problem)
    assert each.slower == 3.0
    point = each.to_point(np.array([0.1, 0.003]))
    limits, levels, limit_slopes, level_slopes = gain_search._linearised(problem, each, point, [0])
    assert limits == pytest.approx([np.log(90.0) - 2e-3])
    assert levels == pytest.approx([-(np.log(0.5) ** 2) - 3.0 * 0.01])
    assert limit_slopes == pytest.approx(np.array([[-1.0, 0.0]]), abs=1e-6)
    assert level_slopes == pytest.approx(np.array([[-2.0 * np.log(0.5), 0.6]]), abs=1e-3)
    best = gain_search._refined(problem, each, [np.array([0.9, 0.0]), np.array([0.1, 0.0])], [0])
    assert best[0] == pytest.approx(0.2, rel=0.02)


def test_the_whole_search_announces_no_more_steps_than_it_takes() -> None:
    problem: Any = Bowl()
    done: list[int] = []
    found = gain_search.search(problem, [0], done.append)
    assert found.exists
    assert found.gains[0] == pytest.approx(0.2, rel=0.02)
    assert gain_search.steps(problem) == len(_Space.of(problem).grid()) + 8 * 96
    assert sum(done) == len(_Space.of(problem).grid()) + 96
    assert max(done) == 96
    none = gain_search.search(Bowl(0.001), [0], done.append)  # type: ignore[arg-type]
    assert not none.exists
    assert none.slack["limit"] == pytest.approx(np.log(0.1), abs=0.01)


def test_plants_that_are_worst_where_something_fails_join() -> None:
    for slack, objective, rows, known in (
        ([[0.1, 0.2, -0.1]], [1.0, 1.0, 1.0], [0], [2]),
        ([[0.1, 0.2, 0.05]], [1.0, 1.0, 1.0], [0], []),
        ([[-0.2, 0.2, -0.1]], [1.0, 1.0, 1.0], [0], []),
        ([[-0.1, 0.2, -0.2]], [1.0, 1.0, 1.0], [0], [2]),
        ([[0.1, 0.1, 0.1]], [1.0, 0.9985, 1.0], [0], [1]),
        ([[0.1, 0.1, 0.1]], [1.0, 0.9995, 1.0], [0], []),
        ([[0.1, 0.1, -0.1]], [1.0, 1.0, 0.5], [0], [2]),
        ([[0.1, 0.1, -0.1]], [1.0, 0.5, 0.6], [0], [2, 1]),
        ([[0.1, 0.1, -0.1]], [1.0, 1.0, 0.5], [0, 2], []),
    ):
        judged = assessed([slack], [objective], ("a",))
        assert gain_search._violating(judged, rows) == known


def test_what_binds_is_told_within_its_edge() -> None:
    class Told:
        kinds = ("P", "I", "A")
        low, high = np.array([0.1, 0.0, 1.0]), np.array([1.0, 4.0, 9.0])
        integral_ratio = 2.0

        def judge(self, gains: Array) -> Any:
            """Two plants."""
            return assessed(np.array(self.slack)[:, None, :], [[1.0, 1.0]], ("a", "b"))

    def told(gains: list[float], slack: Any = ((1.0, 1.0), (1.0, 1.0))) -> Any:
        problem: Any = Told()
        problem.slack = slack
        return gain_search._report(problem, np.array(gains))

    free = [0.5, 0.5, 5.0]
    for slack, exists, binding in (
        (((1.0, 0.0239), (1.0, 1.0)), True, ("a",)),
        (((1.0, 0.0241), (1.0, 1.0)), True, ()),
        (((1.0, 1.0), (0.0, 1.0)), True, ("b",)),
        (((1.0, 1.0), (-1e-9, 1.0)), False, ("b",)),
        (((1.0, 0.0039), (-0.1, 1.0)), False, ("a", "b")),
        (((1.0, 0.0041), (-0.1, 1.0)), False, ("b",)),
    ):
        found = told(free, slack)
        assert (found.exists, found.binding) == (exists, binding)
        assert found.slack == {"a": min(slack[0]), "b": min(slack[1])}
    for gains, binding in (
        ([0.9991, 0.5, 5.0], ("range of P",)),
        ([0.9989, 0.5, 5.0], ()),
        ([0.10009, 0.1, 5.0], ("range of P",)),
        ([0.10011, 0.1, 5.0], ()),
        ([0.5, 0.9991, 5.0], ("ratio of I to P",)),
        ([0.5, 0.9989, 5.0], ()),
        ([0.5, 0.0, 1.0], ()),
        ([0.5, 0.5, 8.9911], ("range of the angle's P",)),
        ([0.5, 0.5, 8.9909], ()),
    ):
        assert told(gains).binding == binding, gains
