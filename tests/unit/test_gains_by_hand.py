"""Gains set by hand: judged as they stand, the same on a slider, in a tuning and in a study."""

from __future__ import annotations

import re

import numpy as np
import pytest

import flightid as fid
from flightid.control.tuning.findings import verdict
from flightid.control.tuning.gain_search_result import GainSearchResult
from flightid.control.tuning.moved_gains import move_gains
from flightid.control.tuning.worst_cases import WorstCase
from flightid.conventions import Light
from flightid.errors import DataError, OptionError
from tests.unit.test_tuning import FLOWN, NEED, _fit

GENTLE = {"ATC_RAT_RLL_P": 0.06, "ATC_ANG_RLL_P": 3.2}


@pytest.fixture(scope="module")
def fit() -> fid.Fit:
    return _fit()


@pytest.fixture(scope="module")
def found(fit: fid.Fit) -> fid.PidDesign:
    return fid.tune_pid(fit, gains=FLOWN, requirements=NEED, draws=20)


def test_gains_of_the_search_by_hand_promise_what_the_search_promised(
    fit: fid.Fit, found: fid.PidDesign
) -> None:
    again = fid.tune_pid(fit, gains=FLOWN, requirements=NEED, draws=20, by_hand=found.gains)
    assert again.exists
    assert [each.to_dict() for each in again.worst_cases] == [
        each.to_dict() for each in found.worst_cases
    ]
    assert again.gains == found.gains
    assert [stage.gains for stage in again.stages] == [stage.gains for stage in found.stages]


def test_a_slider_shows_the_numbers_of_the_tuning(fit: fid.Fit, found: fid.PidDesign) -> None:
    held = fid.tune_pid(fit, gains=FLOWN, requirements=NEED, draws=20, by_hand=GENTLE)
    as_flown = {name: FLOWN.gains[name] for name in found.gains}
    moved = move_gains(found, as_flown | GENTLE)
    assert [each.to_dict() for each in moved.worst_cases] == [
        each.to_dict() for each in held.worst_cases
    ]
    assert held.gains == dict(moved.values) == as_flown | GENTLE
    # Far from every requirement none binds: the nearest one is called that.
    assert held.exists
    assert held.binding == ()
    assert "binding: nothing; nearest: angle loop: phase margin" in moved.finding.message
    assert bool(moved.met.all()) == held.exists == (not moved.short)
    for mine, theirs in zip(moved.responses, held.responses, strict=True):
        np.testing.assert_allclose(mine.estimate, theirs.estimate, rtol=0.0, atol=1e-12)
        assert np.all(mine.low >= theirs.low - 1e-12)
    # The loop of the estimate passes −180° + margin where its gain is one.
    loop, omega = moved.loops["estimate"], moved.omega_rad_s
    crossing = held.worst_case("whole loop", "crossover").nominal or 0.0
    phase = np.degrees(np.interp(crossing, omega, np.unwrap(np.angle(loop)))) % 360.0
    margin = held.worst_case("whole loop", "phase margin").nominal
    assert phase - 180.0 == pytest.approx(margin, abs=0.3)


def _shown_as_judged(case: WorstCase) -> bool:
    """Whether the worst, as it is shown, stands to what is asked, as that is shown, as it is."""
    shown = case.shown_worst[0]
    if shown is None or not case.required:
        return True
    sides = [each.split() for each in case.required.split(" and ")]
    kept = [shown >= float(b) if sign == "≥" else shown <= float(b) for sign, b in sides]
    return all(kept) == case.met


def _edge(found: fid.PidDesign, gain: str) -> tuple[float, float]:
    """The largest of a gain that every plant stands, and the least that one does not."""
    low, high = found.gains[gain], 4.0 * found.gains[gain]
    for _ in range(14):
        middle = (low * high) ** 0.5
        short = (~move_gains(found, {gain: middle}, responses=False).met).sum()
        low, high = (middle, high) if short < 1 else (low, middle)
    return low, high


@pytest.mark.parametrize("gain", ["ATC_RAT_RLL_P", "ATC_RAT_RLL_D"])
def test_numbers_are_shown_on_the_side_of_their_limit_on_which_they_are_judged(
    found: fid.PidDesign, gain: str
) -> None:
    """Noise of 1.1238, rounded to the worse, stood as 1.13 beside ≤ 1.124 and had passed."""
    for value in _edge(found, gain):
        for case in move_gains(found, {gain: value}, responses=False).worst_cases:
            assert _shown_as_judged(case), (case, case.required, case.shown_worst)


def test_one_plant_short_is_one_light_on_the_slider_in_the_tuning_and_in_the_files(
    fit: fid.Fit, found: fid.PidDesign
) -> None:
    # The largest P that one plant of 21 does not stand: amber, for so few were drawn, and written.
    _, high = _edge(found, "ATC_RAT_RLL_P")
    bold = {**found.gains, "ATC_RAT_RLL_P": float(f"{1.0005 * high:.6g}")}
    moved = move_gains(found, bold, responses=False)
    held = fid.tune_pid(fit, gains=FLOWN, requirements=NEED, draws=20, by_hand=bold)
    assert ((~moved.met).sum(), bool(moved.short)) == (1, True)
    assert moved.finding == held.findings[0]
    assert (held.exists, moved.finding.light) == (True, Light.AMBER)
    assert "20 of 21 fresh plants" in moved.finding.message
    assert move_gains(found, {}, responses=False).finding == found.findings[0]


def test_gains_by_hand_that_break_a_requirement_are_red_and_not_written(
    fit: fid.Fit, tmp_path_factory: pytest.TempPathFactory
) -> None:
    folder = tmp_path_factory.mktemp("gains")
    bold = {"ATC_RAT_RLL_P": 0.45, "ATC_RAT_RLL_I": 0.45, "ATC_RAT_RLL_D": 0.02}
    made = fid.tune_pid(fit, gains=FLOWN, requirements=NEED, draws=20, by_hand=bold)
    assert not made.exists
    assert made.findings[0].light is Light.RED
    assert "set by hand do not meet" in made.findings[0].message
    # Which margin, by how much: the plant that misses it most beside what is asked of it.
    case = made.worst_case("rate loop", "phase margin")
    least, shown = float(case.required.removeprefix("≥ ")), case.shown_missed or 0.0
    said = f"rate loop: phase margin {shown:.3g} deg, {least - shown:.3g} deg "
    with pytest.raises(DataError, match=r"gains of roll do not .* found the gains set") as no:
        made.write(folder / "gains.param")
    assert f"{said}short of {case.required} (" in str(no.value)
    # What may be at most so much is above it; none is short of a largest value.
    above = re.search(
        r"crossover ([\d.]+) rad/s, ([\d.]+) rad/s above ≤ ([\d.]+) \(", str(no.value)
    )
    assert above is not None
    value, over, most = map(float, above.groups())
    assert value - most == pytest.approx(over, abs=0.006 * value)
    assert "short of ≤" not in str(no.value)
    # The numbers beside the crosses are of the same plants, promised or not.
    broken = [each for each in made.worst_cases if not each.met]
    assert broken
    for each in broken:
        value = f" {each.shown_missed:.{each.digits}g}"
        whose = rf"\({each.n_missed} of {each.n_plants} plants\)"
        assert re.search(rf"{re.escape(value)}\b[^;]*{whose}", str(no.value)), each
    assert {each.n_missed for each in made.worst_cases if each.met} == {0}
    assert "no gains meet" not in fid.Tuning((made,), ()).left_out["roll"]
    assert not list(folder.iterdir())


@pytest.mark.parametrize("by_hand", [True, False])
def test_an_unstable_loop_is_called_that_and_its_margins_are_no_shares(by_hand: bool) -> None:
    slack = {"stability": 2.0, "loop: phase margin": -0.4, "loop: sensitivity peak": -1.8}
    short = GainSearchResult(np.ones(3), False, ("loop: phase margin",), slack, by_hand)
    said = verdict(short, np.zeros(3, bool), 3).message
    assert said.endswith(": loop: phase margin -40 %, loop: sensitivity peak")
    slack = {"stability": -1.0, "loop: phase margin": -2.31}
    unstable = GainSearchResult(np.ones(3), False, ("stability",), slack, by_hand)
    said = verdict(unstable, np.zeros(3, bool), 3).message
    assert said.endswith(": some plant is unstable with them")
    assert "%" not in said
    # So many of as many bound the share of all that are like them: 0.05 to the power of 1 / n.
    good = GainSearchResult(np.ones(3), True, ("range of P",), {"stability": 2.0}, by_hand)
    for count in (10, 58, 59, 300):
        said = verdict(good, np.ones(count, bool), count).message
        share = np.floor(1000.0 * 0.05 ** (1.0 / count)) / 10.0
        assert f"{count} of {count} fresh plants" in said
        assert f": at least {share:.1f} % of those that the data allow (95 % confidence)" in said


def test_gains_by_hand_that_no_axis_has_are_refused_by_name(fit: fid.Fit) -> None:
    with pytest.raises(OptionError, match="ATC_RAT_PIT_P"):
        fid.tune_pid(fit, gains=FLOWN, by_hand={"ATC_RAT_PIT_P": 0.1})
    with pytest.raises(OptionError, match=r"0\.01 to 0\.5"):
        fid.tune({"roll": fit}, gains={"roll": FLOWN}, by_hand={"ATC_RAT_RLL_P": 5.0})
