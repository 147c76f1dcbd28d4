"""The same counts and values as pyulog on a real PX4 log: intact, truncated and damaged."""

from __future__ import annotations

import contextlib
import io
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from pyulog import ULog

from flightid import _native
from tests.ulog_builder import flight


@pytest.fixture(scope="module")
def real_log(shared_data: Path) -> bytes:
    return (shared_data / "logs" / "px4_quad_2016.ulg").read_bytes()


def peer(data: bytes) -> ULog:
    with contextlib.redirect_stdout(io.StringIO()):
        return ULog(io.BytesIO(data))


def assert_same_samples(data: bytes) -> None:
    ours, theirs = _native.Ulog(data), peer(data)
    counts = {(name, instance): rows for name, instance, rows in ours.tables() if rows}
    assert counts == {(t.name, t.multi_id): len(t.data["timestamp"]) for t in theirs.data_list}
    for table in theirs.data_list:
        columns = [name for name, _ in ours.columns(table.name)]
        assert columns == [name for name in table.data if "_padding" not in name]
        gathered = ours.gather(table.name, table.multi_id, columns)
        for name, values in zip(columns, gathered, strict=True):
            expected = table.data[name].astype(np.float64)
            assert np.array_equal(values, expected, equal_nan=True), f"{table.name}.{name}"


def assert_same_entries(data: bytes) -> None:
    ours, theirs = _native.Ulog(data), peer(data)
    assert dict(ours.parameters()) == theirs.initial_parameters
    assert ours.changes() == theirs.changed_parameters
    assert [(t, text) for t, _, tag, text in ours.lines() if tag is None] == [
        (line.timestamp, line.message) for line in theirs.logged_messages
    ]
    assert [(t, tag, text) for t, _, tag, text in ours.lines() if tag is not None] == [
        (line.timestamp, tag, line.message)
        for tag, lines in theirs.logged_messages_tagged.items()
        for line in lines
    ]
    assert ours.dropouts() == [(d.timestamp, d.duration) for d in theirs.dropouts]
    assert dict(ours.infos()) == theirs.msg_info_dict
    defaults = {name: value for bits, name, value in ours.defaults() if bits & 1}
    assert defaults == theirs.get_default_parameters(0)


def test_real_log_intact(real_log: bytes) -> None:
    assert_same_samples(real_log)
    assert_same_entries(real_log)
    assert _native.Ulog(real_log).skipped() == []


@pytest.mark.parametrize("share", [0.999, 0.5, 0.2])
def test_real_log_truncated(real_log: bytes, share: float) -> None:
    assert_same_samples(real_log[: int(share * len(real_log))])


@pytest.mark.parametrize("samples", [3, 60])
def test_built_log_with_every_record_kind(samples: int) -> None:
    data = bytes(flight(samples))
    assert_same_samples(data)
    assert_same_entries(data)


def _random(rng: np.random.Generator, size: int) -> bytes:
    return rng.bytes(size)


def _zeros(rng: np.random.Generator, size: int) -> bytes:
    return bytes(size)


@pytest.mark.parametrize("fill", [_random, _zeros])
@pytest.mark.parametrize(
    "seed", [0, *(pytest.param(k, marks=pytest.mark.nightly) for k in range(1, 5))]
)
def test_real_log_damaged_keeps_more_than_pyulog_and_nothing_false(
    real_log: bytes, seed: int, fill: Callable[[np.random.Generator, int], bytes]
) -> None:
    rng = np.random.default_rng(seed)
    damaged = bytearray(real_log)
    hits = [int(hit) for hit in rng.integers(100_000, len(real_log) - 8_192, 3)]
    for hit in hits:
        damaged[hit : hit + 4096] = fill(rng, 4096)
    ours, theirs = _native.Ulog(bytes(damaged)), peer(bytes(damaged))
    rows = {(name, instance): rows for name, instance, rows in ours.tables()}
    assert sum(rows.values()) >= sum(len(t.data["timestamp"]) for t in theirs.data_list)
    whole = _native.Ulog(real_log)
    lost = sum(count for _, _, count in whole.tables()) - sum(rows.values())
    # A 4 kB hit covers some 65 records of this log; it also tears one at each of its ends.
    assert lost <= 3 * 110
    for name, instance, _ in whole.tables():
        columns = [column for column, _ in whole.columns(name)]
        if not rows.get((name, instance)) or not columns:
            continue
        true_rows = np.array(whole.gather(name, instance, columns)).T
        kept_rows = np.array(ours.gather(name, instance, columns)).T
        known = {row.tobytes() for row in true_rows}
        assert all(row.tobytes() in known for row in kept_rows), f"{name}: a false sample"
