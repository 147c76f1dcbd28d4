"""Where a record of a log begins and ends, and what is known of its inputs between the rows."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import flightid as fid
from flightid.conventions import Role
from flightid.logs import to_record
from flightid.logs.dataflash.writer import DataflashWriter
from flightid.record import InputShape
from tests.closeness import assert_close


def _item(name: str, start: float, stop: float, step: float, *, sets_rate: bool = True) -> Any:
    stamps = start + step * np.arange(round((stop - start) / step) + 1)
    channel = SimpleNamespace(name=name, sets_rate=sets_rate, role=Role.INPUT)
    return SimpleNamespace(channel=channel, time_s=stamps, interval_s=step)


def test_a_span_begins_on_a_stamp_of_the_slowest_deciding_channel() -> None:
    fast, slow = _item("p", 1.003, 9.0, 0.01), _item("tau", 1.1, 9.5, 0.1)
    late = _item("az", 2.0, 8.0, 0.5, sets_rate=False)
    found = [fast, slow, late]
    assert to_record._core_span(found) == (1.1, fast.time_s[-1])
    assert to_record._core_span([late]) == (2.0, 8.0)
    assert to_record._reference(found) == "tau"
    assert to_record._reference([late]) == "az"
    begin, end = to_record._snapped([fast, slow], "p", None) or (0.0, 0.0)
    assert_close((begin, end), (1.103, fast.time_s[-1]), rtol=1e-12, why="a stamp of p")
    assert to_record._snapped([fast, slow], None, None) is None
    assert to_record._snapped([fast, slow], None, (2.0, 3.0)) == (2.0, 3.0)
    within = to_record._snapped([fast, slow], "tau", (2.04, 3.0)) or (0.0, 0.0)
    assert_close(within, (2.1, 3.0), rtol=1e-12, why="the next stamp of tau")


def test_a_span_that_channels_miss_by_more_than_three_steps_is_left_as_it_is() -> None:
    found = [_item("p", 1.0, 9.0, 0.01), _item("tau", 1.0, 9.0, 0.1)]
    for asked, kept in (
        ((0.71, 5.0), (1.0, 5.0)), ((0.69, 5.0), (0.69, 5.0)),
        ((2.0, 9.29), (2.0, 9.0)), ((2.0, 9.31), (2.0, 9.31)),
        ((8.95, 8.99), (8.95, 8.99)),  # No stamp of tau lies in it.
    ):  # fmt: skip
        assert_close(to_record._snapped(found, "tau", asked) or (), kept, rtol=1e-9, why="stamps")


def test_inputs_hold_what_the_map_knows_where_all_loops_were_logged(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    log, chosen = SimpleNamespace(parameters={}), SimpleNamespace(hold="zero")
    other = _item("y", 0.0, 1.0, 0.5)
    other.channel.role = Role.OUTPUT
    for interval_s, loop_s, hold in (
        (0.01, None, "zero"), (0.01, 0.01, "zero"), (0.01, 0.0092, "zero"), (0.01, 0.0090, None),
        (0.01, 0.0112, None), (0.010009, None, "zero"), (0.01002, None, None),
        (0.00998, None, None),
    ):  # fmt: skip
        monkeypatch.setattr(to_record, "loop_step_s", lambda _, told=loop_s: told)
        inputs = [_item("a", 0.0, 1.0, 0.01), _item("b", 0.0, 1.0, interval_s)]
        told: Any = (log, InputShape(), chosen, [*inputs, other], 0.01)
        assert to_record._input_shape(*told).hold == hold, (interval_s, loop_s)
        declared: Any = (log, InputShape(hold="first"), chosen, inputs, 0.01)
        assert to_record._input_shape(*declared).hold == "first"
        unknown: Any = (log, InputShape(), SimpleNamespace(hold=None), inputs, 0.01)
        assert to_record._input_shape(*unknown).hold is None


def test_a_record_has_the_rate_that_is_asked(tmp_path: Path) -> None:
    writer = DataflashWriter()
    writer.message(0, "ArduCopter V4.7.0 (test)")
    stamps = 1_000_000 + 2_500 * np.arange(2_000)
    seconds = stamps / 1e6
    writer.add("RATE", stamps, {"R": np.sin(2.0 * seconds), "ROut": 0.1 * np.cos(2.0 * seconds)})
    log = fid.read_log(writer.write(tmp_path / "log.bin"))
    own = log.record(names=["tau_phi", "p"])
    assert_close(own.sample_rate_hz, 400.0, rtol=1e-9, why="stamps")
    assert own.n_samples == 2_000
    slow = log.record(names=["tau_phi", "p"], sample_rate_hz=50.0)
    assert_close(slow.sample_rate_hz, 50.0, rtol=1e-9, why="asked for")
    part = log.record(names=["tau_phi", "p"], span_s=(2.0, 3.0))
    assert (part.n_samples, part.time_s[0]) == (401, 2.0)
    assert_close(
        part["tau_phi"], 0.1 * np.cos(2.0 * (2.0 + 0.0025 * np.arange(401))), atol=1e-6, why="float"
    )


def test_steps_of_a_log_are_low_passed_as_steps(tmp_path: Path) -> None:
    """As `resample` does; as a smooth signal through its rows an input is half a row early."""
    writer = DataflashWriter()
    writer.message(0, "ArduCopter V4.7.0 (test)")
    stamps = 1_000_000 + 10_000 * np.arange(600)
    steps = np.repeat(np.random.default_rng(0).choice([-1.0, 1.0], 40), 15)
    writer.add("RATE", stamps, {"R": np.cumsum(steps) * 0.01, "ROut": 0.1 * steps})
    log = fid.read_log(writer.write(tmp_path / "log.bin"))
    names = ["tau_phi", "p"]
    made = log.record(names=names, sample_rate_hz=25.0, hold="zero")
    of_rows = fid.conditioning.resample(log.record(names=names, hold="zero"), 0.04)
    assert made.hold == of_rows.hold == "band_limited"
    assert_close(made.time_s, of_rows.time_s, atol=1e-9, why="one grid")
    assert_close(made["tau_phi"], of_rows["tau_phi"], atol=1e-12, why="one low-pass")
    early = log.record(names=names, sample_rate_hz=25.0)
    assert np.max(np.abs(made["tau_phi"] - early["tau_phi"])) > 0.01
    assert early.hold is None
