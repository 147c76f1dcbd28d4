"""Ranges of the autopilot's documentation reach the gains that flew."""

from __future__ import annotations

import pytest

import flightid as fid
from flightid.control.autopilots import axis_loop
from flightid.control.tuning.controller_paths import ControllerPaths
from flightid.control.tuning.flown_gains import require_known
from flightid.errors import OptionError

ANGLE = "ATC_ANG_RLL_P"
SLOW = axis_loop("arducopter", "roll", loop_rate_hz=400.0).with_gains(
    ATC_RAT_RLL_P=0.04, ATC_RAT_RLL_I=0.004, ATC_RAT_RLL_D=0.0, ATC_ANG_RLL_P=2.0
)


def test_a_slow_vehicle_has_gains_below_the_documented_range_where_it_flew_there() -> None:
    """Its crossover of at most 9 rad/s leaves no room for an angle gain of 3, the least told."""
    slow = fid.load_model("rate_integrator", axis="roll").with_values({"Ltphi": 90.0, "tau": 0.06})
    design = fid.tune_pid(slow, gains=SLOW, band_rad_s=(0.3, 27.0), nominal=True)
    assert SLOW.ranges[ANGLE].low == 3.0
    assert design.exists
    assert 2.0 <= design.gains[ANGLE] < 3.0
    (angle,) = (each for each in design.changes if each.name == ANGLE)
    assert angle.ends == (2.0, 12.0)
    assert angle.at_limit == (design.gains[ANGLE] < 2.0 + 0.0132)
    assert any("which reaches what flew" in each.message for each in design.findings)


def test_ranges_stay_with_what_flew_while_gains_move() -> None:
    moved = SLOW.with_gains({ANGLE: 4.0, "ATC_RAT_RLL_I": 0.1})
    low, high = ControllerPaths(moved, "filtered", True, SLOW).ranges()
    assert low.tolist() == [0.01, 0.004, 0.0, 2.0]
    assert high.tolist() == [0.5, 2.0, 0.05, 12.0]
    fast = SLOW.with_gains({ANGLE: 14.0})
    assert ControllerPaths(fast, "filtered", True).ranges()[1][-1] == 14.0


def test_gains_by_hand_may_stand_where_they_flew() -> None:
    require_known({ANGLE: 2.0}, [SLOW])
    with pytest.raises(OptionError, match=r"ATC_ANG_RLL_P = 1.9 \(2 to 12\)"):
        require_known({ANGLE: 1.9}, [SLOW])
