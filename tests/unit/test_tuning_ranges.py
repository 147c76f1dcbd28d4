"""Ranges of the autopilot's documentation reach the gains that flew."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

import flightid as fid
from flightid.control.autopilots import axis_loop
from flightid.control.tuning.controller_paths import ControllerPaths
from flightid.control.tuning.findings import _behind_rate_loop, low_coherence
from flightid.control.tuning.flown_gains import require_known
from flightid.control.tuning.gain_steps import reached
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
    assert 1.0 <= design.gains[ANGLE] < 3.0
    (angle,) = (each for each in design.changes if each.name == ANGLE)
    assert angle.ends == (1.0, 12.0)
    assert angle.at_limit == (design.gains[ANGLE] < 1.0 + 0.0132)
    assert any("which reaches what flew" in each.message for each in design.findings)


def test_a_gain_that_could_be_lower_is_named_where_there_are_none() -> None:
    """The same vehicle, flown at the least angle gain that is documented: none is lower."""
    slow = fid.load_model("rate_integrator", axis="roll").with_values({"Ltphi": 90.0, "tau": 0.06})
    usual = SLOW.with_gains({ANGLE: 3.0})
    design = fid.tune_pid(slow, gains=usual, band_rad_s=(0.3, 27.0), nominal=True)
    assert not design.exists
    assert "range of the angle's P (low end)" in design.binding
    (said,) = (each for each in design.findings if each.code == "no-gains")
    assert said.message.endswith("at the low end of the range of the angle's P")
    assert "below its documented range" in said.action


def test_the_gentler_end_of_a_time_constant_is_its_upper_one() -> None:
    assert reached(0.2, 1.0, 1.4, "s") == (0.2, 2.8)
    assert reached(0.2, 1.0, 0.1, "s") == (0.1, 1.0)
    assert reached(3.0, 12.0, 2.0, "1/s") == (1.0, 12.0)


def test_ranges_stay_with_what_flew_while_gains_move() -> None:
    moved = SLOW.with_gains({ANGLE: 4.0, "ATC_RAT_RLL_I": 0.1})
    low, high = ControllerPaths(moved, "filtered", True, SLOW).ranges()
    assert low.tolist() == [0.01, 0.002, 0.0, 1.0]
    assert high.tolist() == [0.5, 2.0, 0.05, 12.0]
    # No logarithm starts from zero: a thousandth of the upper end; D may be none.
    roles = ("p", "i", "d", "angle_p")
    zero = {name: replace(each, low=0.0) for name, each in moved.ranges.items()}
    from_zero = SimpleNamespace(
        roles=roles,
        names=tuple(moved.names[role] for role in roles),
        loop=SimpleNamespace(ranges=zero, unit_of=moved.unit_of),
        flown=SimpleNamespace(has_flown=False),
    )
    least, most = ControllerPaths.ranges(from_zero)  # type: ignore[arg-type]
    assert least.tolist() == pytest.approx([1e-3 * most[0], 1e-3 * most[1], 0.0, 1e-3 * most[3]])
    fast = SLOW.with_gains({ANGLE: 14.0})
    assert ControllerPaths(fast, "filtered", True).ranges()[1][-1] == 14.0


def test_gains_by_hand_may_stand_where_they_flew() -> None:
    require_known({ANGLE: 1.0}, [SLOW])
    with pytest.raises(OptionError, match=r"ATC_ANG_RLL_P = 0.9 \(1 to 12\)"):
        require_known({ANGLE: 0.9}, [SLOW])


def test_a_rate_loop_makes_up_for_what_an_angle_loop_was_not_shown() -> None:
    """Around k/s it leaves ω² / (ω² + k²) of an error: of three times slower loops a tenth."""
    omega = np.geomspace(0.1, 100.0, 300)

    def said(crossover: float, loop: str) -> list[str]:
        rate = (6.0 / (1j * omega))[None, None]
        plants = SimpleNamespace(omega_rad_s=omega, take=lambda rows: None)
        problem = SimpleNamespace(plants=plants, loops=lambda *_: SimpleNamespace(rate=rate))
        case = SimpleNamespace(name="crossover", nominal=crossover, loop=loop)
        found = SimpleNamespace(exists=True, gains=np.ones(2))
        measured = SimpleNamespace(omega_rad_s=omega, coherence=0.3 + 0.0 * omega)
        result = SimpleNamespace(found=found, worst_cases=[case], problem=problem)
        known = _behind_rate_loop(result, omega, measured.coherence)
        left = omega**2 / (omega**2 + 36.0)
        assert known == pytest.approx(0.3 / (0.3 + 0.7 * left), rel=1e-9)
        return [each.message for each in low_coherence(result, measured)]

    assert said(2.0, "angle loop") == []
    assert said(6.0, "angle loop") == [
        "angle loop: coherence is 0.30 about the new crossover of 6 rad/s"
    ]
    assert len(said(2.0, "rate loop")) == 1
