"""Studies that are written for data: what is in them, and that nobody's own study is replaced."""

from __future__ import annotations

import re
import tomllib
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.signal import chirp, lfilter, lsim

from flightid import Record, inspect_log, run_study, write_records
from flightid.cli.program import run
from flightid.cli.wording import as_typed
from flightid.conventions import Light
from flightid.errors import DataError, OptionError, StudyError, UnknownNameError
from flightid.findings import Finding
from flightid.study.proposal import Proposal, of_records, propose_study
from flightid.study.proposal.columns import columns_of
from flightid.study.proposal.of_records import study_of_records
from flightid.study.proposal.structures_of import GroupScans
from flightid.surface import speaking
from tests.ordinary_log import write_ordinary_log

RIG_WITH_GAINS = """
[study]
title = "Rig"
[verify]
residual_tests = true
[[record]]
name = "all"
path = "rig.csv"
[[model]]
name = "beam"
structure = "oe"
inputs = ["volts"]
outputs = "beam"
identify = "all"
band_rad_s = [1.7, 6.3]
nb = [2]
nf = [2]
nk = [1]
[tune]
controller = "pi"
draws = 10
"""


def _rig(folder: Path, name: str = "rig.csv", seed: int = 0) -> Path:
    """y(k) = 1.5 y(k−1) − 0.7 y(k−2) + u(k−1) + 0.5 u(k−2), with a little noise."""
    rng = np.random.default_rng(seed)
    u = np.repeat(rng.choice([-1.0, 1.0], 200), 3)
    y = np.zeros_like(u)
    for k in range(2, u.size):
        y[k] = 1.5 * y[k - 1] - 0.7 * y[k - 2] + u[k - 1] + 0.5 * u[k - 2]
    y += 0.01 * rng.standard_normal(y.size)
    rows = [f"{0.1 * k:.1f},{a},{b:.8g}" for k, (a, b) in enumerate(zip(u, y, strict=True))]
    path = folder / name
    path.write_text("\n".join(["time [s],volts [V],beam [rad]", *rows]) + "\n")
    return path


def test_an_input_that_is_still_where_the_fit_looks_is_left_out(tmp_path: Path) -> None:
    rows = (_rig(tmp_path).read_text()).splitlines()
    late = [f"{row},{float(k > 500)}" for k, row in enumerate(rows[1:])]
    still = [f"{row},0" for row in rows[1:]]
    for name, body in (("late.csv", late), ("still.csv", still)):
        (tmp_path / name).write_text("\n".join([rows[0] + ",pedal [V]", *body]) + "\n")
    found = propose_study(
        [tmp_path / "late.csv"], folder=tmp_path, inputs=("volts", "pedal"), outputs=("beam",)
    )
    assert found.models == ("beam from volts",)
    (said,) = found.findings
    assert (said.code, said.light) == ("input-still", Light.AMBER)
    assert "pedal left out, still from 0 to" in said.message
    told = "\n".join(found.lines)
    assert "# Left out: late, fitted: pedal left out" in told
    assert propose_study(
        [tmp_path / "still.csv"], folder=tmp_path, inputs=("volts", "pedal"), outputs=("beam",)
    ).models == ("beam from volts",)


@pytest.mark.nightly
def test_records_become_the_study_of_their_structure(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    data = _rig(tmp_path)
    code = run(["--quiet", "run", str(data)])
    shown = capsys.readouterr().out.strip().splitlines()
    assert code == 0
    # The verdict and the next step stand where eyes are: last.
    assert any(line.startswith("Answer: ") for line in shown[-8:])
    assert "--controller pi_d" in " ".join(shown[-3:])
    again = run_study(tmp_path / "rig-study.toml", output=tmp_path / "again")
    fit = again.identified[0].fit
    assert fit is not None
    assert again.identified[0].name == "beam from volts"
    assert min(again.identified[0].on_unseen.popitem()[1].fit_percent.values()) > 95.0
    first = (tmp_path / "rig-output" / "report.txt").read_text().split("Parameters")[0]
    assert first == (tmp_path / "again" / "report.txt").read_text().split("Parameters")[0]


HEAVE = """
kind = "state-space"
name = "heave"
[states]
w = "ft/s"
[inputs]
F = "lbf"
[outputs]
w = "w"
[parameters]
m = { value = 5.0, min = 0.1, max = 100.0, unit = "slug" }
c = { value = 5.0, min = 0.0, max = 200.0, unit = "lbf*s/ft" }
[equations]
"m*w'" = "-c*w + F"
"""


def test_columns_go_to_the_units_of_equations_that_are_named_from_anywhere(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Knots of 12 slug behind 20 lbf s/ft, the records in a folder below the equations."""
    time_s, force = np.arange(600) * 0.05, np.repeat(np.tile([40.0, -40.0, 40.0], 10), 20)
    _, speed, _ = lsim(([1.0], [12.0, 20.0]), force, time_s, interp=False)
    knots = speed / 1.687810 + 0.02 * np.random.default_rng(0).standard_normal(600)
    (tmp_path / "flights").mkdir()
    (tmp_path / "heave.toml").write_text(HEAVE)
    rows = np.column_stack([time_s, force, knots])
    head = "time [s],lever [V],w [kt]"
    np.savetxt(tmp_path / "flights/r.csv", rows, "%.6g", ",", header=head, comments="")
    monkeypatch.chdir(tmp_path)
    asked = {"inputs": ["lever"], "outputs": ["w"], "hold": "zero"}
    asked |= {"folder": "flights", "model": "heave.toml"}
    of_channel, made = (
        propose_study(["flights/r.csv"], **asked, units={name: "lbf"}) for name in ("F", "lever")
    )
    assert of_channel.lines == made.lines
    assert "w converted from kt to ft/s, its unit in ../heave.toml" in made.said
    fit = run_study(made.write(Path("flights/r-study.toml"))).identified[0].fit
    assert fit is not None
    assert fit.parameters["m"].value == pytest.approx(12.0, rel=0.02)
    assert fit.parameters["c"].value == pytest.approx(20.0, rel=0.02)


@pytest.mark.nightly
def test_a_controller_of_a_study_is_written_as_code(tmp_path: Path) -> None:
    _rig(tmp_path)
    study = tmp_path / "study.toml"
    study.write_text(RIG_WITH_GAINS)
    made = run_study(study)
    assert made.tuning is not None
    gain = made.tuning.designs[0].gains["Kp"]
    assert f"{gain:.4g} * " in (made.output / "controller.c").read_text()


def test_a_study_that_was_changed_by_hand_stays(tmp_path: Path) -> None:
    made = propose_study([_rig(tmp_path)], folder=tmp_path, model="rate_first_order")
    target = made.write(tmp_path / "rig-study.toml")
    made.write(target)
    target.write_text(target.read_text().replace("Models of rig", "Mine"))
    with pytest.raises(StudyError, match="not as flightid wrote it"):
        made.write(target)
    assert "Mine" in target.read_text()


def _answers_at_once(rig: Path, idle: tuple[str, ...]) -> Path:
    """So that a finding of the scan's fit asks for a declared loop; with an input that is idle.

    The study leaves that input out, so the scan that it can use does too.
    """
    head, *rows = rig.read_text().splitlines()
    cells = [row.split(",") for row in rows]
    other = np.random.default_rng(9).standard_normal((len(rows), len(idle)))
    fast = [
        ",".join([t, u, f"{float(y) + 2 * float(u):.8g}", *(f"{v:.6g}" for v in beside)])
        for (t, u, y), beside in zip(cells, other, strict=True)
    ]
    rig.write_text("\n".join([",".join([head, *idle]), *fast]) + "\n")
    return rig


@pytest.mark.parametrize("idle", [(), ("idle",)], ids=["alone", "beside an idle input"])
def test_a_proposal_hands_its_scan_to_the_study_that_it_wrote(
    tmp_path: Path, idle: tuple[str, ...]
) -> None:
    rig = _answers_at_once(_rig(tmp_path), idle)
    inputs = ["volts", *idle]
    known: dict[str, object] = {}
    study = tmp_path / "study.toml"
    with speaking(as_typed):
        made = propose_study([rig], folder=tmp_path, inputs=inputs, outputs=["beam"], cache=known)
    made.write(study)
    found, alone = (
        run_study(study, output=tmp_path / name, cache=given)
        for name, given in (("handed", dict(known)), ("alone", None))
    )
    model = f"beam from {' and '.join(inputs)}"
    kept = {"record: rig, fitted", "record: rig, choice", f"orders: {model}"}
    kept |= {f"response: {model}, auto", f"coherence: {model}"}
    assert [each.fit.model.inputs for each in found.identified] == [("volts",)]
    assert kept == set(found.from_cache) <= set(alone.carried_out)
    # To the last digit and word, though the command that scanned speaks of options.
    written = [(tmp_path / name / "results.json").read_text() for name in ("handed", "alone")]
    assert written[0] == written[1]
    # Other samples: nothing of the old ones stands.
    _answers_at_once(_rig(tmp_path, seed=1), idle)
    again = run_study(study, output=tmp_path / "changed", cache=known)
    assert again.from_cache == ()


def test_columns_are_told_by_name_then_unit_or_refused() -> None:
    stamps = np.arange(4) * 0.1
    channels = dict.fromkeys(("a", "b"), stamps)
    known = Record.from_arrays(stamps, others=channels, units={"a": "V", "b": "rad"})
    found = columns_of([known], (), ())
    assert (found.inputs, found.outputs) == (("a",), ("b",))
    named = columns_of([known], ("b",), ())
    assert (named.inputs, named.outputs) == (("b",), ("a",))
    bare = Record.from_arrays(stamps, others=channels, units={"a": "1", "b": "1"})
    with pytest.raises(StudyError, match="do not tell which are inputs"):
        columns_of([bare], (), ())
    with pytest.raises(StudyError, match="no column is left for them: name fewer --inputs"):
        columns_of([bare], ("a", "b"), ())
    with pytest.raises(UnknownNameError, match="no such column"):
        columns_of([bare], ("c",), ())
    # DaISy's exchanger: the answer is told, and one column is left.
    daisy = Record.from_arrays(stamps, others=dict.fromkeys(("q_flow", "th_out"), stamps))
    found = columns_of([daisy], (), ())
    assert (found.inputs, found.outputs) == (("q_flow",), ("th_out",))
    assert found.said[0].startswith("Inputs q_flow (as what is left), outputs th_out (by their")


def test_data_without_a_model_give_no_study(tmp_path: Path) -> None:
    with pytest.raises(StudyError, match="carry no model"):
        Proposal((), ()).write(tmp_path / "study.toml")
    still = tuple(
        Finding("none", Light.RED, f"{axis}: no model, nothing was injected", "fly a sweep")
        for axis in ("roll", "yaw")
    )
    with pytest.raises(StudyError, match=r"roll, yaw: nothing was injected.*Next: fly a sweep"):
        Proposal((), (), still).write(tmp_path / "study.toml")
    assert "No model can be identified" in Proposal((), ()).refusal()
    time_s = np.arange(30) * 0.1
    short = np.column_stack([time_s, np.sign(np.sin(3.0 * time_s)), np.sin(3.0 * time_s)])
    np.savetxt(tmp_path / "rig.csv", short, delimiter=",", header="t_s,u,y", comments="")
    made = study_of_records(
        [tmp_path / "rig.csv"], tmp_path, model=None, inputs=("u",), outputs=("y",)
    )
    said = " ".join(made.refusal().split())
    assert "the record is too short: 30 samples, 7 of them to choose orders by" in said


@pytest.mark.parametrize("grid", [None, 0.1])
def test_structures_are_tried_behind_what_the_study_conditions(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, grid: float | None
) -> None:
    """Of a servo with two spikes arx had 8 deg in place of .986, and the sentence stayed."""
    time_s = np.arange(400) * 0.1
    swing = np.sin(3.0 * time_s) + 0.01 * np.random.default_rng(0).standard_normal(400)
    swing[[100, 260]] += 30.0
    rows = np.column_stack([time_s, np.sign(np.sin(3.0 * time_s)), swing])
    np.savetxt(tmp_path / "rig.csv", rows, delimiter=",", header="t_s,u,y", comments="")
    seen: list[GroupScans] = []
    monkeypatch.setattr(
        of_records, "structures_of", lambda asked: (seen.append(asked), ([], []))[1]
    )
    outliers = {"deviations": 9, "channels": ["y"]}
    told = {"conditioning": [
        {"records": ["rig.csv: rig"], "outliers": outliers},
        {"records": ["gone.csv: gone"], "detrend": "mean"},
    ]}  # fmt: skip
    for kept, most in ((told, 1.1), ({}, 29.0)):
        made = propose_study(
            [tmp_path / "rig.csv"], folder=tmp_path, inputs=["u"], outputs=["y"],
            resample_to_s=grid, **kept,
        )  # fmt: skip
        flown = seen.pop().scans.flown("y", ("u",))
        assert (np.abs(flown["y"]).max() < most) == bool(kept)
        names = ["rig, fitted", "rig, choice", "rig, unseen"]
        tables = [{"records": names, "outliers": outliers}] if kept else []
        assert tomllib.loads(made.text).get("conditioning", []) == tables


def test_units_and_a_fall_come_first_then_the_commands_that_go_on(tmp_path: Path) -> None:
    write_ordinary_log(tmp_path / "day.bin", duration_s=20.0)
    looked = inspect_log(tmp_path / "day.bin")
    fall = Finding("tipped-over", Light.AMBER, "it falls", "look for its cause")
    units = Finding("scale-contradicted", Light.RED, "57 times the turning", "state the true unit")
    missed = (Finding("no-model", Light.RED, "roll: no model, no sweep", "fly a sweep"),)
    log = Finding("slow", Light.AMBER, "slow", "log faster")
    gaps = Finding("gaps", Light.AMBER, "gaps", "log faster: no card is to blame")
    found = replace(looked, findings=(*looked.findings, fall, units, log, gaps))
    said = Proposal((), (), missed, found).refusal()
    todo = said.partition("What to do, the first first\n")[2].splitlines()
    assert [line.split(":")[0] for line in todo[:3]] == [
        "- state the true unit", "- look for its cause", "- flightid flight day.bin",
    ]  # fmt: skip
    assert sum("flightid plan day.bin" in line for line in todo) == 1, "a command is said once"
    assert any(line == "- fly a sweep" for line in todo)
    assert [line for line in todo if "log faster" in line] == ["- log faster: no card is to blame"]
    at = {
        word: k
        for k, line in enumerate(todo)
        for word in ("log faster", "plan day")
        if word in line
    }
    assert at["log faster"] < at["plan day"], "sweeps of a log that is too slow are flown in vain"
    motors = Finding("saturated", Light.AMBER, "C3 at its limit", "straighten motors first")
    phases = replace(looked.phases, tipped_s=15.0)
    fallen = replace(found, findings=(*found.findings, motors), phases=phases)
    todo = Proposal((), (), missed, fallen).refusal().partition("first first\n")[2].splitlines()
    assert [line.split(":")[0] for line in todo[1:4]] == [
        "- look for its cause", "- straighten motors first", "- flightid flight day.bin",
    ]  # fmt: skip


def test_records_without_times_take_a_sample_time_into_the_study(tmp_path: Path) -> None:
    rig = _rig(tmp_path)
    rows = [line.split(",")[1:] for line in rig.read_text().splitlines()]
    bare = tmp_path / "bare.csv"
    bare.write_text("\n".join(",".join(row) for row in rows))
    asked = {"folder": tmp_path, "model": "rate_first_order"}
    made = propose_study([bare], **asked, sample_time_s=0.1)
    told = [line for line in made.lines if line.startswith("sample_time_s")]
    assert told == ["sample_time_s = 0.1"] * 2
    with pytest.raises(OptionError, match="no time column"):
        propose_study([bare], **asked)


def test_uneven_stamps_take_a_new_grid_into_the_study(tmp_path: Path) -> None:
    rig = _rig(tmp_path)
    head, *rows = rig.read_text().splitlines()
    parted = [row.split(",", 1) for row in rows]
    rows = [f"{float(at) + 0.03 * (k % 2):.2f},{rest}" for k, (at, rest) in enumerate(parted)]
    uneven = tmp_path / "uneven.csv"
    uneven.write_text("\n".join([head, *rows]))
    asked = {"folder": tmp_path, "model": "rate_first_order"}
    with pytest.raises(DataError, match="resample_to_s="):
        propose_study([uneven], **asked)
    made = propose_study([uneven], resample_to_s=0.1, **asked)
    assert [line for line in made.lines if line.startswith("resample")] == [
        "resample_to_s = 0.1"
    ] * 2


def test_a_folder_for_gains_is_asked_for_before_the_work(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    target = tmp_path / "none" / "gains.toml"
    words = ["tune", str(_rig(tmp_path)), "--controller", "pi", "--write", str(target)]
    assert run(words) == 2
    assert "there is no folder" in capsys.readouterr().err
    assert not (tmp_path / "rig-study.toml").exists()


@pytest.mark.parametrize("taken", ["gains.toml", "gains-1.toml"])
def test_files_of_gains_are_not_replaced_after_the_work(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], taken: str
) -> None:
    """The whole run went by, and its answer with it: the file was refused at the end."""
    (tmp_path / taken).write_text("# of another day")
    target = str(tmp_path / "gains.toml")
    assert run(["tune", str(_rig(tmp_path)), "--controller", "pi", "--write", target]) == 2
    said = capsys.readouterr().err
    assert "there already" in said
    assert f"found {tmp_path / taken}" in said
    assert "or --overwrite" in said
    assert not (tmp_path / "rig-study.toml").exists()


def test_an_injected_channel_is_the_instrument_of_a_closed_loop(tmp_path: Path) -> None:
    """SciPy's loop: direct fits of it are biased, the injected signal finds it again."""
    random, rate_hz, n = np.random.default_rng(5), 50.0, 6000
    time_s = np.arange(n) / rate_hz
    injected = 0.3 * chirp(time_s % 60.0, 0.1, 60.0, 10.0, method="logarithmic")
    gust = 0.8 * lfilter([0.1], [1.0, -0.98], random.standard_normal(n))
    decay, state = np.exp(-4.0 / rate_hz), 0.0
    u, y = np.zeros(n), np.zeros(n)
    for k in range(n):
        y[k] = state + gust[k]
        u[k] = injected[k] - 0.15 * y[k]
        state = decay * state + 10.0 * (1.0 - decay) * u[k]
    head = "time,tau_phi [1],p [rad/s],chirp [1]"
    table = np.column_stack([time_s, u, y, injected])
    rows = [",".join(f"{value:.6f}" for value in row) for row in table]
    (tmp_path / "closed.csv").write_text("\n".join([head, *rows]))
    asked = {"folder": tmp_path, "model": "rate_first_order", "hold": "zero"}
    plain = propose_study([tmp_path / "closed.csv"], **asked)
    assert 'method = "output_error"' in plain.text
    with pytest.raises(
        StudyError,
        match=r"closed loop.*model='rate_first_order'.*flightid response.*--estimator instrument",
    ):
        propose_study([tmp_path / "closed.csv"], folder=tmp_path, excitations=["chirp"])
    made = propose_study([tmp_path / "closed.csv"], excitations=["chirp"], **asked)
    assert "Injected: chirp (as named)" in made.said
    assert 'response = { estimator = "instrument", excitations = ["chirp"] }' in made.text
    study = run_study(made.write(tmp_path / "closed.toml"))
    assert study.identified[0].fit is not None
    assert list(study.identified[0].fits) == ["instrument"]
    for name, truth in (("Ltphi", 40.0), ("Lp", -4.0)):
        found = study.identified[0].fit.parameters[name]
        assert found.interval95[0] < truth < found.interval95[1], found
    with pytest.raises(UnknownNameError, match="no such column"):
        propose_study([tmp_path / "closed.csv"], excitations=["sweep"], **asked)


def test_sweeps_of_one_input_each_are_fitted_together(tmp_path: Path) -> None:
    """Alone none of them tells what the other input does: the run found it without power."""
    rng = np.random.default_rng(4)
    flown = []
    for name, n, moved in (("a", 900, 0), ("b", 900, 1), ("doublet a", 150, 0)):
        injected = np.zeros((2, n))
        injected[moved] = np.sin(0.002 * np.arange(n) ** 1.6)
        stick = injected + 0.01 * rng.standard_normal((2, n))
        flown.append(
            Record.from_arrays(
                0.02 * np.arange(n),
                inputs={"lat": stick[0], "lon": stick[1]},
                outputs={"p": np.cumsum(stick[0]), "q": np.cumsum(stick[1])},
                excitations={"sweep_lat": injected[0], "sweep_lon": injected[1]},
                name=name,
            )
        )
    write_records(flown, tmp_path / "flights.nc")
    made = propose_study(
        [tmp_path / "flights.nc"], folder=tmp_path, model="r50_hover", inputs=["lat", "lon"],
        outputs=["p", "q"], excitations=["sweep_lat", "sweep_lon"],
    )  # fmt: skip
    assert 'identify = ["a", "b"]' in made.text
    assert 'verify = ["doublet a"]' in made.text
    assert 'responses = "coherent"\noutputs = ["p", "q"]' in made.text
    assert "conditioning" not in made.text
    # Where one sweep holds all that was injected, each manoeuvre stands for itself as before.
    one = propose_study(
        [tmp_path / "flights.nc"], folder=tmp_path, model="r50_hover", inputs=["lat", "lon"],
        outputs=["p", "q"], excitations=["sweep_lat"],
    )  # fmt: skip
    assert 'identify = "a, fitted"' in one.text
    # No part ranks equations that are given; the sweep of `lat` ends at 9.5 rad/s.
    assert "choice" not in one.text
    band = re.search(r"band_rad_s = \[([\d.]+), ([\d.]+)\]", one.text)
    assert band is not None
    assert 8.0 < float(band[2]) < 10.5
    (said,) = [each.message for each in one.findings if each.code == "inputs-unswept"]
    assert said.startswith("lon: not swept, sweep_lat alone is")
    assert not [each for each in made.findings if each.code == "inputs-unswept"]


def test_a_cut_leaves_no_input_without_its_sweep(tmp_path: Path) -> None:
    """Two sticks of one flight in turn: one of them last and once, once each, twice each.

    Each sweep is of 300 samples; what is still between them is exactly so.
    """
    rng, sweep = np.random.default_rng(6), np.sin(0.002 * np.arange(300) ** 1.7)
    proposed = {}
    for order in ("aaab", "ab", "abab", "abb", "aab"):
        injected = np.zeros((2, 20 + 320 * len(order)))
        for k, stick in enumerate(order):
            injected["ab".index(stick), 20 + 320 * k :][:300] = sweep
        stick = injected + 0.01 * rng.standard_normal(injected.shape)
        flown = Record.from_arrays(
            0.02 * np.arange(injected.shape[1]),
            inputs={"lat": stick[0], "lon": stick[1]},
            outputs={"p": np.cumsum(stick[0]), "q": np.cumsum(stick[1])},
            excitations={"sweep_lat": injected[0], "sweep_lon": injected[1]},
            name=order,
        )
        write_records(flown, tmp_path / f"{order}.nc")
        made = propose_study(
            [tmp_path / f"{order}.nc"], folder=tmp_path, model="r50_hover", inputs=["lat", "lon"],
            outputs=["p", "q"], excitations=["sweep_lat", "sweep_lon"],
        )  # fmt: skip
        assert not [each for each in made.findings if each.code == "inputs-unswept"]
        study = proposed[order] = tomllib.loads(made.text)
        start, stop = study["record"][0]["span_s"]
        fitted = (flown.time_s >= start) & (flown.time_s <= stop)
        swept = [np.count_nonzero(channel[fitted]) for channel in injected]
        assert min(swept) >= 0.7 * np.count_nonzero(sweep), order
        (said,) = [e for e in made.findings if e.code == "nothing-unseen"] or [None]
        assert (said is None) == (len(study["record"]) == 2) == ("verify" in study["model"][0])
        if order == "ab":
            assert said is not None
            assert said.message.startswith("a stretch to verify on: every cut of ab leaves an inp")
            assert "fly a second flight, sweeps or doublets" in said.action
    spans = {name: [each["span_s"] for each in made["record"]] for name, made in proposed.items()}
    assert spans["ab"] == [[0.0, pytest.approx(0.02 * 659)]]
    # The last quarter goes where that leaves each its sweep; else the cut follows what does not.
    assert len(spans["abab"]) == len(spans["abb"]) == len(spans["aab"]) == 2
    assert spans["aaab"][1][0] == spans["aab"][1][0] == 0.0
    # Of sweeps in turn some responses say nothing, as of those in files of their own.
    for made in proposed.values():
        assert made["model"][0]["responses"] == "coherent"
        assert made["model"][0]["outputs"] == ["p", "q"]


def test_a_known_servo_is_taken_out_ahead_of_the_model(tmp_path: Path) -> None:
    """SciPy's servo of 12 rad/s before a vehicle of 4 rad/s: it takes the model's place."""
    n, rate_hz = 3000, 50.0
    u = np.repeat(np.random.default_rng(2).choice([-1.0, 1.0], n // 20), 20)
    y = lsim(([40.0 * 12.0], np.polymul([1.0, 4.0], [1.0, 12.0])), u, np.arange(n) / rate_hz)[1]
    y += np.random.default_rng(3).normal(0.0, 0.05, n)
    rows = [f"{k / rate_hz:.2f},{u[k]:g},{y[k]:.6f}" for k in range(n)]
    path = tmp_path / "arm.csv"
    path.write_text("\n".join(["time,tau_phi [1],p [rad/s]", *rows]))
    asked = {"folder": tmp_path, "model": "rate_first_order", "hold": "first"}
    found = {}
    for servos in ({}, {"tau_phi": 12.0}):
        made = propose_study([path], actuators=servos, **asked)
        fit = run_study(made.write(tmp_path / f"{len(servos)}.toml")).identified[0].fit
        assert fit is not None
        found[len(servos)] = fit.parameters["Lp"]
    assert found[1].interval95[0] < -4.0 < found[1].interval95[1]
    assert abs(found[1].value + 4.0) < 0.05 < 0.5 < abs(found[0].value + 4.0)
    with pytest.raises(StudyError, match="actuators are taken out for a model of equations alone"):
        propose_study([path], folder=tmp_path, actuators={"tau_phi": 12.0})
    with pytest.raises(UnknownNameError, match="an actuator has no input"):
        propose_study([path], actuators={"p": 12.0}, **asked)


def test_columns_of_other_names_are_those_of_the_model(tmp_path: Path) -> None:
    """Equations name tau_phi and p; the file has u and y, in that order."""
    rng = np.random.default_rng(5)
    n = 400
    u, y = np.repeat(rng.choice([-1.0, 1.0], n // 10), 10), np.zeros(n)
    for k in range(1, n):
        y[k] = 0.9 * y[k - 1] + 0.1 * u[k - 1]
    y += 0.01 * rng.standard_normal(n)
    path = tmp_path / "rig.csv"
    rows = np.column_stack([0.02 * np.arange(n), u, y])
    np.savetxt(path, rows, delimiter=",", header="time_s,u,y [rad/s]", comments="")
    named = {"folder": tmp_path, "inputs": ("u",), "outputs": ("y",)}
    made = propose_study([path], model="rate_first_order", **named)
    lines = [line for line in made.lines if line.startswith("columns")]
    assert lines == ['columns = { tau_phi = "u", p = "y" }'] * 2
    made.write(tmp_path / "study.toml")
    (model,) = run_study(tmp_path / "study.toml", output=tmp_path / "out").identified
    assert abs(model.fit.parameters["Lp"].value + 5.27) < 0.5  # ln 0.9 / 0.02 s
    assert not any("columns" in line for line in propose_study([path], **named).lines)
