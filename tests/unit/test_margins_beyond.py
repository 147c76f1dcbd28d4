"""Margins above the identified band are the model's word alone, and are said to be."""

from __future__ import annotations

import re
from dataclasses import replace
from functools import partial
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import flightid as fid
from flightid.control.margins import gain_limits
from flightid.control.margins.loop_source import read_loop
from flightid.control.margins.margins import margins_of
from flightid.control.margins.mode_slack import MOST_MOVED_DB, TAKEN, ModeSlack
from flightid.control.margins.outside_band import MarginBeyond, beyond_findings
from flightid.control.margins.rigid_vehicle import RIGID
from flightid.control.tuning.axis_tuning import held_by_hand
from flightid.control.tuning.band_findings import asked_above, below_band, taken_words
from flightid.control.tuning.findings import verdict
from flightid.control.tuning.mode_slacks import slacks_of
from flightid.control.tuning.modes_outside import BELOW_BAND
from flightid.control.tuning.wider_band import higher_sweep, wider_band
from flightid.control.tuning.worst_cases import WorstCase
from flightid.conventions import Light
from flightid.evidence.evidence import Check, Evidence
from flightid.uncertainty.estimate import Estimate
from flightid.uncertainty.shown_bands import shown_words
from flightid.uncertainty.uncertain import Uncertain
from tests.strangers import hover
from tests.strangers.gains import NAMES


@pytest.mark.parametrize(("top", "said"), [(15.0, True), (3000.0, False)])
def test_margins_above_the_band_are_named_with_their_frequency(top: float, said: bool) -> None:
    plant = fid.load_model("rate_motor_lag").with_values(
        {"Ltphi": 140.0, "Lp": -4.0, "T_m": 0.05, "tau": 0.02}
    )
    asked = fid.ControllerOptions(controller="pi", loop_rate_hz=200.0)
    design = fid.tune_controller(plant, controller=asked, nominal=True, band_rad_s=(0.1, top))
    found = [each for each in design.findings if each.code == "margin-beyond-band"]
    assert bool(found) is said
    promised = design.worst_case("loop", "gain margin")
    assert (promised.worst is None) is said, "of what is read above the band nothing is promised"
    for each in found:
        assert each.light is Light.AMBER
        highest = float(re.search(r"up to ([\d.]+) rad/s", each.message).group(1))
        assert highest > top
        margin = promised.nominal
        room = float(re.search(r"by ([\d.]+) dB", each.message).group(1))
        assert 0.0 < room <= margin + 0.1, "the margin is taken above the band: it is room too"


def test_a_frame_above_the_band_takes_no_promised_gain_margin() -> None:
    """The model lacks a frame at 13 Hz that its band, up to 64 rad/s, cannot show."""
    truth = {"effect": 74.0, "damping": -2.0, "motor_s": 0.052, "delay": 4}
    known = hover.vehicle("motor lag", **truth)
    plant = fid.LinearSystem(
        known.a, known.b[:, None], np.eye(3)[[1]], [[0.0]], ("tau_phi",), ("p",),
        [known.delay * hover.STEP_S],
    )  # fmt: skip
    values = {NAMES[n]: v for n, v in {"p": 0.05, "i": 0.05, "d": 7e-4, "angle_p": 4.0}.items()}
    loop = fid.axis_loop("arducopter", "roll", loop_rate_hz=1 / hover.STEP_S)
    asked = {"gains": loop.with_gains(values), "gyro": "raw", "nominal": True, "draws": 1}
    design = fid.tune_pid(plant, band_rad_s=(0.1, 64.0), **asked)
    promised = {
        name: design.worst_case("rate loop", name).worst
        for name in ("gain margin", "sensitivity peak")
    }
    nominal = design.worst_case("rate loop", "gain margin").nominal
    assert 6.0 <= promised["gain margin"] < nominal - 5.0
    for share, w in ((0.25, 83.0), (0.35, 70.0)):
        craft = hover.vehicle("flexible frame", frame=(w, 0.02, share), **truth)
        new = hover.Gains(**{key: design.gains[name] for key, name in NAMES.items()})
        axis = hover.Axis(replace(craft, gyro_hz=loop.gains["INS_GYRO_FILTER"]), new)
        flown = axis.loops()
        _, room = hover.margins(flown["rate loop"])
        assert room < nominal - 1.0, "the frame takes some of what the model alone has"
        as_flown = hover.Axis(axis.craft, hover.Gains(0.05, 0.05, 7e-4, 4.0)).loops()
        case = design.worst_case("rate loop", "gain margin")
        assert 6.0 <= case.flown_worst <= hover.margins(as_flown["rate loop"])[1] < case.flown - 1.0  # type: ignore[operator]
        assert room >= promised["gain margin"]
        assert 1.0 / np.abs(1.0 + flown["rate loop"]).min() <= promised["sensitivity peak"]


def test_where_a_resonance_may_leave_less_than_is_required_nothing_is_promised() -> None:
    plant = fid.load_model("rate_motor_lag").with_values(
        {"Ltphi": 140.0, "Lp": -4.0, "T_m": 0.05, "tau": 0.02}
    )
    asked = fid.ControllerOptions(controller="pi", loop_rate_hz=200.0)
    design = fid.tune_controller(plant, controller=asked, nominal=True, band_rad_s=(0.1, 40.0))
    (said,) = (each for each in design.findings if each.code == "margin-beyond-band")
    assert "nothing is known above the 40 rad/s" in said.message
    assert said.light is Light.AMBER
    assert "no margin or peak is promised" in said.message
    assert "put a notch on" in said.action
    for name in (
        "gain margin", "sensitivity peak", "disturbance peak", "phase margin", "delay margin",
    ):  # fmt: skip
        case = design.worst_case("loop", name)
        assert (case.worst, case.estimate.reason) == (None, TAKEN["above"])
    assert design.worst_case("loop", "disturbance bandwidth").worst is not None
    found = replace(held_by_hand(design.problem, _gains_of(design)), exists=True)
    wider = wider_band(design.problem, _gains_of(design), (0.1, 40.0))
    light = verdict(found, np.ones(300, dtype=bool), 300, design.worst_cases, (0.1, 40.0), wider)
    assert light.light is Light.AMBER
    assert "say nothing of a light mode above it" in light.message
    assert light.action == f"{wider[1]}; {RIGID}"
    up = float(re.search(r"higher frequencies, up to ([\d.]+) rad/s", wider[1]).group(1))  # type: ignore[union-attr]
    assert up > 40.0
    assert "and log at the loop's 200 Hz" in wider[1]
    assert re.search(r"identify up to [\d.]+ rad/s \(a log of \d+ rows a second", said.action)
    omega = design.problem.plants.omega_rad_s
    loop = np.abs(design.problem.loops(_gains_of(design)[None], design.problem.plants).rate[0, 0])
    assert loop[omega > up].max() <= 10.0 ** (-26.0 / 20.0), "20 dB of a mode, 6 of margin"


def test_a_band_that_no_log_of_the_loop_holds_is_not_asked_for() -> None:
    """One of 400 Hz has 2 rows in a period of 1150 rad/s."""
    half = 400.0 * np.pi
    assert higher_sweep(100.0, 50.0, half).endswith(
        "up to 130 rad/s (a log of 340 rows a second or more holds it)"
    )
    said = higher_sweep(1150.0 / 1.3, 50.0, half)
    assert said.startswith("put a notch on")
    assert "1150 rad/s (a log of 2930 rows a second or more holds it) would show it" in said
    assert said.endswith("the loop runs at 400 Hz")


def test_a_first_crossing_of_one_is_not_said_to_be_another() -> None:
    omega = np.array([60.0, 90.0])
    above = MarginBeyond("loop", 90.0, ModeSlack.above(omega / 30.0 + 0j))
    (told,) = beyond_findings([above], (1.0, 50.0))
    assert "there the loop lies above one, by" in told.message
    assert "again" not in told.message


def test_a_mode_under_20_db_above_the_band_takes_phase_and_delay() -> None:
    """Of 19.5 dB at 1.35 times the band's top, where the loop alone is at −17 dB."""
    w = np.geomspace(0.3, 1000.0, 100_000)
    s, top, at, damping = 1j * w, 64.0, 1.35 * 64.0, 0.015
    rigid = 22.0 / s * 60.0 / (s + 60.0) * np.exp(-0.012 * s)
    share = 2.0 * damping * 10.0 ** (19.5 / 20.0)
    modes = s**2 / (s**2 + 2.0 * damping * at * s + at**2)
    true = rigid * (1.0 + share * modes)
    alone, beside = (_phase_and_delay(w, each) for each in (rigid, true))
    assert beside[0] < alone[0] - 20.0
    assert beside[1] < alone[1] / 5.0
    outer = 4.0 / s * rigid
    angle, above = outer / (1.0 + rigid), w > top
    for slack in (
        ModeSlack.above(rigid[above]),
        ModeSlack.of("above", angle[above], rigid[above], MOST_MOVED_DB),
    ):
        assert all(slack.takes(field, 6.0) for field in ("phase_margin_deg", "delay_margin_s"))
        assert not slack.takes("disturbance_bandwidth_rad_s", 6.0)
    weak = outer / (4.0 + rigid)
    low = ModeSlack.of("above", weak[above], rigid[above] / 4.0, MOST_MOVED_DB)
    turned = outer * (1.0 + share * modes) / (4.0 + true)
    assert 0.0 < low.left_db <= -20.0 * np.log10(np.abs(turned[above]).max())
    assert not low.takes("phase_margin_deg", 6.0)
    assert ModeSlack("above").left_db == np.inf


def _phase_and_delay(w: np.ndarray, loop: np.ndarray) -> tuple[float, float]:
    """Least phase margin, deg, and least delay margin, s, over all places where it is at one."""
    at = np.flatnonzero(np.diff(np.sign(np.abs(loop) - 1.0)))
    margin = np.mod(np.angle(loop[at]) + np.pi, 2.0 * np.pi)
    return float(np.degrees(np.minimum(margin, 2.0 * np.pi - margin)).min()), float(
        (margin / w[at]).min()
    )


@pytest.mark.parametrize(("top", "reaching"), [(90.0, True), (60.0, False)])
def test_margins_promise_no_more_than_a_frame_above_the_band_leaves(
    top: float, reaching: bool
) -> None:
    """A mode that the structure lacks, a tenth as wide as it is high: raised by 20 dB."""
    gain, lag, delay = 8.0, 30.0, 0.01
    source = Uncertain(
        np.array([gain, lag]), np.diag([0.01, 0.1]), partial(_lagged, delay), valid_rad_s=(0.1, top)
    )
    known = fid.margins(replace(source, valid_rad_s=None))
    found, rejected = fid.margins(source), fid.disturbance_rejection(source)
    assert known.phase_crossover.value < top
    said = [each for each in found.findings if each.code == "margin-beyond-band"]
    assert len(said) == (not reaching)
    for each in said:
        near = "rest on no such mode" in each.message
        assert near is (each.light is Light.AMBER)
    assert found.phase_margin.interval95 == known.phase_margin.interval95
    rigid, kept = (verb(source, rigid=True) for verb in (fid.margins, fid.disturbance_rejection))
    assert rigid.gain_margin.interval95 == known.gain_margin.interval95
    assert rigid.modulus_margin.interval95 == known.modulus_margin.interval95
    for each in (rigid, kept):
        codes = [finding.code for finding in each.findings]
        assert (codes.count("rigid-declared"), codes.count("margin-beyond-band")) == (1, 0)
    for number in (found.gain_margin, found.modulus_margin, found.sensitivity_peak, rejected.peak):
        assert (number.interval95 is not None) is reaching
        assert (number.reason == TAKEN["above"]) is not reaching
    if not reaching:
        return
    w = np.geomspace(1.0, 300.0, 200_000)
    s = 1j * w
    true = []
    for at, share in ((95.0, 0.18), (95.0, -0.18), (140.0, 0.18), (140.0, -0.18)):
        frame = 1.0 + share * at * s / (s**2 + 0.02 * at * s + at**2)
        loop = gain / s * lag / (s + lag) * np.exp(-delay * s) * frame
        assert np.abs(frame).max() < 10.1
        turns = (loop[:-1].imag * loop[1:].imag < 0.0) & (loop[1:].real < 0.0)
        true.append(-20.0 * np.log10(np.abs(loop[1:][turns]).max()))
        nearest = np.abs(1.0 + loop).min()
        assert found.gain_margin.interval95[0] <= true[-1]
        assert found.modulus_margin.interval95[0] <= nearest
        assert found.sensitivity_peak.interval95[1] >= 1.0 / nearest
        assert rejected.peak.interval95[1] >= -20.0 * np.log10(nearest)
    assert min(true) < known.gain_margin.interval95[0] - 3.0, "frames take what was promised"


def test_all_frequencies_of_a_loop_are_found_once_and_each_draw_is_run_once(monkeypatch) -> None:
    found, once = [], gain_limits.measured_up
    monkeypatch.setattr(gain_limits, "measured_up", lambda loop: found.append(loop) or once(loop))
    source = Uncertain(np.array([8.0, 30.0]), np.diag([0.01, 0.1]), partial(_lagged, 0.01))
    band: dict[str, Any] = {"given": "broken", "band_rad_s": (1.0, 60.0)}
    loop = read_loop(source, None, None, controller=None, unstable_poles=None, **band)
    margins_of(loop)
    assert len(found) == 1
    assert gain_limits.everywhere(loop, loop.omega_rad_s) is not None
    assert len(found) == 1, "known of this loop"
    asked = []
    whole = replace(
        loop, whole_rad_s=None, of=lambda thing, w: asked.append(w) or loop.of(thing, w)
    )
    gain_limits.loop_numbers(whole, whole.omega_rad_s, [source.value], ["phase_margin_deg"])
    assert [len(each) for each in asked] == [len(loop.omega_rad_s) + 1]


def _lagged(delay: float, n: np.ndarray) -> fid.LinearSystem:
    return fid.LinearSystem(
        [[0.0, n[1]], [0.0, -n[1]]], [[0.0], [n[0]]], [[1.0, 0.0]], [[0.0]], ("e",), ("y",), [delay]
    )


@pytest.mark.parametrize(("read", "top"), [(("q", "u"), 30.0), (("u",), 2.0), (("theta",), 2.0)])
def test_a_loop_is_known_where_the_responses_that_it_closes_are(
    read: tuple[str, ...], top: float
) -> None:
    """Speed is seen up to 2 rad/s, pitch rate to 30: a loop of both is not one of speed alone."""
    craft = fid.LinearSystem(
        [[-0.1, 0.0, -9.8], [0.02, -2.0, 0.0], [0.0, 1.0, 0.0]], [[0.0], [6.0], [0.0]],
        np.eye(3), np.zeros((3, 1)), ("lon",), ("u", "q", "theta"), [0.05],
    )  # fmt: skip
    seen = {"u/lon": (0.4, 2.0), "q/lon": (0.9, 30.0)}
    check = Check(
        "excitation band", Light.GREEN, "narrowest", band_rad_s=(0.4, 2.0), by_response_rad_s=seen
    )
    evidence = Evidence.from_dict(Evidence((check,)).to_dict())
    source = replace(
        Uncertain.exact(craft),
        valid_rad_s=evidence.band_rad_s,
        by_response_rad_s=evidence.by_response_rad_s,
    )
    gains = {"q": 1.0, "u": -0.002, "theta": 2.0}
    closed = fid.close_loop(source, {"lon": {name: gains[name] for name in read}})
    loop = closed.margins()["lon"]
    said = [each for each in loop.findings if each.code == "margin-beyond-band"]
    assert all(f"above the {top:g} rad/s" in each.message for each in said)
    assert said or read == ("u",)
    alone = fid.margins(source, "lon", "q")
    assert not [each for each in alone.findings if "2 rad/s" in each.message]
    words = shown_words(evidence.by_response_rad_s, evidence.band_rad_s)
    assert words == "its responses hold from 0.4 to 30 rad/s together, u/lon up to 2 rad/s"


@pytest.mark.parametrize(("low", "promised"), [(0.5, True), (4.0, False)])
def test_of_a_phase_that_is_read_below_the_band_nothing_is_promised(
    low: float, promised: bool
) -> None:
    """The angle loop of these gains passes one at 1 to 4 rad/s, the rate loop far above."""
    plant = fid.load_model("rate_integrator", axis="roll").with_values(
        {"Ltphi": 140.0, "tau": 0.03}
    )
    flown = fid.axis_loop("arducopter", "roll", loop_rate_hz=400.0)
    kept = {"ATC_ANG_RLL_P": 3.0}
    asked = {"band_rad_s": (low, 900.0), "nominal": True, "by_hand": kept}
    design = fid.tune_pid(plant, gains=flown, **asked)  # type: ignore[arg-type]
    assert 1.0 < design.worst_case("angle loop", "crossover").nominal < 4.0  # type: ignore[operator]
    said = [each for each in design.findings if each.code == "margin-below-band"]
    assert [each.light for each in said] == ([] if promised else [Light.AMBER])
    assert (design.worst_case("angle loop", "phase margin").worst is not None) is promised
    # From 4 rad/s on a mode below may bring the rate loop through one too.
    assert (design.worst_case("rate loop", "phase margin").worst is not None) is promised
    found = replace(held_by_hand(design.problem, _gains_of(design)), exists=True)
    light = verdict(found, np.ones(300, dtype=bool), 300, design.worst_cases, (low, 900.0))
    assert light.light is (Light.GREEN if promised else Light.AMBER)
    limit = ": at least" if promised else ", and say nothing"
    assert f"requirement in the band shown, {low:g} to 900 rad/s{limit}" in light.message
    assert ("say nothing of a light mode below it" in light.message) is not promised
    if not promised:
        for name in ("gain margin", "sensitivity peak", "crossover", "delay margin"):
            case = design.worst_case("angle loop", name)
            assert (case.worst, case.estimate.interval95, case.flown_worst) == (None,) * 3
        told = re.search(r"sweep from ([\d.]+) to ([\d.]+) rad/s alone", said[0].action)
        start, top = map(float, told.groups())  # type: ignore[union-attr]
        assert 0.0 < start < 1.0
        assert top > low, "below the angle's own crossover, up into the band"


@pytest.mark.parametrize("shift", [0.9, 1.12])
def test_a_pendulum_below_the_band_takes_no_promised_number(shift: float) -> None:
    """Pole beside zero at 4.55 rad/s: the loop falls towards the zero and may turn there."""
    w = np.geomspace(0.1, 500.0, 200_000)
    s, low = 1j * w, w < 5.78
    model = 120.0 / s * 60.0 / (s + 60.0)
    zero, pole = 4.55, 4.55 * shift
    mode = (s**2 + 0.06 * zero * s + zero**2) / (s**2 + 0.06 * pole * s + pole**2)
    assert np.abs(mode).min() > 10.0 ** (-MOST_MOVED_DB / 20.0)
    angle = [3.0 / s * r / (1.0 + r) for r in (model, model * mode)]
    slack = ModeSlack.below(model[low])
    assert slack.left_db == pytest.approx(20.0 * np.log10(np.abs(model[low]).min()) - 20.0)
    around = ModeSlack.of("below", angle[0][low], model[low], MOST_MOVED_DB)
    assert np.abs(model * mode)[low].min() >= 10.0 ** (slack.left_db / 20.0)
    assert np.abs(angle[1])[low].min() >= 10.0 ** (around.left_db / 20.0)
    peak = (1.0 / np.abs(1.0 + model * mode))[low].max()
    assert peak <= slack.edge("sensitivity_peak")  # type: ignore[operator]
    assert around.takes_all(6.0), "the angle loop is at one there"
    assert not slack.takes_all(6.0)
    weak = ModeSlack.below(model[low] / 15.0)
    assert np.abs(model * mode / 15.0)[low].min() < 1.0
    assert weak.takes_all(6.0)
    assert weak.takes("gain_margin_db", 6.0)
    assert ModeSlack("below").edge("sensitivity_peak") is None


def test_a_loop_that_a_mode_brings_through_one_is_promised_no_phase_nor_delay() -> None:
    """There it passes one with any phase: both were promised beside a gain margin that was not."""
    through, clear = ModeSlack("below", -0.5, 19.5), ModeSlack("below", 0.5, 20.5)
    for field in ("phase_margin_deg", "delay_margin_s", "gain_margin_db"):
        assert through.takes(field, 6.0), field
        assert not clear.takes(field, 6.0), field
    assert clear.takes("gain_reduction_margin_db", 6.0)
    assert not ModeSlack("below").takes("phase_margin_deg", 6.0)


@pytest.mark.parametrize("side", ["below", "above"])
def test_what_a_mode_may_move_is_judged_by_what_the_band_shows(side: str) -> None:
    band = (4.0, 100.0)
    design = fid.tune_pid(
        fid.load_model("rate_integrator", axis="roll").with_values({"Ltphi": 140.0, "tau": 0.03}),
        gains=fid.axis_loop("arducopter", "roll", loop_rate_hz=400.0),
        band_rad_s=band,
        nominal=True,
        by_hand={"ATC_ANG_RLL_P": 3.0},
    )
    problem, gains = design.problem, _gains_of(design)
    omega = problem.plants.omega_rad_s
    outside = omega < band[0] if side == "below" else omega > band[1]
    alone = slacks_of(problem, gains, band, side)["rate loop"]  # type: ignore[arg-type]
    assert alone.left_db == pytest.approx(alone.own_db - MOST_MOVED_DB)
    moved = np.linspace(1.0, 15.0, len(omega))
    found = slacks_of(replace(problem, moved_db=moved), gains, band, side)["rate loop"]  # type: ignore[arg-type]
    loop_db = 20.0 * np.log10(np.abs(problem.loops(gains[None], problem.plants).rate[0, 0]))
    away = (loop_db if side == "below" else -loop_db)[outside]
    assert found.own_db == pytest.approx(away.min())
    assert found.left_db == pytest.approx((away - moved[outside]).min())
    assert found.room_db - found.moved_db == pytest.approx(found.left_db)
    assert slacks_of(problem, gains, None, side) == {}  # type: ignore[arg-type]


@pytest.mark.parametrize(("required", "light"), [("≥ 6", Light.AMBER), ("", Light.GREEN)])
def test_what_was_asked_and_may_be_taken_is_a_check_that_was_not_made(
    required: str, light: Light
) -> None:
    """Not green beside a requirement of which nothing is promised (docs/evidence.md)."""
    reading = Estimate("rate loop: gain reduction margin", 15.0, "dB", reason=TAKEN["below"])
    case = WorstCase("rate loop", "gain reduction margin", reading, None, None, None, required)
    whole = Estimate("rate loop: phase margin", 60.0, "deg")
    kept = WorstCase("rate loop", "phase margin", whole, 50.0, None, None, "≥ 45")
    result = SimpleNamespace(worst_cases=(kept, case), problem=SimpleNamespace(rigid=False))
    (said,) = below_band(result, (4.0, 100.0), "sweep lower")  # type: ignore[arg-type]
    assert (said.code, said.light) == ("mode-below-band", light)
    assert "may take gain reduction margin, and none is promised" in said.message
    assert "nothing is known below 4 rad/s" in said.message
    assert said.action == f"sweep lower; {RIGID}"
    above = replace(case, estimate=replace(reading, reason=TAKEN["above"]))
    assert asked_above((kept, above)) is (light is Light.AMBER)


def test_a_loop_at_one_below_the_band_names_where_the_band_begins() -> None:
    reading = Estimate("rate loop: phase margin", 60.0, "deg", reason=BELOW_BAND)
    case = WorstCase("rate loop", "phase margin", reading, None, None, None, "≥ 45")
    result = SimpleNamespace(worst_cases=(case,), problem=SimpleNamespace(rigid=False))
    (said,) = below_band(result, (4.0, 100.0), "sweep lower")  # type: ignore[arg-type]
    assert (said.code, said.light) == ("margin-below-band", Light.AMBER)
    assert said.message.startswith("rate loop: the gain is at one below the 4 rad/s from which")
    assert said.action == "sweep lower"
    assert not [*below_band(result, None, "sweep lower")]  # type: ignore[arg-type]


def _gains_of(design: fid.PidDesign) -> np.ndarray:
    return np.asarray(design.problem.paths.gains_of(design.loop))  # type: ignore[attr-defined]


def test_what_a_mode_below_takes_is_told_of_each_loop() -> None:
    def lost(loop: str, name: str, reason: str = TAKEN["below"]) -> WorstCase:
        return WorstCase(loop, name, Estimate(name, 1.0, "1", None, reason), None, None, None)

    rate = [lost("rate loop", "phase margin"), lost("rate loop", "gain margin")]
    whole = [lost("whole loop", "sensitivity peak"), lost("whole loop", "phase margin", "")]
    loops = ("rate loop", "whole loop")
    assert taken_words(rate, loops[:1]) == "phase margin, gain margin"
    told = "of rate loop phase margin, gain margin; of whole loop sensitivity peak"
    assert taken_words([*rate, *whole], loops) == told
