"""What Compare says of numbers and loops that it does not show, with the reason of each."""

from __future__ import annotations

import pytest

pytest.importorskip("fastapi", reason="the extra app is not installed")

import numpy as np

from flightid.app.compare_work import _part
from flightid.dynamics.conditions.ratios import difference_of
from flightid.review.changes import LoopChange
from flightid.review.comparison import FlightComparison
from flightid.review.loop_response import LoopResponse
from flightid.uncertainty.estimate import Estimate, Reading

NONE = np.empty(0)


def _loop(name: str, reason: str = "") -> LoopResponse:
    axis, _, loop = name.partition(" ")
    step = NONE if reason else np.linspace(0.0, 1.0, 20)
    return LoopResponse(
        axis, loop, "", "", 10.0, 25.0, 1, 1.0, None, 0.1 * np.arange(step.size),
        step, np.vstack([0.9 * step, 1.1 * step]), reason=reason,
    )  # fmt: skip


def _change(loop: str, before: Reading, after: Reading) -> LoopChange:
    return LoopChange(loop, before.name, before, after, difference_of(before, after), None)


def _compared(
    before: tuple[LoopResponse, ...], after: tuple[LoopResponse, ...],
    *changes: LoopChange, promised: bool = False,
) -> list[str]:  # fmt: skip
    made = FlightComparison(
        ("a.bin", "b.bin"), promised, changes, before, after, {}, {}, {}, (), ()
    )
    return _part(made, None).notes


def test_loops_that_one_side_alone_tells_are_named_with_the_reason() -> None:
    still = _loop("yaw rate", "the sticks did not move it")
    assert _compared((_loop("roll rate"), still), (_loop("yaw rate"),)) == [
        "a.bin does not tell yaw rate: the sticks did not move it.",
        "b.bin logs no set-point of roll rate.",
    ]


def test_loops_that_no_model_promises_are_named_with_the_reason() -> None:
    flown = tuple(_loop(each) for each in ("roll rate", "roll attitude", "yaw rate"))
    assert _compared((_loop("roll rate"),), flown, promised=True) == [
        "The models promise nothing of roll attitude: its set-point acts by more than the angle "
        "controller.",
        "The models promise nothing of yaw rate: none of them is of its rate.",
    ]


def test_numbers_that_are_dashes_have_their_reason_by_the_names_of_the_columns() -> None:
    told = Estimate[float | None]("rise time", 0.1, "s")
    late = Estimate[float | None]("rise time", None, "s", reason="it does not settle")
    both = ((_loop("roll rate"),),) * 2
    assert "– of after: roll rate (rise time): it does not settle." in _compared(
        *both, _change("roll rate", told, late)
    )
    assert "– of promised: roll rate (rise time): it does not settle." in _compared(
        *both, _change("roll rate", late, told), promised=True
    )
