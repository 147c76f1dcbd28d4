"""Stages of a study: what a change re-runs, what it leaves alone, and what a key depends on."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import flightid as fid
from flightid.app.gain_work import _small_moves
from flightid.control.autopilots import axis_loop
from flightid.control.tuning.modes_outside import BELOW_BAND
from flightid.control.tuning.worst_cases import WorstCase
from flightid.conventions import Light, Role
from flightid.errors import FlightidError
from flightid.evidence.evidence import Check, Evidence
from flightid.findings import Finding
from flightid.report.content import Document
from flightid.report.text import to_text
from flightid.study.answer import _models, models_in_short, short_document
from flightid.study.faults import CODE, FAILED, TUNING
from flightid.study.gain_answer import (
    gain_table,
    gain_tables,
    gains_finding,
    margin_table,
    small_angles,
)
from flightid.study.identified import LEFT_OUT, ModelResults
from flightid.study.settings import Segment
from flightid.study.stage_runner import digest
from flightid.study.stages import compare_free_run, select_coherent
from flightid.study.taking import _with_injected
from flightid.uncertainty.estimate import Estimate
from tests.unit.test_study_records import OWN, rig

pytestmark = pytest.mark.usefixtures("no_report")
STUDY = """
[study]
title = "Rig"
[[record]]
name = "fitted"
path = "rig.csv"
span_s = [0.0, 40.0]
[[record]]
name = "unseen"
path = "rig.csv"
span_s = [40.0, 80.0]
[fit]
starts = 1
[[model]]
name = "Lag"
template = "own.toml"
identify = "fitted"
verify = "unseen"
band_rad_s = [0.6, 10.0]
rivals = "Black"
[[model]]
name = "Black"
structure = "arx"
inputs = "drive"
outputs = "angle"
identify = "fitted"
verify = "unseen"
band_rad_s = [0.6, 10.0]
na = 2
nb = 1
nk = 2
"""
LAG = {"response: Lag, auto", "fit: Lag", "verification: Lag, unseen"}
BLACK = {
    "response: Black, auto",
    "coherence: Black",
    "fit: Black",
    "residual tests: Black",
    "spectra: Black",
    "verification: Black, unseen",
    "verification: Black, unseen, 1 ahead",
}
RECORDS = {"record: fitted", "record: unseen"}


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    place = tmp_path_factory.mktemp("stages")
    data = rig(0)
    rows = ["time [s],drive [V],idle [V],angle [rad]"]
    rows += [",".join(map(repr, map(float, row))) for row in zip(*data.values(), strict=True)]
    (place / "rig.csv").write_text("\n".join(rows), encoding="utf-8")
    (place / "own.toml").write_text(OWN, encoding="utf-8")
    return place


@pytest.fixture(scope="module")
def ran(folder: Path) -> tuple[fid.Study, dict[str, Any]]:
    """The study run for the first time, and what it left in the cache."""
    made: dict[str, Any] = {}
    path = folder / "study.toml"
    path.write_text(STUDY, encoding="utf-8")
    first = fid.run_study(path, output=folder / "out", cache=made)
    # Both models fly the same inputs in the same band: the response is estimated once.
    assert set(first.carried_out) == RECORDS | LAG | BLACK - {"response: Black, auto"}
    return first, made


@pytest.fixture
def cache(ran: tuple[fid.Study, dict[str, Any]]) -> dict[str, Any]:
    return ran[1]


def run(folder: Path, text: str, cache: dict[str, Any]) -> fid.Study:
    path = folder / "study.toml"
    path.write_text(text, encoding="utf-8")
    return fid.run_study(path, output=folder / "out", cache=dict(cache))


def test_nothing_changed_runs_nothing(folder: Path, ran: tuple[fid.Study, dict[str, Any]]) -> None:
    first, known = ran
    again = run(folder, STUDY, known)
    assert again.carried_out == ()
    assert set(again.from_cache) == RECORDS | LAG | BLACK
    assert again.identified[0].fit.model is first.identified[0].fit.model


@pytest.mark.parametrize(
    ("old", "new", "rerun"),
    [
        ('title = "Rig"', 'title = "Another"', set()),
        ('name = "Lag"', 'name = "Grey"', {"verification: Grey, unseen"}),
        ("na = 2", "na = 1", BLACK - {"coherence: Black", "response: Black, auto"}),
        ("starts = 1", "starts = 2", LAG - {"response: Lag, auto"}),
        (
            "[40.0, 80.0]",
            "[40.0, 70.0]",
            {"record: unseen", *(name for name in LAG | BLACK if "unseen" in name)},
        ),
        (
            "[fit]",
            "[verify]\nsettle_s = 2.0\n[fit]",
            {"spectra: Black", *(name for name in LAG | BLACK if "unseen" in name)},
        ),
        (
            "[fit]",
            "[response]\nminimum_decades = 0.2\n[fit]",
            {"coherence: Black"},
        ),
        ("[fit]", '[verify]\nhorizons = "free_run"\n[fit]', set()),
    ],
)
def test_a_change_runs_what_lies_behind_it(
    old: str, new: str, rerun: set[str], folder: Path, cache: dict[str, Any]
) -> None:
    found = run(folder, STUDY.replace(old, new, 1), cache)
    # A fit of the black box is verified beside the lag, so the lag is verified again.
    beside = {"verification: Lag, unseen"} if "fit: Black" in rerun else set()
    assert set(found.carried_out) == rerun | beside


def test_a_path_in_settings_stands_for_the_content_of_its_file(tmp_path: Path) -> None:
    file = tmp_path / "own.toml"
    digests = {digest(file) for text in ("a", "b", "a") if file.write_text(text, encoding="utf-8")}
    assert len(digests) == 2


@pytest.mark.nightly
def test_a_changed_file_is_read_again(folder: Path, cache: dict[str, Any]) -> None:
    own = folder / "own.toml"
    own.write_text(OWN.replace("value = 3.0", "value = 2.5"), encoding="utf-8")
    assert set(run(folder, STUDY, cache).carried_out) == LAG - {"response: Lag, auto"}
    own.write_text(OWN, encoding="utf-8")


def test_grey_and_black_stand_side_by_side(folder: Path, cache: dict[str, Any]) -> None:
    lag = run(folder, STUDY, cache).identified[0]
    beside = lag.verifications["unseen"]
    assert isinstance(beside, fid.Comparison)
    assert beside.names == ("Lag", "Black")
    assert lag.fit is not None
    assert beside.first.predictions[0].start == beside.verifications["Black"].predictions[0].start


def test_digests_tell_all_that_differs() -> None:
    values: list[object] = [
        1, 1.0, True, "1", None, (1,), [1], {"1": 1}, (1, (2,)), ((1,), 2), np.ones(2),
        np.ones((1, 2)), Path("nowhere"), ("ab", "c"), ("a", "bc"),
    ]  # fmt: skip
    assert len({digest(value) for value in values}) == len(values)
    with pytest.raises(TypeError, match="no stage can depend on a object"):
        digest(object())


def test_a_rival_that_cannot_answer_stands_aside(folder: Path, cache: dict[str, Any]) -> None:
    made = run(folder, STUDY.replace('name = "Black"\n', 'name = "Black"\nrivals = "Lag"\n'), cache)
    found = made.identified[1].verifications
    assert isinstance(found["unseen"], fid.Comparison)
    ahead = found["unseen, 1 ahead"]
    aside = [f for f in ahead.findings if f.code == "rival-without-answer"]
    assert [f.message.split(":")[0] for f in aside] == ["Lag was not compared"]
    assert "between samples" not in found["unseen"].first.protocol
    assert "between samples" in found["unseen"].verifications["Lag"].protocol


def test_what_settles_a_verification_is_not_asked_of_the_records_of_the_fit(
    folder: Path, cache: dict[str, Any]
) -> None:
    fit = run(folder, STUDY, cache).identified[1].fit
    assert fit is not None
    spectra = compare_free_run(fit, [fit.records[0].measured], {"settle_s": 1e3})
    assert spectra is not None


def test_a_black_box_needs_no_band_and_says_what_it_predicts(
    folder: Path, cache: dict[str, Any]
) -> None:
    place = STUDY.rindex("band_rad_s")
    text = STUDY[:place] + STUDY[STUDY.index("\n", place) + 1 :]
    found = run(folder, text, cache)
    black = found.identified[1]
    assert (black.response, black.coherent) == (None, None)
    assert black.fit is not None
    fit_percent = black.on_unseen["unseen"].fit_percent["angle"]
    said = black.fit.evidence.verdict.message
    assert said.startswith(f"predicts {fit_percent:.3g} % of angle of “unseen”")
    reason = black.fit.evidence.reason
    assert reason is not None
    assert reason.message in said


BRIEF = """
[[record]]
name = "brief"
path = "rig.csv"
span_s = [0.0, 0.3]
[[model]]
name = "Brief"
structure = "arx"
inputs = "drive"
outputs = "angle"
identify = "brief"
na = 2
nb = 1
nk = 2
"""


def test_a_model_that_its_data_do_not_allow_leaves_the_others(
    folder: Path, cache: dict[str, Any]
) -> None:
    study = run(folder, STUDY + BRIEF, cache)
    lag, _, refused = study.identified
    assert lag.fit is not None
    assert refused.fit is None
    assert "not identified" in refused.left_out[0].message
    assert any(finding.code == "model-refused" for finding in study.findings)
    said = " ".join(to_text(study.short).split())
    assert "2 of 3 models to use" in said, "what serves comes first"
    assert "not to be used, for what is said of it: " in said
    alone = STUDY[: STUDY.index("[[record]]")] + BRIEF
    with pytest.raises(FlightidError):
        run(folder, alone, cache)
    again = BRIEF[BRIEF.index("[[model]]") :].replace('"Brief"', '"Briefer"')
    said = r"no model of the study .*: found Brief: .*; Briefer: "
    with pytest.raises(FlightidError, match=said):
        run(folder, alone + again, cache)


def test_chirps_of_a_log_have_the_names_of_their_segments() -> None:
    time_s = 0.1 * np.arange(5)
    flown = fid.Record.from_arrays(
        time_s, inputs={"tau_phi": time_s}, excitations={"excitation": time_s + 1.0}
    )
    roll = Segment("roll", sid_axis=10, excitation="roll chirp")
    made = _with_injected(flown, roll, ("roll chirp", "pitch chirp"))
    assert list(made.channels) == ["tau_phi", "roll chirp", "pitch chirp"]
    assert made["roll chirp"].tolist() == flown["excitation"].tolist()
    assert not made["pitch chirp"].any()
    assert {made.channels[name].role for name in ("roll chirp", "pitch chirp")} == {Role.EXCITATION}


def _promised(**fits: float) -> SimpleNamespace:
    """A model of one run that no fit has seen, by how well each channel is predicted there."""
    verdict = Finding("evidence", Light.GREEN, "holds")
    fit = SimpleNamespace(
        evidence=SimpleNamespace(verdict=verdict, check={}.get), average_cost=1.0,
        covariance=np.eye(1),
        responses=(), model=SimpleNamespace(inputs=("u",), outputs=("y",)),
    )  # fmt: skip
    run = SimpleNamespace(fit_percent=fits)
    settings = SimpleNamespace(structure=None)
    return SimpleNamespace(
        name="Hover", fit=fit, findings=(), on_unseen={"doublets": run}, settings=settings
    )


@pytest.mark.parametrize(
    ("fits", "said"),
    [
        ({"p": 93.12, "q": 95.0}, "it predicts 93.1 to 95 % of motion that no fit has seen"),
        (
            {"u": -288.0, "p": 95.1, "q": 80.0},
            "it predicts up to 95.1 % of motion that no fit has seen, 80 % at the median of 3 "
            "channels; 1 no better than a constant would, u of “doublets” least",
        ),
        ({"u": -288.0}, "it predicts nothing of motion that no fit has seen"),
    ],
)
def test_what_is_predicted_is_told_by_channels(fits: dict[str, float], said: str) -> None:
    study = SimpleNamespace(
        identified=[_promised(**fits)], faults=(), files=(), tuning=None, inspection=None
    )
    assert _models(study, "study.toml").message == f"1 model to use: {said}"  # type: ignore[arg-type]


def test_what_was_left_out_is_no_model_to_use() -> None:
    left = Finding("left-out", Light.UNKNOWN, "p/da is left out")
    none = SimpleNamespace(
        name="p/da", fit=None, findings=(left,), on_unseen={}, left_out=(left,), settings=None
    )
    study = SimpleNamespace(
        identified=[_promised(p=93.0), none], faults=(), files=(), tuning=None, inspection=None
    )
    said = _models(study, "study.toml").message  # type: ignore[arg-type]
    assert said.startswith("1 of 2 models to use: it predicts 93 %"), said
    assert said.endswith("none of p/da, for the reason that is named")


@pytest.mark.parametrize(
    ("light", "covariance", "is_held"),
    [
        (Light.UNKNOWN, np.eye(1), True),
        (Light.AMBER, None, True),
        (Light.AMBER, np.eye(1), False),
        (Light.GREEN, None, False),
    ],
    ids=["unknown", "closed, no bars", "closed, in its bars", "open"],
)
def test_no_kind_of_model_is_to_use_in_a_loop_that_may_bias_it(
    light: Light, covariance: object, *, is_held: bool
) -> None:
    """A controller turned round was "1 of 2 models to use: it predicts 98.1 %" of its own loop."""
    looped, free = _promised(p=98.1), _promised(p=60.0)
    loop = Check("loop", light, "whether a loop is closed cannot be told", "declare it")
    looped.name, looped.fit.covariance = "Turned", covariance
    looped.fit.evidence.check = {"loop": loop}.get
    study = SimpleNamespace(identified=[looped], faults=(), files=(), tuning=None, inspection=None)
    said = _models(study, "study.toml")  # type: ignore[arg-type]
    held = "not to be used, for the loop: Turned: whether a loop is closed cannot be told"
    if not is_held:
        assert said.message.startswith("1 model to use: it predicts 98.1 %")
        return
    assert (said.message, said.action) == (held, "declare it")
    study.identified.append(free)
    both = _models(study, "study.toml").message  # type: ignore[arg-type]
    assert both.startswith("1 of 2 models to use: it predicts 60 %"), both
    assert both.endswith(f"; {held}")


def test_a_worst_is_never_shown_better_than_it_is() -> None:
    """Noise went by names that no kind has and was rounded down: 0.552, worst 0.551."""
    for name, value, worst, shown in (
        ("noise, rms", 0.5516, 0.5519, 0.552),
        ("noise over gyro noise", 0.5519, 0.5519, 0.552),
        ("phase margin", 47.36, 47.36, 47.3),
        ("crossover", 20.13, 21.31, 21.4),  # a limit from above binds
    ):
        case = WorstCase("output", name, Estimate("m", value, "1"), worst, value, worst)
        assert case.shown_worst == (shown, shown), name


def test_margins_below_what_is_asked_and_columns_left_out_are_told() -> None:
    """44 deg stood green beside 45 that are required, and a dash was explained that nobody saw."""
    worst = [
        WorstCase("loop", "phase margin", Estimate("m", 50.0, "deg"), 44.66, None, 60.078),
        WorstCase("loop", "gain margin", Estimate("m", None, "dB"), None, None, None),
    ]
    asked = SimpleNamespace(phase_margin_deg=45.0, gain_margin_db=6.0, angle_phase_margin_deg=60.0)
    beyond = Finding("margin-beyond-band", Light.GREEN, "read above the band")
    roll = SimpleNamespace(
        axis="roll", loop=None, worst_cases=worst, requirements=asked, findings=(beyond,),
        share_met=0.9847, stages=(SimpleNamespace(gains={}),),
        flown=SimpleNamespace(autopilot="px4", gains={}),
    )  # fmt: skip
    tuning = SimpleNamespace(sound=[roll], findings=(), left_out={}, designs=(), untouched=())
    said = gains_finding(tuning, "study.toml").message  # type: ignore[arg-type]
    assert "at least 44°" in said, "44.6 are not 45"
    assert said.endswith("(98.4 % of them or more keep 45° and all else asked)")
    # "none to fly, they stay as flown: pitch" was read of roll, whose gains were written.
    for left, kept in (
        ({"pitch": "red"}, "pitch stays as flown: red"),
        ({"pitch": "red", "yaw": "narrow"}, "pitch, yaw stay as flown: pitch: red; yaw: narrow"),
    ):
        parted = SimpleNamespace(**{**vars(tuning), "left_out": left})
        said = gains_finding(parted, "study.toml").message  # type: ignore[arg-type]
        assert said.startswith("gains of roll keep at least 44°"), said
        assert said.endswith(f", and are to be flown; {kept}"), said
    # Of a sweep cut short no margin of phase was promised, and the answer ended in a fault.
    none = SimpleNamespace(**{**vars(roll), "worst_cases": worst[1:]})
    unpromised = SimpleNamespace(**{**vars(tuning), "sound": [none]})
    said = gains_finding(unpromised, "study.toml").message  # type: ignore[arg-type]
    assert said.startswith(
        "gains of roll keep their limits in the band shown, with no phase margin"
    )
    way = gains_finding(tuning, "study.toml").action  # type: ignore[arg-type]
    assert way.startswith("flightid tune study.toml --write gains.params writes them")
    done = gains_finding(tuning, "study.toml", ["g-1.params"], "out").action  # type: ignore[arg-type]
    own = gains_finding(tuning, "study.toml", gains_file="up/next.params")  # type: ignore[arg-type]
    assert own.action.startswith("flightid tune study.toml --write up/next.params writes them")
    assert "fly up/next.params: " in own.action, "gains.params was advised beside --write"
    moves = "a minute of quick moves of each stick"
    assert done == f"fly g-1.params: {moves}; log, then flightid compare out LOG: kept or not"
    # An amber line of gains had no reason, and "look again" no command.
    copter = axis_loop("arducopter", "roll", loop_rate_hz=400.0)
    step = SimpleNamespace(
        **{**vars(roll), "stages": [SimpleNamespace(gains={"ATC_ANG_RLL_P": 9.0})] * 2},
    )
    step.flown = copter
    doubts = (Finding("a", Light.AMBER, "the band ends early"), Finding("b", Light.AMBER, "windy"))
    step.findings = doubts
    two = SimpleNamespace(
        **{**vars(tuning), "sound": [step], "findings": doubts, "designs": (step,)}
    )
    told = gains_finding(two, "study.toml", results="out")  # type: ignore[arg-type]
    assert told.light is Light.AMBER
    assert told.message.endswith("; but roll the band ends early (1 other reason: report)")
    fly = f"fly gains-1.param, step 1 of 2: {moves}, roll and pitch by no more than 6.8 deg at once"
    assert f"{fly}; log, then flightid compare out LOG" in told.action
    shown = margin_table((roll,)).shown()  # type: ignore[arg-type]
    assert shown == [["roll", "loop", "44.6", "60"]], "44.66 is not 44.7, nor 60.078 60.1"
    notes = margin_table((roll,)).notes  # type: ignore[arg-type]
    assert notes[1].startswith("gain margin: not promised, for what lies above the band in which")
    low = Estimate("m", None, "deg", reason=BELOW_BAND)
    slow = WorstCase("angle loop", "phase margin", low, None, None, 60.078)
    cases = (*worst, slow)
    for found, where in ((beyond,), "above the band"), ((), "below the band"):
        mixed = SimpleNamespace(**{**vars(roll), "worst_cases": cases, "findings": found})
        (_, note) = margin_table((mixed,)).notes  # type: ignore[arg-type]
        assert f": not promised, for what lies {where}" in note
        assert "(phase margin of angle loop)" in note, "it was called above the band"
    flown = axis_loop("arducopter", "roll", loop_rate_hz=400.0)
    angle = SimpleNamespace(axis="roll", flown=flown, loop=flown.with_gains(ATC_ANG_RLL_P=9.0))
    (small,) = small_angles([angle])  # type: ignore[list-item]
    assert "errors up to 6.8 deg in roll (27 as flown)" in small
    (page,) = _small_moves(angle)  # type: ignore[arg-type]
    assert page.message == small, "the page says what the command says"
    free = flown.with_gains(ATC_ACCEL_R_MAX=0.0)
    assert not [*small_angles([SimpleNamespace(axis="roll", flown=free, loop=free)])]  # type: ignore[list-item]


def test_a_title_of_margins_stands_above_a_table_of_margins() -> None:
    """Of a log that was cut no margin was promised: a title and two notes stood above nothing."""
    asked = SimpleNamespace(phase_margin_deg=45.0, gain_margin_db=6.0, angle_phase_margin_deg=60.0)
    flown = axis_loop("px4_multicopter", "roll", loop_rate_hz=400.0)
    change = SimpleNamespace(name="P", flown=0.1, new=0.4, ratio=4.0)
    for worst, titles in ((None, 1), (50.0, 2)):
        reading = Estimate("m", 60.0, "deg", reason="" if worst else BELOW_BAND)
        case = WorstCase("rate loop", "phase margin", reading, worst, None, None, "≥ 45")
        roll = SimpleNamespace(
            axis="roll", filters=(), changes=(change,), stages=[None], loop=flown, flown=flown,
            worst_cases=(case,), requirements=asked, findings=(),
        )  # fmt: skip
        tables = gain_tables((roll,), None)  # type: ignore[arg-type]
        assert [bool(each.rows) for each in tables] == [True] * titles
        words = "phase margin and gain margin: not promised, for what lies below the band"
        assert any(words in note for note in tables[0].notes) is (worst is None)


def test_gains_to_fly_next_stand_beside_those_that_flew() -> None:
    """A phone showed where gains arrive, and not those of the first step."""
    change = SimpleNamespace(name="P", flown=0.1, new=0.4, ratio=4.0)
    steps = [SimpleNamespace(gains={"P": gain}) for gain in (0.2, 0.4)]
    flown = axis_loop("px4_multicopter", "roll", loop_rate_hz=400.0)
    roll = SimpleNamespace(
        axis="roll", filters=(), changes=(change,), stages=steps, loop=flown, flown=flown
    )
    table = gain_table((roll,), None)  # type: ignore[arg-type]
    assert [each.name for each in table.columns][2:] == ["flown", "first step", "new", "ratio"]
    assert table.shown() == [["roll", "P", "0.1", "0.2", "0.4", "4"]]


def test_lines_of_models_keep_their_lights_where_a_reason_stands_apart() -> None:
    """The reason of two ambers stood apart, and left two green lines of models that are amber."""

    def model(name: str, predicted: Light) -> SimpleNamespace:
        checks = (
            Check("prediction", predicted, f"predicts {name}"),
            Check("agreement of parts", Light.UNKNOWN, "flown once", "repeat it"),
        )
        evidence = Evidence(checks, ("agreement of parts",))
        fit = SimpleNamespace(average_cost=1.0, evidence=evidence)
        return SimpleNamespace(name=name, fit=fit, settings=SimpleNamespace(structure=None))

    items = [model("p", Light.GREEN), model("q", Light.GREEN)]
    lines = models_in_short(items).findings  # type: ignore[arg-type]
    lights = [item.fit.evidence.light for item in items]
    assert [each.light for each in lines[:-1]] == lights == [Light.AMBER, Light.AMBER]
    assert lines[0].message.endswith("predicts p; amber for what is said of both below")
    assert (lines[-1].message, lines[-1].light) == ("p, q: flown once", Light.AMBER)
    assert lines[-1].action == "repeat it"
    (alone,) = models_in_short(items[:1]).findings  # type: ignore[arg-type]
    assert (alone.light, "flown once" in alone.message) == (Light.AMBER, True)
    assert "below" not in alone.message


def test_no_model_is_none_to_use() -> None:
    left = Finding("left-out", Light.UNKNOWN, "p/da is left out")
    item = SimpleNamespace(name="p", fit=None, findings=(left,), on_unseen={}, left_out=(left,))
    study = SimpleNamespace(identified=[item], faults=(), files=())
    said = _models(study, "study.toml")  # type: ignore[arg-type]
    assert said.light is Light.UNKNOWN
    assert "no model was made" in said.message
    damaged = (Finding("spikes", Light.RED, "3 samples of p stand alone"), left)
    spiked = SimpleNamespace(name="p", fit=None, findings=damaged, on_unseen={}, left_out=damaged)
    study = SimpleNamespace(identified=[spiked], faults=(), files=())
    said = _models(study, "study.toml")  # type: ignore[arg-type]
    assert (said.light, said.action) == (Light.RED, "mend first what is red there")


def test_damage_comes_before_the_coherence_that_it_takes() -> None:
    """Three spikes take the coherence: a model was left out for that alone, not judged."""
    time_s = np.arange(1000) * 0.08
    r = np.random.default_rng(1)
    moved = np.repeat(r.choice([-1.0, 1.0], 100), 10)
    answered = np.convolve(moved, 0.2 * 0.8 ** np.arange(40))[:1000]
    answered[[211, 500, 777]] += 300.0
    record = fid.Record.from_arrays(time_s, inputs={"u": moved}, outputs={"y": answered})
    pairs = fid.coherent_pairs(fid.estimate_response(record, inputs="u", outputs="y"))
    structure = SimpleNamespace(inputs=("u",), outputs=("y",))
    settings = SimpleNamespace(name="y from u", structure=structure)
    item = ModelResults(settings, {}, pairs, training=(record,))  # type: ignore[arg-type]
    assert not pairs.names
    spikes, left = item.left_out
    assert (spikes.light, left.code) == (Light.RED, LEFT_OUT)
    assert spikes.message.startswith("3 samples of y stand alone")
    assert spikes.message.endswith("at 16.88, 40, 62.16 s")
    assert "outliers = { deviations = " in spikes.action


def test_a_narrow_response_is_no_reason_to_leave_out_the_only_input() -> None:
    omega = np.geomspace(1.0, 10.0, 21)
    coherence = np.where(omega < 1.3, 0.9, 0.2)
    seen = fid.FrequencyResponse.from_values(
        omega,
        np.ones((1, 2, 21)),
        inputs=["drive", "idle"],
        outputs=["angle"],
        coherence=np.stack([coherence, np.full(21, 0.2)])[None],
    )
    assert select_coherent(seen, 0.6, 0.3, False).names == ()
    assert select_coherent(seen, 0.6, 0.3, False, on_samples=True).names == ("angle/drive",)
    assert select_coherent(seen, 0.6, 0.1, False, on_samples=True).names == ("angle/drive",)


def test_the_answer_says_nothing_twice() -> None:
    """A rig's answer gave one action four times, and the verdict on its model twice."""
    do = "declare loop = open"
    verdict = Finding("evidence", Light.RED, "whether a loop is closed cannot be told", do)
    fit = SimpleNamespace(
        evidence=SimpleNamespace(verdict=verdict, check={}.get), average_cost=1.0,
        covariance=None, details=None,
    )  # fmt: skip
    item = SimpleNamespace(
        name="p", fit=fit, findings=(), on_unseen={}, settings=SimpleNamespace(structure=None)
    )
    why = f"{TUNING}{FAILED}the fit of p is red: found {verdict.message}; needed a model"
    study = SimpleNamespace(
        identified=[item], faults=(Finding(CODE, Light.RED, why, do),), files=("study.toml",),
        tuning=None, inspection=None, gain_flight=None, source=None,
    )  # fmt: skip
    document = Document("Models", "", ())
    said = " ".join(to_text(short_document(study, document)).split())  # type: ignore[arg-type]
    assert said.count(do) == 1
    assert said.count(verdict.message) == 1
    assert "no gains: the fit of p is red; needed a model" in said
