"""Records of a rig in the workspace: sets of files, by the hash of the first."""

from __future__ import annotations

import asyncio
import hashlib
import tomllib
from collections.abc import AsyncIterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest

from flightid.app.guard import POLICY, REPORT_POLICY, _dressed
from flightid.app.pyramid import Pyramid
from flightid.app.removed import RemovedList
from flightid.app.rig_routes import roles_of
from flightid.app.rig_schemas import RigReading
from flightid.app.rig_work import input_ways, make_rig, make_rig_pyramid, require_table
from flightid.app.rigs import Rigs
from flightid.app.study_edits import KeyEdit, edited
from flightid.app.work import answered
from flightid.app.workspace import Workspace
from flightid.errors import FileFormatError, OptionError, StudyError
from flightid.record import read_records, write_records
from flightid.record.checks import record_findings
from flightid.study.previewed import PreviewedStudy
from flightid.study.proposal.columns import columns_of
from flightid.study.stage_runner import StageRunner
from flightid.study.taking import take

TABLE = b"t,u,y\n0,1,2\n1,0,3\n2,1,1\n"


async def _checked(path: Path) -> str:
    return answered(require_table, path)[1]


async def _pieces(content: bytes) -> AsyncIterator[bytes]:
    yield content[:5]
    yield content[5:]


def test_files_of_a_rig_stay_together_and_nothing_else_enters(tmp_path: Path) -> None:
    rigs = Rigs(Workspace(tmp_path))

    def take(name: str, content: bytes, rig: str = "") -> str:
        return asyncio.run(rigs.take(name, _pieces(content), rig, check=_checked))

    first = take("../a.csv", TABLE)
    assert first == hashlib.sha256(TABLE).hexdigest()[:16]
    assert take("a.csv", TABLE + b"3,1,1\n", first) == take("a.csv", TABLE, first) == first
    assert [path.name[:2] for path in rigs.files(first)] == ["a ", "a."]
    assert rigs.ids() == [first]
    with pytest.raises(FileFormatError):
        take("a.mat", b"no MATLAB file")
    for letter in (b"Dear Ann\nthank you for the drone.\n", b"# A title\n\nIt flies.\nBob, hm\n"):
        with pytest.raises(FileFormatError, match=r"letter\.txt (holds no|is not a) table of num"):
            take("letter.txt", letter)
    with pytest.raises(OptionError, match="no file can be added"):
        take("b.csv", TABLE, "0" * 16)
    (tmp_path / "records" / first / "planted.csv").symlink_to("/etc/passwd")
    assert "planted.csv" not in [path.name for path in rigs.files(first)]
    assert rigs.files("../../etc") == []


def test_what_is_taken_off_the_list_stays_in_its_place(tmp_path: Path) -> None:
    workspace = Workspace(tmp_path)
    removed = RemovedList(workspace)
    assert removed.ids() == []
    for item in ("a" * 16, "b" * 16, "a" * 16):
        removed.take_off(item)
    assert RemovedList(workspace).ids() == ["b" * 16, "a" * 16]
    removed.put_back("b" * 16)
    removed.put_back("c" * 16)
    assert removed.ids() == ["a" * 16]
    # Two servers on one folder lost what the other had taken off meanwhile.
    more = [f"{n:016x}" for n in range(24)]
    with ThreadPoolExecutor(4) as pool:
        list(pool.map(lambda item: RemovedList(workspace).take_off(item), more))
    assert set(removed.ids()) == {"a" * 16, *more}
    path = tmp_path / ".flightid" / "removed.json"
    for broken in (b"", b"[1]", b'{"removed": 3}', b'{"removed": ["../x", 4]}', b"\xff"):
        path.write_bytes(broken)
        assert removed.ids() == []
    path.unlink()
    path.symlink_to("/etc/passwd")
    assert removed.ids() == []
    removed.take_off("d" * 16)
    assert not path.is_symlink()
    assert removed.ids() == ["d" * 16]
    # A file of a set, beside whole sets.
    removed.leave_out("e" * 16, "b.csv", out=True)
    removed.take_off("e" * 16)
    assert (removed.files("e" * 16), removed.files("f" * 16)) == (["b.csv"], [])
    removed.leave_out("e" * 16, "b.csv", out=False)
    assert (removed.files("e" * 16), removed.ids()) == ([], ["d" * 16, "e" * 16])
    for broken in (b'{"files": 3}', b'{"files": {"e": 4}}'):
        path.write_bytes(broken)
        assert removed.files("e") == []


def test_a_file_without_time_says_so_and_reads_with_a_sample_time(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    path.write_text("u,y\n" + "".join(f"{k % 2},{k}\n" for k in range(40)), encoding="utf-8")
    told = make_rig([path], {})
    assert "Sample time" in told["files"][0]["error"]
    assert not told["files"][0]["manoeuvres"]
    told = make_rig([path], {"sample_time_s": 0.5})
    assert told["files"][0]["manoeuvres"][0]["stop_s"] == 19.5
    assert (told["inputs"], told["outputs"]) == (["u"], ["y"])


def test_a_refusal_of_many_columns_counts_them_in_words_of_the_page(tmp_path: Path) -> None:
    """Forty names filled the screen, and ``time_column=…`` is no field of it."""
    path = tmp_path / "wide.csv"
    names = [f"channel{k}" for k in range(40)]
    rows = [",".join(str(k + row) for k in range(40)) for row in range(3)]
    path.write_text("\n".join([",".join(names), *rows]) + "\n")
    (told,) = make_rig([path], {})["files"]
    assert "40 columns, channel0, " in told["error"]
    assert "channel39" not in told["error"]
    assert "=" not in told["error"]
    assert "the role “time” of a column or Sample time" in told["error"]


def test_what_is_untold_is_told_without_flags_of_the_command_line(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    path.write_text("time,$(x) b,c d\n" + "".join(f"{k},{k % 2},{k % 3}\n" for k in range(40)))
    told = make_rig([path], {})["untold"]
    assert told.startswith("the columns do not tell which are inputs")
    assert "--" not in told
    with pytest.raises(StudyError, match=r"name them: --inputs '\$\(x\) b'"):
        columns_of(read_records(path), (), ())


def test_a_column_that_stands_still_has_a_row_as_well(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    path.write_text("time,u1,u2,y\n" + "".join(f"{k},{k % 2},0.5,{k}\n" for k in range(40)))
    columns = {each["name"]: each for each in make_rig([path], {})["files"][0]["columns"]}
    assert list(columns) == ["time", "u1", "y", "u2"]
    assert columns["u2"] | {"unit": ""} == {
        "name": "u2", "unit": "", "samples": 40, "least": 0.5, "most": 0.5,
    }  # fmt: skip
    # A file of records, as a flight on the page leaves one, has no table of contents.
    (record,) = read_records(path)
    write_records(record, tmp_path / "flown.nc")
    (told,) = make_rig([tmp_path / "flown.nc"], {})["files"]
    moves = {each["name"]: (each["least"], each["most"]) for each in told["columns"]}
    assert moves == {"u1": (0.0, 1.0), "u2": (0.5, 0.5), "y": (0.0, 39.0)}
    assert told["notes"] == []


def test_faults_are_told_where_they_are_and_not_from_the_first_to_the_last(tmp_path: Path) -> None:
    """Two spikes 24 s apart had shaded a quarter of the flight."""
    time_s = 0.02 * np.arange(2500)
    noise = np.random.default_rng(1).standard_normal(2500)
    samples = np.sin(1.3 * time_s) + 0.4 * np.sin(7.0 * time_s) + 0.02 * noise
    samples[[600, 1800]] += 40.0
    rows = np.column_stack([time_s, np.sign(np.sin(time_s)), samples])
    path = tmp_path / "rig.csv"
    np.savetxt(path, rows, delimiter=",", header="time,u,y", comments="")
    (manoeuvre,) = make_rig([path], {})["files"][0]["manoeuvres"]
    (fault,) = manoeuvre["faults"]
    assert (fault["code"], fault["spans_s"]) == ("spikes", [(12.0, 12.0), (36.0, 36.0)])
    # What a click on "Bridge them" writes takes out these, and no other sample.
    asked = {"deviations": fault["deviations"], "channels": ["y"]}
    (clean,) = read_records(path, outputs=["y"], resample_to_s=0.02, outliers=[asked])
    assert "spikes" not in [each.code for each in record_findings(clean)]
    assert np.sum(np.abs(clean["y"] - samples) > 1e-9) == 2
    # Between them there is none: a record that leaves them out has no such finding.
    (spiked,) = read_records(path, inputs=["u"], outputs=["y"])
    assert "spikes" not in [each.code for each in record_findings(spiked.segment(12.1, 35.9))]
    assert "spikes" in [each.code for each in record_findings(spiked.segment(12.1, 36.1))]


def test_stamps_that_are_not_uniform_get_a_grid_on_the_page(tmp_path: Path) -> None:
    noise = np.random.default_rng(2)
    time_s = 0.02 * np.arange(1500) + 4e-4 * noise.standard_normal(1500)
    u = np.repeat(noise.choice([-1.0, 1.0], 60), 25)
    path = tmp_path / "rig.csv"
    np.savetxt(path, np.column_stack([time_s, u, np.roll(u, 3)]), delimiter=",", comments="",
               header="time,u,y")  # fmt: skip
    # The stamps' unit is the same before a grid is chosen and after.
    stamped = tmp_path / "stamped.csv"
    np.savetxt(stamped, np.column_stack([1e3 * time_s, u, np.roll(u, 3)]), delimiter=",",
               comments="", header="t_ms,u,y")  # fmt: skip
    for reading in ({}, {"resample_to_s": 0.02}):
        told = make_rig([stamped], reading)
        assert (told["time"], told["time_unit"]) == ("t_ms", "ms")
    (told,) = make_rig([path], {})["files"]
    assert "time stamps are not uniform" in told["error"]
    assert "Resample to = 0.02," in told["error"]
    assert (told["grid_s"], told["manoeuvres"]) == (0.02, [])
    (told,) = make_rig([path], {"resample_to_s": 0.02})["files"]
    assert (told["error"], told["grid_s"]) == ("", 0.02)
    assert told["manoeuvres"][0]["rate_hz"] == pytest.approx(50.0)
    reading = {"resample_to_s": 0.02}
    roles = roles_of(["u", "y"], ["u"], RigReading.model_validate(reading))
    assert roles == {"inputs": ["u"], "outputs": ["y"]}
    result = tmp_path / "u.npy"
    make_rig_pyramid(path, "rig", "u", reading | roles, result)
    drawn = Pyramid.read(result)
    assert np.ptp(np.diff(drawn.time_s)) < 1e-9
    # What the study fits: an input is held between its rows and never rings.
    assert set(np.unique(drawn.values)) == {-1.0, 1.0}
    # Another file of the rig with three levels: its input steps too, on the page and in a study.
    doublet = np.repeat([0.0, 0.6, -0.6, 0.0], [500, 200, 200, 600])
    np.savetxt(tmp_path / "more.csv", np.column_stack([time_s, doublet, np.roll(doublet, 3)]),
               delimiter=",", comments="", header="time,u,y")  # fmt: skip
    ways = input_ways([path, tmp_path / "more.csv"], reading | roles)
    assert ways == {"more.csv": {"u": "previous"}}
    tables = "".join(
        f'[[record]]\nname = "{name}"\npath = "{name}.csv"\nresample_to_s = 0.02\n'
        for name in ("rig", "more")
    )
    model = '[[model]]\nname = "m"\nstructure = "arx"\nna = 1\nnb = 1\nnk = 3\n'
    model += 'inputs = "u"\noutputs = "y"\n'
    study = tmp_path / "study.toml"
    for said, levels in (("", {0.0, 0.6, -0.6}), ('hold = "band_limited"\n', None)):
        text = f'[study]\ntitle = "T"\n{tables}{said}{model}identify = "rig"\nverify = "more"\n'
        study.write_text(text, "utf-8")
        draft = PreviewedStudy.of(study)
        read = take(draft.settings, draft.tasks(), None, tmp_path, StageRunner()).records
        (rig,), (more,) = read["rig"].value, read["more"].value
        # What is said of one record holds in those of which nobody says anything.
        assert (set(np.unique(rig["u"])) == {-1.0, 1.0}) == (levels is not None)
        assert (set(np.unique(more["u"])) == levels) == (levels is not None)


def test_a_table_of_a_list_is_taken_out() -> None:
    text = "[[model]]\nname = 'A'\n\n[[model]]\nname = 'B'\n"
    left = edited(text, [KeyEdit(("model", 0), None)])
    assert left.strip() == "[[model]]\nname = 'B'"
    # The last one leaves no empty list, into which no table could go any more.
    gone = edited(left + "[tune]\n", [KeyEdit(("model", 0), None)])
    assert tomllib.loads(gone) == {"tune": {}}
    for bare in (gone, "model = []\n[tune]\n"):
        again = edited(bare, [KeyEdit(("model", 0), {"name": "C", "fit": {"seed": 1}})])
        assert tomllib.loads(again) == {"tune": {}, "model": [{"name": "C", "fit": {"seed": 1}}]}


def test_only_the_report_has_another_policy() -> None:
    """No answer but the report can loosen the policy of the page."""

    def policy(given: str) -> bytes:
        heard: list[dict[bytes, bytes]] = []

        async def send(message: dict[str, object]) -> None:
            heard.append(dict(message["headers"]))  # type: ignore[call-overload]

        headers = [(b"content-security-policy", given.encode())]
        start = {"type": "http.response.start", "headers": headers}
        asyncio.run(_dressed(send)(start))  # type: ignore[arg-type]
        return heard[0][b"content-security-policy"]

    assert policy("default-src *") == POLICY.encode()
    assert policy(REPORT_POLICY) == REPORT_POLICY.encode()
    assert REPORT_POLICY.startswith("sandbox ")
    assert "allow-same-origin" not in REPORT_POLICY
