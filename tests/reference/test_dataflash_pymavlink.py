"""DataFlash reader and writer against pymavlink's DFReader, on real, damaged and written logs."""

from __future__ import annotations

from collections import Counter
from pathlib import Path

import numpy as np
import pytest

import flightid as fid
from flightid.logs import DataflashWriter
from flightid.logs.dataflash.layout import standard_tables
from tests.closeness import assert_close

LOGS = ("arducopter_457.BIN", "arducopter_470dev_ground.BIN")
NIGHTLY = pytest.mark.nightly
SEEDS = [0, pytest.param(1, marks=NIGHTLY), pytest.param(2, marks=NIGHTLY)]
FIRST_BYTES = 800_000  # pymavlink takes a second for all of them
FRACTIONS = [pytest.param(0.1, marks=NIGHTLY), 0.5, pytest.param(0.9, marks=NIGHTLY)]


def _peer(path: Path) -> list[object]:
    DFReader = pytest.importorskip("pymavlink.DFReader")
    reader = DFReader.DFReader_binary(str(path))
    messages = []
    while (message := reader.recv_msg()) is not None:
        messages.append(message)
    reader.close()
    return messages


def _peer_counts(path: Path) -> Counter[str]:
    return Counter(message.get_type() for message in _peer(path))  # type: ignore[attr-defined]


def _our_counts(path: Path) -> Counter[str]:
    return Counter({m.name: m.count for m in fid.read_log(path).messages.values()})


@pytest.mark.parametrize("name", [LOGS[0], pytest.param(LOGS[1], marks=NIGHTLY)])
def test_every_count_number_and_text_equals_pymavlinks(
    shared_data: Path, tmp_path: Path, name: str
) -> None:
    # pymavlink applies the scale of the storage (hundredths, 1e-7 deg) but not the multipliers of
    # the MULT table, so ours are divided out; both are then the same doubles to rounding.
    path = tmp_path / name
    path.write_bytes((shared_data / "logs" / name).read_bytes()[:FIRST_BYTES])
    log = fid.read_log(path)
    by_type: dict[str, list[object]] = {}
    for message in _peer(path):
        by_type.setdefault(message.get_type(), []).append(message)  # type: ignore[attr-defined]
    assert _our_counts(path) == Counter({kind: len(rows) for kind, rows in by_type.items()})
    multipliers = _multipliers(path)
    compared = 0
    for message, rows in by_type.items():
        table = log.table(message)
        for field in table.columns:
            theirs = [getattr(row, field) for row in rows]
            if field in log.messages[message].text_fields:
                if message != "FILE":  # file contents: pymavlink keeps them as bytes
                    assert table.text(field) == theirs, f"{message}.{field}"
                continue
            expected = np.array(theirs, np.float64) * multipliers.get((message, field), 1.0)
            assert_close(
                table[field],
                expected,
                rtol=1e-15,
                why=f"{message}.{field}: the same stored number, scaled in one rounding",
            )
            compared += expected.size
    assert compared > 50_000


def _multipliers(path: Path) -> dict[tuple[str, str], float]:
    """Multiplier of every field whose storage has none of its own, by pymavlink's tables."""
    DFReader = pytest.importorskip("pymavlink.DFReader")
    reader = DFReader.DFReader_binary(str(path))
    names = {f.type: f for f in reader.formats.values()}
    table = {key: value for key, value in reader.mult_lookup.items() if value}
    found = {}
    while (row := reader.recv_match(type="FMTU")) is not None:
        layout = names.get(row.FmtType)
        if layout is None:
            continue
        for field, code, key in zip(layout.columns, layout.format, row.MultIds, strict=False):
            if code not in "cCeEL":
                found[layout.name, field] = table.get(key, 1.0)
    reader.close()
    return found


@pytest.mark.parametrize("name", [pytest.param(LOGS[0], marks=NIGHTLY), LOGS[1]])
@pytest.mark.parametrize("fraction", FRACTIONS)
def test_counts_of_a_truncated_log_equal_pymavlinks(
    shared_data: Path, tmp_path: Path, name: str, fraction: float
) -> None:
    content = (shared_data / "logs" / name).read_bytes()
    path = tmp_path / name
    path.write_bytes(content[: int(fraction * len(content))])
    assert _our_counts(path) == _peer_counts(path)


@pytest.mark.parametrize("seed", SEEDS)
def test_a_zeroed_block_loses_what_pymavlink_loses(
    shared_data: Path, tmp_path: Path, seed: int, capfd: pytest.CaptureFixture[str]
) -> None:
    content = bytearray((shared_data / "logs" / LOGS[1]).read_bytes()[:FIRST_BYTES])
    start = int(np.random.default_rng(seed).integers(200_000, 700_000))
    content[start : start + 65_536] = bytes(65_536)
    path = tmp_path / "zeroed.bin"
    path.write_bytes(content)
    ours, theirs = _our_counts(path), _peer_counts(path)
    capfd.readouterr()
    assert ours == theirs
    zeros = [r for r in fid.read_log(path).skipped if "0x00" in r.reason or r.size > 60_000]
    assert sum(r.size for r in zeros) > 65_536 - 600


@pytest.mark.parametrize("seed", SEEDS)
def test_random_blocks_lose_no_more_than_pymavlink_loses(
    shared_data: Path, tmp_path: Path, seed: int, capfd: pytest.CaptureFixture[str]
) -> None:
    # Where random bytes look like a header pymavlink believes them and may swallow true messages;
    # flightid wants proof. So counts differ by a few messages around each of the three blocks.
    rng = np.random.default_rng(seed)
    content = bytearray((shared_data / "logs" / LOGS[0]).read_bytes()[:FIRST_BYTES])
    for start in rng.integers(200_000, 700_000, 3):
        content[start : start + 4096] = rng.bytes(4096)
    path = tmp_path / "random.bin"
    path.write_bytes(content)
    ours, theirs = _our_counts(path), _peer_counts(path)
    capfd.readouterr()
    difference = ours.copy()
    difference.subtract(theirs)
    assert sum(abs(count) for count in difference.values()) <= 6
    assert sum(ours.values()) >= 19_000


def _values(code: str, n_rows: int, rng: np.random.Generator) -> object:
    if code in "nNZ":
        return [f"t{i % 100}" for i in range(n_rows)]
    if code == "a":
        return rng.integers(-30_000, 30_000, (n_rows, 32))
    if code in "fgd":
        return rng.normal(size=n_rows).astype(np.float32)
    if code in "cCeEL":
        return np.round(rng.uniform(0, 90, n_rows), 2)
    return rng.integers(0, 100, n_rows)


def test_every_written_column_comes_back_through_both_readers(tmp_path: Path) -> None:
    rng = np.random.default_rng(1)
    _, multipliers, layouts = standard_tables()
    writer = DataflashWriter()
    given: dict[str, dict[str, object]] = {}
    for place, (name, layout) in enumerate(layouts.items()):
        if name in ("FMT", "FMTU", "UNIT", "MULT", "PARM", "MSG"):
            continue
        columns = {
            label: _values(code, 50, rng)
            for label, code in zip(layout.labels, layout.format, strict=True)
            if label != "TimeUS"
        }
        writer.add(name, np.arange(50) * 2500 + place, columns)
        given[name] = columns
    writer.parameter("SID_AXIS", 10)
    writer.parameter("ATC_RAT_RLL_P", 0.135, default=0.1)
    writer.message(7, "ArduCopter V4.7.0 (written)")
    path = writer.write(tmp_path / "written.bin")

    log = fid.read_log(path)
    assert log.skipped == ()
    assert log.vehicle == "copter"
    assert set(log.messages) == set(layouts)
    by_type: dict[str, list[object]] = {}
    for message in _peer(path):
        by_type.setdefault(message.get_type(), []).append(message)  # type: ignore[attr-defined]
    for name, columns in given.items():
        layout = layouts[name]
        assert_close(
            log.table(name).time_s,
            np.array([row.TimeUS for row in by_type[name]]) / 1e6,  # type: ignore[attr-defined]
            rtol=1e-15,
            why="stamps are whole microseconds",
        )
        for field, values in columns.items():
            theirs = [getattr(row, field) for row in by_type[name]]
            code = layout.format[layout.labels.index(field)]
            if code in "nNZ":
                assert log.table(name).text(field) == values == theirs
                continue
            factor = multipliers.get(layout.multipliers[layout.labels.index(field)], 1.0) or 1.0
            scale = 1.0 if code in "cCeEL" else factor
            wanted = np.asarray(values, np.float64)
            # Half a step of the storage: single precision, or the multiplier of an integer.
            step = 0.51 * factor if code in "bBhHiIqQM" else 1e-12
            assert_close(
                log.table(name)[field], wanted, rtol=1e-6, atol=step, why=f"{name}.{field}"
            )
            assert_close(
                np.array(theirs) * scale, log.table(name)[field], rtol=1e-12, why="the peer agrees"
            )
    assert log.parameters == {"SID_AXIS": 10.0, "ATC_RAT_RLL_P": pytest.approx(0.135)}
    assert [row.Default for row in by_type["PARM"]] == [10.0, pytest.approx(0.1)]  # type: ignore[attr-defined]
