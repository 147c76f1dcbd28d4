"""Promises of tuned gains, flown in simulators that are not flightid's own."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

import flightid as fid
from flightid.control.tuning import tune_pid
from tests.closeness import assert_close
from tests.strangers import gains, hover, rig_gains
from tests.strangers.gain_counts import Outcome, table

RUNS = 30
LOST = 0.25
"""Share of good gains that may be refused in so few: 500 are counted by hand (docs/tuning.md)."""


@pytest.mark.slow
@pytest.mark.parametrize("tried", [gains.tried, rig_gains.tried], ids=["hover", "rig"])
def test_gains_keep_what_they_promise(
    tried: Callable[[int], Outcome], monkeypatch: pytest.MonkeyPatch
) -> None:
    """None of 60 tunings breaks a promise, green or amber; few good ones are lost."""
    monkeypatch.setattr(tune_pid, "response_bands", lambda *_: ())
    judge([tried(seed) for seed in range(RUNS)])


def judge(outcomes: list[Outcome]) -> None:
    """Promises without exception, lost gains by share."""
    made, said = [each for each in outcomes if each.is_made], table(outcomes)
    assert made, said
    assert not [each.row() for each in made if each.broken], said
    lost = sum(each.wasted for each in outcomes)
    held = sum(each.right and not each.broken for each in made)
    assert lost <= LOST * (held + lost), said


def test_a_broken_promise_is_counted_whatever_was_said_of_it() -> None:
    kept = Outcome(0, "rig", "order", "oe", True, "green", "", "", 1.0)
    judge([kept] * 8)
    missed = replace(kept, broken="loop: gain margin 9.2, promised 9.6", verdict="amber")
    lost = replace(kept, verdict="refused", wasted=True)
    for wrong in ([missed], [replace(missed, verdict="green")], [lost] * 4):
        with pytest.raises(AssertionError):
            judge([kept] * 8 + wrong)


def test_margins_of_an_undamped_vehicle_are_those_of_flightid() -> None:
    """Two integrators share a pole, which eigenvectors cannot tell apart."""
    craft = hover.vehicle("motor lag", effect=80.0, motor_s=0.05, delay=3)
    flown = hover.Gains(p=0.06, i=0.03, d=0.001, angle_p=3.0)
    loop = hover.Axis(craft, flown).loops()["whole loop"]
    plant = fid.LinearSystem(
        craft.a, craft.b[:, None], np.eye(3)[[1, 2]], np.zeros((2, 1)), ("u",), ("p", "phi"),
        [craft.delay * hover.STEP_S],
    ).sampled(hover.STEP_S)  # fmt: skip
    axis = gains.loop_of(flown, gains.drawn(0)).with_gains(INS_GYRO_FILTER=craft.gyro_hz)
    rate, angle = plant.frequency_response(hover.GRID)[:, 0]
    own = axis.feedback(hover.GRID, with_hold=False) * rate
    own = own + axis.forward(hover.GRID, with_hold=False) * axis.angle(hover.GRID) * angle
    assert_close(loop, own, rtol=2e-3, why="single-precision filters apart, the same loop")


def test_a_flexible_frame_bends_beside_the_body() -> None:
    """Its response is the sum of a damped rate and of a mode, behind the hold."""
    effect, damping, frame = 90.0, -2.0, (60.0, 0.02, 0.1)
    craft = hover.vehicle("frame", effect=effect, damping=damping, frame=frame, delay=0)
    s, (w, zeta, share) = 1j * np.array([5.0, 40.0, 60.0, 90.0]), frame
    wanted = effect / (s - damping) + share * effect * s / (s**2 + 2 * zeta * w * s + w**2)
    pencil = s[:, None, None] * np.eye(len(craft.a)) - craft.a
    found = np.linalg.solve(pencil, craft.b.astype(complex)[:, None])[:, -2, 0]
    assert_close(found, wanted, rtol=1e-10, why="exact")


def test_a_rate_that_grows_by_itself_has_gains_whose_angle_loop_is_stable() -> None:
    """The rate loop holds its pole; broken at the angle the loop has none outside the circle."""
    craft = hover.vehicle("motor lag", effect=96.0, damping=0.15, motor_s=0.06, delay=3)
    plant = fid.LinearSystem(
        craft.a, craft.b[:, None], np.eye(3)[[1]], [[0.0]], ("tau_phi",), ("p",),
        [craft.delay * hover.STEP_S],
    )  # fmt: skip
    flown = hover.Gains(p=0.056, i=0.033, d=8.5e-4, angle_p=1.8)
    asked = {"gyro": "raw", "nominal": True, "draws": 1, "band_rad_s": (0.1, 100.0)}
    values = {name: getattr(flown, key) for key, name in gains.NAMES.items()}
    loop = fid.axis_loop("arducopter", "roll", loop_rate_hz=1 / hover.STEP_S).with_gains(values)
    design = fid.tune_pid(plant, gains=loop, **asked)
    assert design.exists
    new = replace(flown, **{key: design.gains[name] for key, name in gains.NAMES.items()})
    axis = hover.Axis(replace(craft, gyro_hz=loop.gains["INS_GYRO_FILTER"]), new)
    assert np.abs(axis.poles()).max() < 1.0
    phase, _ = hover.margins(axis.loops()["angle loop"])
    said = design.worst_case("angle loop", "phase margin").worst
    assert_close(said, phase, atol=gains.TOLERANCE["phase margin"], why="two grids")
