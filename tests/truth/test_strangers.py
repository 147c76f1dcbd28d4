"""Every printed 95 % interval holds what it says on flights of simulators that are not ours."""

from __future__ import annotations

import pytest

from tests.strangers.cases import CASES
from tests.strangers.counting import Case, count, limits, table

RUNS = 500
LOWEST, HIGHEST = 0.93, 0.97
"""What is promised; chance widens it by three standard deviations of a count."""


@pytest.mark.slow
@pytest.mark.parametrize("case", CASES, ids=lambda case: case.name)
def test_intervals_hold_and_green_seldom_misses(case: Case) -> None:
    tally = count(case, RUNS)
    assert tally.bad_bars() == 0
    for quantity in tally.quantities():
        share, n = tally.coverage(quantity)
        if not n:  # nothing was printed, so nothing was claimed
            continue
        low, _ = limits(n, nominal=LOWEST)
        _, high = limits(n, nominal=HIGHEST)
        assert low <= share <= high, f"{quantity}\n{table([tally])}"
    assert tally.green_and_missed() <= tally.ceiling(), table([tally])
