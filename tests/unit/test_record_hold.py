"""What a record knows of its inputs between samples, how it is kept, found and used."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import flightid as fid
from flightid.errors import DataError, OptionError
from flightid.logs import channel_map
from flightid.record import InputShape, Step, read_records
from flightid.record.chosen_hold import chosen_hold
from flightid.record.repeats import found_period, found_staircase

RNG = np.random.default_rng(5)


def _record(**known: object) -> fid.Record:
    time_s = np.arange(400) / 50
    u = np.tile(np.repeat(RNG.standard_normal(25), 4), 4)
    arrays = {"inputs": {"u": u}, "outputs": {"y": np.convolve(u, [0.0, 0.5])[:400]}}
    return fid.Record.from_arrays(time_s, **arrays, **known)  # type: ignore[arg-type]


@pytest.mark.parametrize("suffix", [".parquet", ".nc"])
def test_a_file_keeps_hold_and_period(tmp_path: Path, suffix: str) -> None:
    before = [_record(hold="zero", period_s=2.0), _record(hold="first"), _record()]
    after = read_records(fid.write_records(before, tmp_path / f"flight{suffix}"))
    assert [each.input_shape for each in after] == [each.input_shape for each in before]


def test_a_file_without_them_takes_what_is_declared(tmp_path: Path) -> None:
    path = tmp_path / "rig.csv"
    path.write_text("time,u,y\n0,0,0\n1,1,0\n2,1,1\n")
    plain = read_records(path, ["u"], ["y"])[0]
    told = read_records(path, ["u"], ["y"], hold="zero", period_s=2.0)[0]
    assert plain.input_shape == InputShape()
    assert told.input_shape == InputShape("zero", 2.0)


def test_a_declared_period_must_be_in_the_inputs() -> None:
    assert _record(period_s=2.0).period_s == 2.0
    with pytest.raises(DataError, match=r"do not repeat after the declared period: .* 0.7 s apart"):
        _record(period_s=0.7)
    with pytest.raises(DataError, match="do not repeat"):
        _record().declare(period_s=3.0)
    noisy = _record().replace({"u": _record()["u"] + 0.4 * RNG.standard_normal(400)})
    assert noisy.declare(period_s=2.0).period_s == 2.0


def test_a_declared_hold_must_not_contradict_the_file(tmp_path: Path) -> None:
    path = fid.write_records(_record(hold="zero"), tmp_path / "flight.nc")
    with pytest.raises(OptionError, match="contradicts the file"):
        read_records(path, hold="first")


@pytest.mark.parametrize(("hold", "period_s"), [("second", None), (None, 0.0), (None, np.nan)])
def test_words_without_meaning_are_refused(hold: str | None, period_s: float | None) -> None:
    with pytest.raises(OptionError):
        _record(hold=hold, period_s=period_s)


def test_it_is_shown() -> None:
    record = _record(hold="zero", period_s=2.0)
    assert "Inputs between samples: steps; they repeat every 2 s." in record.summary().notes
    assert (record.to_dict()["hold"], record.to_dict()["period_s"]) == ("zero", 2.0)


def test_operations_keep_what_they_leave_true_and_drop_the_rest() -> None:
    record = _record(hold="zero", period_s=2.0)
    cond = fid.conditioning
    kept = {
        "segment": record.segment(0.0, 4.0),
        "detrend": cond.detrend(record),
        "filter alike": cond.filter_record(record, 5.0),
        "filter outputs": cond.filter_record(record, 5.0, channels=["y"]),
        "align outputs": cond.align(record, {"y": 0.003}),
        "whole samples": cond.align(record, {"u": 0.02}),
        "units": record.select(["u", "y"]),
    }
    assert {name: each.hold for name, each in kept.items()} == dict.fromkeys(kept, "zero")
    dropped = {
        "filter inputs": cond.filter_record(record, 5.0, channels=["u"]),
        "align inputs": cond.align(record, {"u": 0.003}),
        "between steps": cond.resample(record, 0.013),
        "other method": cond.resample(record, 0.04, interpolation="previous"),
    }
    assert {name: each.hold for name, each in dropped.items()} == dict.fromkeys(dropped)
    assert {each.period_s for each in dropped.values()} == {2.0}
    assert cond.resample(record, 0.04).hold == "band_limited"
    finer = cond.resample(record, 0.01)
    assert finer.hold == "zero"
    assert set(finer["u"]) <= set(record["u"])


def test_simulate_uses_what_the_record_knows_and_says_what_it_used() -> None:
    lag = fid.LinearSystem([[-3.0]], [[3.0]], [[1.0]], [[0.0]], ("u",), ("y",))
    silent, held = _record(), _record(hold="zero")
    held = silent.declare(hold="zero")
    by_default, by_record = fid.simulate(lag, silent), fid.simulate(lag, held)
    assert (by_default.hold, by_record.hold) == ("first", "zero")
    told = fid.simulate(lag, silent, hold="zero")
    assert np.array_equal(by_record["y"], told["y"])
    assert not np.array_equal(by_default["y"], told["y"])


def test_a_staircase_is_found_and_nothing_else_is() -> None:
    time_s = np.arange(1000) / 100
    smooth = np.sin(2 * np.pi * 0.7 * time_s) + 0.4 * np.sin(2 * np.pi * 1.9 * time_s)
    prbs = np.repeat(np.sign(RNG.standard_normal(200)), 5)
    found = found_staircase(prbs + 3.0)
    assert found is not None
    assert found.samples == 5
    steps = np.repeat(RNG.standard_normal(9), [70, 35, 13, 60, 22, 41, 17, 3, 100])
    assert found_staircase(steps) is not None
    for other in (
        smooth,
        np.round(smooth, 1),
        np.round(smooth * 64) / 64,
        RNG.standard_normal(1000),
        np.zeros(1000),
        (time_s > 5.0) * 1.0,
        np.clip(smooth, -0.5, 0.5),
    ):
        assert found_staircase(other) is None


def test_no_staircase_is_invented_in_random_smooth_signals() -> None:
    kernel = np.hanning(30)
    alarms = 0
    for _ in range(300):
        smooth = np.convolve(RNG.standard_normal(800), kernel, "valid")
        levels = RNG.integers(8, 200)
        alarms += found_staircase(np.round(smooth / np.ptp(smooth) * levels)) is not None
    assert alarms == 0


def test_a_period_is_found_only_where_all_samples_repeat() -> None:
    part = RNG.standard_normal(127)
    assert found_period(np.tile(part, 4)[:400]) == 127
    assert found_period(np.tile(part, 2)[:253]) is None
    noisy = np.tile(part, 4)
    noisy[300] += 1e-6
    assert found_period(noisy) is None
    assert found_period(np.concatenate([np.zeros(50), np.ones(50)])) is None
    assert found_period(np.zeros(50)) is None
    both = np.vstack([np.tile(part[:6], 20), np.tile(part[:4], 30)])
    assert found_period(both) == 12


def test_records_with_different_holds_are_refused_unless_told() -> None:
    pair = [_record(hold="zero"), _record(hold="first")]
    with pytest.raises(DataError, match="hold their inputs differently"):
        chosen_hold(pair, None)
    assert chosen_hold(pair, "zero").hold == "zero"


def test_an_unknown_hold_is_said_with_what_was_assumed() -> None:
    time_s = np.arange(100) / 10
    smooth = fid.Record.from_arrays(time_s, inputs={"u": np.sin(time_s)})
    found = chosen_hold(smooth, None)
    assert (found.hold, found.source, found.findings[0].light) == ("first", "assumed", "unknown")
    assert "straight lines between samples; the record does not say" in found.findings[0].message
    stairs = chosen_hold(_record(), None).findings[0]
    assert stairs.light == "amber"
    assert "every 4 samples" in stairs.message
    assert not chosen_hold(_record(), "first").findings
    assert chosen_hold([_record(hold="zero"), smooth], None).hold == "zero"


def test_inputs_of_two_levels_are_steps_and_nobody_is_asked() -> None:
    time_s = np.arange(400) / 50
    switched = np.where(np.random.default_rng(0).standard_normal(400) > 0.0, 6.41, 3.41)
    arrays = {"inputs": {"u": switched, "T": np.full(400, 283.0)}, "outputs": {"y": switched}}
    record = fid.Record.from_arrays(time_s, **arrays)
    found = chosen_hold(record, None)
    assert (found.hold, found.source, found.findings[0].light) == ("zero", "samples", "green")
    assert chosen_hold(record, None, fitted="first").hold == "first"
    assert chosen_hold(record, None, known=("first",)).hold == "first"
    assert fid.estimate_response(record, inputs="u", window_s=2.0).input_shape.hold == "zero"
    # One input of more levels, and a log at a lower rate than its loop, show nothing of the kind.
    record = record.replace({"T": np.arange(400.0)})
    assert chosen_hold(record, None).source == "assumed"
    assert chosen_hold(record, None, inputs=["u"]).source == "samples"
    logged = fid.Record.from_arrays(time_s, **arrays)
    logged = logged.replace(step=Step("Log.record", {}))
    assert chosen_hold(logged, None).source == "assumed"


def test_a_channel_map_may_tell_the_hold(tmp_path: Path) -> None:
    shipped = Path(fid.__file__).parent / "logs" / "channels" / "arducopter.toml"
    path = tmp_path / "held.toml"
    path.write_text('hold = "zero"\n' + shipped.read_text(encoding="utf-8"))
    assert channel_map(path).hold == "zero"
    assert channel_map("arducopter").hold is None
