"""Every printed 95 % interval holds what it says on flights of simulators that are not ours."""

from __future__ import annotations

import pytest

from tests.strangers.cases import CASES
from tests.strangers.counting import Case, Tally, count, limits, table

RUNS = 500
LOWEST, HIGHEST = 0.93, 0.97
"""What is promised; chance widens it by three standard deviations of a count."""


def judged(case: Case, tally: Tally) -> None:
    """No bad bar, every quantity held as promised, and green seldom beside a miss.

    Where a false hold was told, the bars, or the bars moved by what a light other than green says
    of the true hold, have the truth; they may oftener, for some reach that hold already.
    """
    assert tally.bad_bars() == 0
    for quantity in tally.quantities():
        share, n = tally.coverage(quantity, true_hold=case.true_hold)
        if not n:  # nothing was printed, so nothing was claimed
            continue
        low, _ = limits(n, nominal=LOWEST)
        _, high = limits(n, nominal=HIGHEST)
        high = 1.0 if case.true_hold else high
        assert low <= share <= high, f"{quantity}\n{table([tally])}"
    assert tally.green_and_missed() <= tally.ceiling(), table([tally])


@pytest.mark.slow
@pytest.mark.parametrize("case", CASES, ids=lambda case: case.name)
def test_intervals_hold_and_green_seldom_misses(case: Case) -> None:
    judged(case, count(case, RUNS))
