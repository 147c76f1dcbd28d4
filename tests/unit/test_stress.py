"""A few random runs: every end is a result with sound bars or a typed error."""

from __future__ import annotations

import pytest

from tests.stress.runs import bad_bars, run

BROKE = (
    367, 420, 620, 777, 891, 1090, 1365, 1655, 3256, 3437, 4209, 4674, 9255, 11944, 16738, 17154,
    22366, 28002, 66651,
)  # fmt: skip
"""Seeds that once ended in an untyped error or in a standard error of zero."""


@pytest.mark.parametrize("seed", BROKE)
def test_seeds_that_broke_end_in_a_result_or_a_typed_error(seed: int) -> None:
    assert run(seed)


def test_random_runs_end_in_a_result_or_a_typed_error() -> None:
    assert {run(seed) for seed in range(4)} > {"DataError"}


def test_bad_bars_are_found() -> None:
    tree = {"a": [{"stderr": 0.0}, {"stderr": None}, {"stderr": [1.0, float("inf")]}]}
    assert len(list(bad_bars(tree))) == 2
