"""A record that a model was fitted to is known again, whole and in part, and said."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import flightid as fid
from flightid.cli.program import run
from flightid.conventions import Light
from flightid.errors import DataError
from flightid.evidence import Check, Evidence
from flightid.record.digest import (
    MARKS,
    MOST_MARKS,
    SPACING,
    RecordDigest,
    _smallest,
    digest_of,
    record_sha256,
)
from flightid.validation.verification.of_the_fit import SEEN
from tests.closeness import assert_close
from tests.contract.test_kinds import STRUCTURES, fit, record

OF_RESPONSE = "response"


def _made(kind: str) -> fid.Fit:
    if kind != OF_RESPONSE:
        return fit(kind)
    response = fid.estimate_response(record(), band_rad_s=(1.0, 10.0), window_s=5.0)
    return fid.identify(fid.load_model("rate_first_order"), response.select(n_omega=20))


def _said(source: object, flown: fid.Record) -> list[str]:
    return [f.message for f in fid.verify(source, flown).findings if f.code == SEEN]


@pytest.mark.parametrize("kind", [*STRUCTURES, OF_RESPONSE])
def test_fits_and_their_files_know_their_record(kind: str, tmp_path: Path) -> None:
    made = _made(kind)
    fresh = record().replace({"p": record()["p"] + 1e-9})
    for source in (made, fid.load_model(fid.write_model(made, tmp_path / "model.toml"))):
        for same in (record(), record().replace(name="copy"), record().segment(4.0, 12.0)):
            (words,) = _said(source, same)
            assert "these samples (record 'record'), which the run explains" in words
        assert not _said(source, fresh)
    assert not _said(STRUCTURES["transfer"](), record())


def test_a_record_that_holds_a_part_of_the_fitted_one_is_told(tmp_path: Path) -> None:
    made = fid.identify(STRUCTURES["OE"](), record().segment(0.0, 9.0), loop="open")
    assert "a part of these samples" in _said(made, record())[0]
    assert not _said(made, record().segment(9.0, 15.0))


def test_the_command_says_so_of_a_file(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    model = fid.write_model(fit("OE"), tmp_path / "model.toml")
    table = np.column_stack([record().time_s, record()["tau_phi"], record()["p"]])
    heading = "time [s],tau_phi,p [rad/s]"
    flown = tmp_path / "again.csv"
    np.savetxt(flown, table, "%.17g", ",", header=heading, comments="")
    assert run(["verify", str(model), str(flown)]) == 0
    assert "[amber] again: the model was fitted to these samples" in capsys.readouterr().out


def test_a_hash_is_of_content_alone() -> None:
    one = record()
    assert record_sha256(one) == record_sha256(one.replace(name="other"))
    assert record_sha256(one, ["p", "tau_phi"]) == record_sha256(one, ["tau_phi", "p"])
    others = (
        one.replace({"p": one["p"] + 1e-12}), one.to_units(p="deg/s"), one.select(["p"]),
        one.replace({"p": -one["p"]}), one.segment(0.0, 10.0),
    )  # fmt: skip
    assert len({record_sha256(each) for each in (one, *others)}) == 1 + len(others)


def test_marks_are_few_and_still_samples_make_none() -> None:
    noise = np.random.default_rng(3).standard_normal(5000)
    still = np.where(np.arange(5000) < 2500, 0.0, noise)
    base = fid.Record.from_arrays(np.arange(5000) * 0.01, outputs={"y": noise, "z": still})
    made = digest_of(base, ["y", "z"])
    assert {name: len(text) // 16 for name, text in made.marks.items()} == {"y": 199, "z": 100}
    few = digest_of(base.segment(0.0, 8.0), ["y"]).marks["y"]
    assert len(few) == 16 * MARKS, "of a short record as many as ever"
    long = fid.Record.from_arrays(np.arange(40_000) * 0.01, outputs={"y": np.tile(noise, 8)})
    assert len(digest_of(long, ["y"]).marks["y"]) <= 16 * MOST_MARKS
    flat = base.segment(0.0, 20.0).replace({"y": 0 * noise[:2000]})
    assert digest_of(flat, ["y"]).marks["y"] == ""
    assert made.shared(flat, ["z"]) == 0.0
    half = base.replace({"y": np.where(np.arange(5000) < 2500, noise, noise[::-1])})
    assert_close(made.shared(half, ["y"]), 0.5, atol=0.25, why="half of the spans, by 64 marks")


def test_a_digest_that_was_changed_by_hand_is_refused() -> None:
    plain = digest_of(record(), ["p"]).to_dict()
    assert RecordDigest.from_dict(plain).to_dict() == plain
    with pytest.raises(DataError, match="no digest of a record"):
        RecordDigest.from_dict({**plain, "marks": {"p": "xyz"}})


def test_a_study_does_not_call_a_copy_unseen(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    names = ("flown", "copy")
    for name in names:
        fid.write_records(record(), f"{name}.parquet")
    entries = "".join(f'[[record]]\nname = "{n}"\npath = "{n}.parquet"\n' for n in names)
    model = (
        '[[model]]\nname = "p"\nstructure = "oe"\nnb = 1\nnf = 1\nnk = 1\ninputs = ["tau_phi"]\n'
        'outputs = "p"\nidentify = "flown"\nverify = ["copy"]\nband_rad_s = [1.0, 10.0]\n'
    )
    Path("study.toml").write_text(
        f'[study]\ntitle = "Roll"\naircraft = "made up"\n{entries}{model}'
    )
    status = run(["run", "study.toml"])
    shown = capsys.readouterr()
    assert status == 0, shown.err
    said = " ".join(shown.out.split())
    assert "[amber] p: OE, nb 1, nf 1, nk 1; " in said
    assert "the model was fitted to these samples (record 'flown')" in said
    assert "has seen: it predicts" not in said
    assert "not seen" not in said


def test_marks_are_the_smallest_hashes_each_once() -> None:
    random = np.random.default_rng(4)
    for size in (0, 1, MARKS, 4 * MARKS, 4 * MARKS + 1, 20_000):
        even = random.integers(0, 2**64 - 1, size, dtype=np.uint64, endpoint=True)
        few = random.choice(even, size) if size else even
        for hashes in (even, few, even[: size // 40].repeat(40), even >> np.uint64(40), ~even // 2):
            kept = np.clip(hashes.size // SPACING, MARKS, MOST_MARKS)
            assert np.array_equal(_smallest(hashes), np.unique(hashes)[:kept])


def test_a_short_piece_of_a_fitted_record_is_known_again() -> None:
    """2.5 s of 60 s at 100 Hz held three of 64 marks by luck: at 240 to 260 samples none did."""
    noise = np.random.default_rng(3).standard_normal(6000)
    base = fid.Record.from_arrays(np.arange(6000) * 0.01, outputs={"y": noise})
    made = digest_of(base, ["y"])
    shares = [made.shared(base.segment(at, at + 2.4), ["y"]) for at in np.arange(0.0, 57.0, 2.4)]
    assert np.mean(np.array(shares) == 1.0) > 0.95, shares


def test_a_model_of_a_red_fit_says_so_where_its_run_is_good(tmp_path: Path) -> None:
    checks = (Check("coherence", Light.RED, "least mean coherence .2", "sweep again"),)
    plain = fit("transfer")
    read = fid.load_model(fid.write_model(plain, tmp_path / "model.toml"))
    assert read.estimated is not None
    known = replace(read.estimated, evidence=Evidence(checks, ("coherence",)).to_dict())
    model = replace(read, estimated=known)
    (told,) = [e for e in fid.verify(model, record()).findings if e.code == "source-evidence"]
    assert told.light is Light.AMBER
    assert told.message.startswith("the model is of a fit that is red: least mean coherence .2")
    assert "source-evidence" not in {e.code for e in fid.verify(plain, record()).findings}
