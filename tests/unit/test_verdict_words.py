"""Verdicts of the inspection, word by word, at both sides of each of their limits."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import pytest

from flightid.conventions import Light
from flightid.inspection import advice, verdicts
from flightid.inspection.excitation_found import FoundExcitation
from flightid.inspection.flight_phases import FlightPhases
from flightid.inspection.gap_findings import _in_flight, _longest
from flightid.inspection.inspection import Inspection
from flightid.inspection.rates import StreamRate
from flightid.inspection.saturation import Saturation
from flightid.inspection.skew import StreamSkew
from flightid.inspection.usable_band import UNSWEPT, AxisBand, _fitted

LOG: Any = None
HERTZ = math.tau
PHASES = FlightPhases(((0.0, 40.0), (50.0, 110.5)), True, None, "throttle")
SEEN = Inspection("a", "px4", "", "copter", 120.0, (), PHASES, (), (), (), ())


@pytest.fixture(autouse=True)
def _advice(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(advice, "logging", lambda _: "log faster")
    monkeypatch.setattr(advice, "excitation", lambda _: "sweep")
    monkeypatch.setattr(advice, "more_injected", lambda _: "inject more")
    monkeypatch.setattr(advice, "record_length", lambda *_: "fly longer")


def _band(low_hz: float, high_hz: float, **told: Any) -> AxisBand:
    coherent = (HERTZ * low_hz, HERTZ * high_hz)
    known = {"band_rad_s": _fitted(coherent), "coherence": 0.876, "coherent_rad_s": coherent}
    return replace(
        AxisBand("roll", "m", "p", 100.0, None, None, rates_hz=(100.0, 400.0)), **known | told
    )


def _told(findings: list[Any]) -> list[tuple[str, str, str]]:
    return [(each.code, each.light.value, each.message) for each in findings]


@pytest.mark.parametrize(
    ("rate_hz", "code", "words"),
    [
        (29.9, "rate-too-low", "no model above 3 Hz at ten samples a cycle (6 Hz"),
        (30.0, "rate-limited", "the model ends at 3 Hz at ten samples a cycle (6 Hz"),
        (99.0, "rate-limited", "the model ends at 9.9 Hz at ten samples a cycle (20 Hz"),
        (100.0, "rate-good", "up to 10 Hz at ten samples a cycle (20 Hz"),
    ],
)
def test_a_rate_of_logging_says_where_a_model_ends(rate_hz: float, code: str, words: str) -> None:
    slow = _band(1.0, 5.0, rate_hz=rate_hz, rates_hz=(rate_hz, rate_hz))
    quick = _band(1.0, 5.0, rate_hz=400.0, rates_hz=(400.0, 400.0))
    unlogged = _band(1.0, 5.0, rate_hz=0.0, rates_hz=None)
    light = {"rate-too-low": "red", "rate-limited": "amber", "rate-good": "green"}[code]
    said = _told(verdicts._logging(LOG, replace(SEEN, bands=(unlogged, quick, slow))))
    assert said == [
        (code, light, f"m and p are logged at {rate_hz:.4g} Hz: {words} at the very most)")
    ]
    ((code, _, words),) = _told(verdicts._logging(LOG, replace(SEEN, bands=(unlogged,))))
    assert (code, words[:39]) == ("no-command-logged", "no axis has both its mixer command and ")


NARROW = ": too narrow for more than a gain"
LESS = "; gain, lag and delay are told apart by a whole decade"


@pytest.mark.parametrize(
    ("ends_hz", "light", "said", "why"),
    [
        ((1.0, 2.99), "amber", "coherent from 1 to 2.99 Hz (6.28 to 18.8 rad/s)", NARROW),
        ((1.0, 3.01), "amber", "usable from 2.01 to 3.01 Hz (12.6 to 18.9 rad/s)", LESS),
        ((1.0, 9.9), "amber", "usable from 2.01 to 9.9 Hz (12.6 to 62.2 rad/s)", LESS),
        ((1.0, 10.1), "green", "usable from 2.01 to 10.1 Hz (12.6 to 63.5 rad/s)", ""),
    ],
)
def test_a_band_is_called_by_its_width(
    ends_hz: tuple[float, float], light: str, said: str, why: str
) -> None:
    whole = f"roll: {said}, mean coherence 0.88"
    (found,) = _told([verdicts._band(LOG, _band(*ends_hz))])
    assert found == ("narrow-band-roll" if why == NARROW else "band-roll", light, whole + why)
    ends = _band(*ends_hz, excited_to_rad_s=HERTZ * ends_hz[1])
    ended = verdicts._band(LOG, ends).message
    assert ended == f"{whole}, up to where the power of the sweep ends{why}"
    without = replace(ends, coherent_rad_s=None, band_rad_s=None, reason="nothing was flown")
    assert verdicts._band(LOG, without).message == "roll: no usable band: nothing was flown"


def test_coherence_of_an_axis_that_nobody_swept_is_no_green() -> None:
    """A hover's roll read green, "coherent from 0.329 to 38.4 Hz": it was the controller's."""
    still = _band(1.0, 20.0, coherent_rad_s=None, band_rad_s=None, reason=UNSWEPT)
    (said,) = verdicts._bands(LOG, replace(SEEN, bands=(still,)))
    assert (said.code, said.light) == ("unswept-roll", Light.UNKNOWN)
    assert said.message.startswith("roll: no usable band: in a loop without a sweep")
    found = replace(SEEN, bands=(still,), findings=(said,))
    assert found.verdict is Light.GREEN, "of what was flown for a model nothing is in doubt"
    assert found.findings_on(()) == ()


def test_without_a_band_the_largest_coherence_is_told_by_axis() -> None:
    none = replace(_band(1.0, 2.0), coherent_rad_s=None, band_rad_s=None, reason="noise")
    roll, pitch = replace(none, largest_coherence=0.523), replace(none, axis="pitch")
    codes = [each.code for each in verdicts._bands(LOG, replace(SEEN, bands=(roll, pitch)))]
    assert codes == ["no-band-roll", "no-band-pitch", "no-usable-band"]
    last = verdicts._bands(LOG, replace(SEEN, bands=(roll, pitch)))[-1]
    assert last.message.endswith("coherence of at least 0.6 is needed (largest found: roll 0.52)")
    (_, last) = verdicts._bands(LOG, replace(SEEN, bands=(pitch,)))
    assert last.message.endswith("(none could be measured)")
    assert verdicts._bands(LOG, replace(SEEN, bands=(replace(pitch, rate_hz=0.0),)))[0].code == (
        "no-usable-band"
    )
    weak = replace(pitch, largest_coherence=0.99, injected_coherence=0.234)
    last = verdicts._bands(LOG, replace(SEEN, bands=(roll, weak)))[-1]
    assert last.message.endswith(
        "needed (largest found of the rate with what was injected: pitch 0.23; largest found: "
        "roll 0.52)"
    ), "coherence that nobody asked for is high, and none of what lacks"
    actions = [each.action for each in verdicts._bands(LOG, replace(SEEN, bands=(roll, weak)))]
    assert actions == ["sweep", "inject more", "inject more"], "not a piloted sweep"
    wide = _band(1.0, 20.0)
    assert [e.code for e in verdicts._bands(LOG, replace(SEEN, bands=(wide,)))] == ["band-roll"]


def test_a_flight_is_told_by_its_time_and_its_end() -> None:
    (found,) = verdicts._flight(LOG, SEEN)
    assert found.message == "airborne for 100.5 s in 2 spans (throttle)"
    fallen = replace(SEEN, phases=replace(PHASES, airborne=((0.0, 40.0),), tipped_s=71.25))
    first, second = verdicts._flight(LOG, fallen)
    assert first.message == "airborne for 40.0 s in 1 span (throttle)"
    assert second.message.startswith(
        "the vehicle falls over at 71.2 s of the autopilot's clock and"
    )
    ground = replace(PHASES, airborne=(), evidence="throttle below 5 %")
    moved = (FoundExcitation("hand", "roll", 0.0, 9.0, ""),)
    for phases, excited, code, light in (
        (replace(ground, motors_ran=False), moved, "motors-off", Light.RED),
        (replace(ground, motors_ran=False), (), "not-airborne", Light.RED),
        (ground, moved, "not-airborne", Light.RED),
        (replace(ground, is_known=False), moved, "flight-unknown", Light.UNKNOWN),
    ):
        (found,) = verdicts._flight(LOG, replace(SEEN, phases=phases, excitations=excited))
        assert (found.code, found.light) == (code, light)


def test_a_short_flight_says_how_far_down_it_reaches() -> None:
    """Ten cycles of 0.3 Hz: 33.3 s."""
    short, long = (replace(PHASES, airborne=((0.0, s),)) for s in (33.3, 33.4))
    assert verdicts._length(replace(SEEN, phases=long)) == []
    (found,) = verdicts._length(replace(SEEN, phases=short))
    assert found.message == (
        "33.3 s in the air: five independent windows of two cycles reach down to 0.3 Hz only"
    )


def _excited(kind: str, axis: str, detail: str) -> FoundExcitation:
    return FoundExcitation(kind, axis, 1.0, 9.0, detail)


def test_what_excited_the_vehicle_is_listed_up_to_six() -> None:
    made = tuple(_excited("steps", f"axis {k}", f"{k} steps") for k in range(7))
    (found,) = verdicts._excitation(LOG, replace(SEEN, excitations=made), [])
    assert found.message.startswith("excitation found: steps on axis 0 (0 steps); steps on axis 1")
    assert found.message.endswith("steps on axis 5 (5 steps)")
    plain = (
        _excited("pilot", "roll", "0.2 rad/s, plain flying (LOITER)"),
        _excited("pilot", "yaw", "0.1 rad/s, plain flying (LOITER)"),
    )
    (found,) = verdicts._excitation(LOG, replace(SEEN, excitations=plain), [])
    assert found.message.startswith("plain flying (LOITER) is the only excitation (roll, yaw): it")
    on_ground = replace(SEEN, excitations=made, phases=replace(PHASES, airborne=()))
    assert verdicts._excitation(LOG, on_ground, []) == []
    assert [each.code for each in verdicts._excitation(LOG, SEEN, [])] == ["motion-unknown"]
    logged = replace(SEEN, bands=(_band(1.0, 5.0),))
    assert [each.code for each in verdicts._excitation(LOG, logged, [])] == ["nothing-excited"]
    assert verdicts._loop(LOG, logged)[0].code == "closed-loop"
    for kind, said in (("sid", 0), ("autotune", 0), ("chirp", 0), ("sweep", 1)):
        seen = replace(logged, excitations=(_excited(kind, "roll", ""),))
        assert len(verdicts._loop(LOG, seen)) == said


def test_limits_that_were_reached_for_long_are_told_with_what_to_do() -> None:
    def said(*found: Saturation, **more: Any) -> list[tuple[str, str, str]]:
        seen = replace(SEEN, saturations=found, **more)
        return [(e.code, e.message, e.action) for e in verdicts._quality(LOG, seen)]

    assert said(Saturation("motor 1", "upper limit 2000 us", 0.05)) == []
    motor = Saturation("motor 1", "upper limit 2000 us", 0.126)
    centre = "straighten motors and frame, and trim the centre of gravity"
    (code, message, action), *rest = said(motor, replace(motor, what="motor 2"))
    assert rest == []
    assert (code, message) == (
        "saturated",
        "motor 1 is at its upper limit 2000 us for 13 % of the flight",
    )
    assert action.startswith(f"{centre} first; then less weight, larger propellers")
    ((_, _, action),) = said(replace(motor, limit="lower limit 1000 us"))
    assert "lower MOT_SPIN_MIN" in action
    ((_, _, action),) = said(replace(motor, limit="range"))
    assert action == f"{centre} first; then gentler flying"
    swept = (_excited("steps", "roll", ""), _excited("sid", "roll", ""))
    ((_, _, action),) = said(motor, excitations=swept)
    assert action == f"lower the amplitude of the sid; {centre}"
    command = Saturation("ROut", "mixer limit 1", 0.26, "yaw")
    ((code, message, action),) = said(command)
    assert (code, message) == (
        "saturated-yaw",
        "the command of yaw, ROut, is at its mixer limit 1 for 26 % of the flight",
    )
    assert action.startswith("take out what holds a steady yaw moment first")
    ((_, _, action),) = said(replace(command, axis="roll"))
    assert action.startswith("trim the centre of gravity and straighten motors first; then")


def test_jitter_and_skew_are_told_beyond_their_limits(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Inspection, "messages_used", property(lambda _: ("RATE",)))
    monkeypatch.setattr(verdicts, "gap_findings", lambda *_: [])
    rate = StreamRate("RATE", None, 999, 400.0, 400.0, 0.2, 0, 0.0, 0)
    rates = (rate, replace(rate, jitter=0.214), replace(rate, message="ATT", jitter=0.9))
    skew = StreamSkew("p", "RATE.R", "IMU.GyrX", 0.0052, 0.99, 0.0001, 0.0013)
    skews = (
        skew,
        replace(skew, half_width_s=0.0012),
        replace(skew, lag_s=-0.0061, half_width_s=0.002),
    )
    found = verdicts._quality(LOG, replace(SEEN, rates=rates, skews=skews))
    assert [(each.code, each.message.partition(": ")[0]) for each in found] == [
        ("jitter", "RATE is logged with 21 % jitter"),
        ("skew", "IMU.GyrX shows the same motion -6.1 ms (± 2.0) later than RATE.R"),
    ]
    near = replace(skew, lag_s=0.0053, half_width_s=0.00125)
    found = verdicts._quality(LOG, replace(SEEN, skews=(near,)))
    assert [each.message.partition(":")[0] for each in found] == [
        "IMU.GyrX shows the same motion 5.3 ms (± 1.2) later than RATE.R"
    ]
    coarse = replace(near, resolution_s=0.0041)
    assert verdicts._quality(LOG, replace(SEEN, skews=(coarse,))) == []


def test_a_gap_is_in_flight_where_it_overlaps_one_or_joins_two() -> None:
    flights = ((10.0, 20.0), (30.0, 40.0))
    for gap, armed, found in (
        ((5.0, 10.0), [], False), ((5.0, 10.1), [], True), ((20.0, 25.0), [], False),
        ((19.9, 25.0), [], True), ((20.5, 29.5), [], True), ((21.0, 29.0), [], True),
        ((21.1, 29.0), [], False), ((21.0, 28.9), [], False), ((20.5, 29.5), [25.0], False),
        ((20.5, 29.5), [20.4, 29.6], True), ((20.5, 29.5), [20.5], False),
    ):  # fmt: skip
        assert _in_flight(gap, flights, list(armed)) is found, (gap, armed)
    assert _longest([(1.0, 2.5), (9.0, 9.5)]) == 1.5


def test_a_fit_begins_at_twice_the_lowest_coherent_frequency() -> None:
    assert _fitted((1.2345, 9.876)) == (2.47, 9.88)
    assert _fitted((1.0, 2.0)) is None
    assert _fitted((1.0, 2.01)) == (2.0, 2.01)
    band = _band(1.0, 3.0)
    assert band.span == pytest.approx(1.5, abs=0.01)
    assert replace(band, band_rad_s=None).span == 0.0
    assert replace(band, band_rad_s=None).words == ""
    assert not replace(band, band_rad_s=None).is_usable
    assert not replace(band, coherent_rad_s=None).is_usable
    for ratio, said in (
        (1.0099, "m and p are logged at 100 Hz"),
        (1.02, "m is logged at 100 Hz and p at 102 Hz"),
    ):
        assert replace(band, rates_hz=(100.0, 100.0 * ratio)).logged == said
