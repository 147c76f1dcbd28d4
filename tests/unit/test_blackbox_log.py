"""Blackbox logs: every encoding and predictor against a writer that shares no code."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import flightid as fid
from flightid.control.autopilots.from_log import autopilot_of
from flightid.errors import DataError, LogFormatError, MissingColumnError
from flightid.logs.blackbox.reader import open_blackbox
from flightid.logs.blackbox.scales import FINE, FORCES, INAV_BATTERY, scales_of
from tests.blackbox_builder import END, FIELDS, SETTINGS, blackbox, header, unsigned


def _columns(n: int = 400, seed: int = 0, size: float = 1.0) -> dict[str, np.ndarray]:
    """Samples that reach every width of every encoding, negative ones among them."""
    rng = np.random.default_rng(seed)
    spread = 10.0 ** rng.uniform(0.0, 4.3 * size, n)
    columns = {
        known.name: np.round(spread * rng.standard_normal(n)).astype(int) for known in FIELDS[2:]
    }
    for name, values in columns.items():
        limit = 2**14 - 1 if "rcCommand" in name or "setpoint" in name else 10**6
        columns[name] = np.clip(values, -limit, limit)
    for known in FIELDS[2:]:
        if not known.signed:
            columns[known.name] = np.abs(columns[known.name]) % 4000
    columns["vbatLatest"] = columns["vbatLatest"] % 1600
    columns["time"] = 10_000_000 + 500 * np.arange(n) + rng.integers(-20, 20, n)
    return columns


def _open(folder: Path, content: bytes) -> fid.Log:
    path = folder / "LOG00001.BFL"
    path.write_bytes(content)
    return fid.read_log(path)


@pytest.mark.parametrize("seed", range(6))
def test_every_value_comes_back(tmp_path: Path, seed: int) -> None:
    columns = _columns(seed=seed)
    log = _open(tmp_path, blackbox(columns))
    assert log.kind == "betaflight"
    assert not log.skipped
    assert not log.findings
    table = log.table("main")
    for name, values in columns.items():
        scale = 0.01 if name in ("vbatLatest", "amperageLatest") else 1.0
        scale = 1.0 / 2048.0 if name.startswith("acc") else scale
        np.testing.assert_array_equal(table[name], values * scale, err_msg=name)
    np.testing.assert_array_equal(table.time_s, columns["time"] / 1e6)
    assert log.parameters["rollPID[1]"] == 80.0
    assert log.parameters["motorOutput[1]"] == 2047.0


def test_clock_turns_over(tmp_path: Path) -> None:
    columns = _columns(n=100)
    true = 2**32 - 20_000 + 500 * np.arange(100)
    columns["time"] = true % 2**32
    time_s = _open(tmp_path, blackbox(columns)).table("main").time_s
    np.testing.assert_array_equal(time_s, true / 1e6)


def test_damage_costs_frames_up_to_the_next_whole_one(tmp_path: Path) -> None:
    columns = _columns(n=400, size=0.5)
    content = blackbox(columns)
    at = len(header()) + (len(content) - len(header())) // 2
    log = _open(tmp_path, content[:at] + content[at + 40 :])
    table = log.table("main")
    stamps = (np.asarray(table.time_s) * 1e6).round().astype(int)
    places = np.searchsorted(columns["time"], stamps)
    assert 370 <= stamps.size < 400
    agree = np.mean(table["gyroADC[1]"] == columns["gyroADC[1]"][places])
    assert agree == 1.0
    assert "bytes-skipped" in {finding.code for finding in log.findings}


def test_longest_of_several_flights_is_read_and_said(tmp_path: Path) -> None:
    long, short = _columns(n=300), _columns(n=64, seed=3)
    log = _open(tmp_path, blackbox(short) + blackbox(long) + blackbox(short))
    assert len(log.table("main")) == 300
    said = next(f.message for f in log.findings if f.code == "several-flights")
    assert "3 flights" in said
    assert "number 2" in said


def test_modes_and_gaps_are_told(tmp_path: Path) -> None:
    columns = _columns(n=64, size=0.5)
    columns["time"][40:] += 30 * 500
    content = blackbox(columns).removesuffix(END)
    for flags in (0, 1 << 1, 1 << 2, 1 << 5):
        content += b"E" + bytes([30]) + unsigned(flags) + unsigned(0)
    log = _open(tmp_path, content + END)
    assert [e.text for e in log.events if e.kind == "mode"] == ["ACRO", "ANGLE", "HORIZON", "ACRO"]
    (gap,) = log.gaps
    assert (gap.start_s, gap.stop_s) == (columns["time"][39] / 1e6, columns["time"][40] / 1e6)


def test_axes_are_turned_into_those_of_an_aircraft(tmp_path: Path) -> None:
    """Betaflight's body axes are x forward, y left and z up."""
    columns = _columns(n=64, size=0.5)
    columns["time"] = 10_000_000 + 500 * np.arange(64)
    record = _open(tmp_path, blackbox(columns)).record()
    for place, (rate, command) in enumerate(
        (("p", "tau_phi"), ("q", "tau_theta"), ("r", "tau_psi"))
    ):
        sign = 1.0 if place == 0 else -1.0
        exact = sign * np.radians(columns[f"gyroADC[{place}]"])
        np.testing.assert_allclose(record[rate], exact, rtol=1e-12, atol=1e-12)
        terms = sum(columns[f"axis{term}[{place}]"] for term in "PID")
        np.testing.assert_allclose(record[command], sign * terms / 1e3, rtol=1e-12, atol=1e-12)


@pytest.mark.parametrize("wing", [False, True])
def test_inav_names_its_set_points_otherwise_and_tells_a_wing(tmp_path: Path, wing: bool) -> None:
    """INAV calls itself Cleanflight, set-points axisRate, and logs fwAltP of wings alone."""
    columns = _columns(n=64, size=0.5)
    columns["time"] = 10_000_000 + 500 * np.arange(64)
    head, mark, frames = blackbox(columns).partition(b"\nH Field I signed")
    head = head.replace(b"Betaflight 4.4.2", b"INAV 7.1.2").replace(b"setpoint[3]", b"navState")
    head = head.replace(b"setpoint[", b"axisRate[").replace(b"rssi", b"fwAltP" if wing else b"rssi")
    log = _open(tmp_path, head + mark + frames)
    assert log.vehicle == (None if wing else "copter")
    if wing:
        return
    record = log.record(names=["p_ref", "q_ref", "r_ref", "p"])
    for place, (name, sign) in enumerate((("p_ref", 1.0), ("q_ref", -1.0), ("r_ref", -1.0))):
        logged = columns[f"setpoint[{place}]"]
        exact = sign * np.radians(logged + 0.5 * np.sign(logged))
        np.testing.assert_allclose(record[name], exact, rtol=1e-12, atol=1e-12)
    head = head.replace(b"INAV 7.1.2", b"INAV 2.6.1")
    with pytest.raises(DataError, match=r"flightid flight LOG00001\.BFL tells steps and noise"):
        autopilot_of(_open(tmp_path, head + mark + frames))


def test_log_without_end_is_called_cut(tmp_path: Path) -> None:
    log = _open(tmp_path, blackbox(_columns(n=64)).removesuffix(END))
    assert [finding.code for finding in log.findings] == ["log-cut"]
    assert len(log.table("main")) == 64


def test_scales_hold_what_the_firmware_logs_and_nothing_else() -> None:
    flown = {"Firmware revision": "Betaflight 4.4.0 (a) F7", "gyro_scale": "0x3f800000"}
    scales, untold = scales_of(flown)
    assert set(scales) == {*FINE, "vbatLatest", "amperageLatest"}
    assert set(untold) == {FORCES}
    inav = {"Firmware revision": "INAV 1.9.0 (a) F3"}
    assert set(INAV_BATTERY[-1]) <= set(scales_of(inav)[1])
    assert scales_of({**inav, "Firmware revision": "INAV 2.0.0 (a) F3"})[0]["vbat"] == 0.01


def test_scales_of_the_header(tmp_path: Path) -> None:
    columns = _columns(n=64)
    fine = {**SETTINGS, "blackbox_high_resolution": "1", "gyro_scale": "0x3d800000"}
    table = _open(tmp_path, blackbox(columns, fine)).table("main")
    np.testing.assert_allclose(table["gyroADC[0]"], columns["gyroADC[0]"] * 0.0625 / 10)
    np.testing.assert_allclose(table["setpoint[2]"], columns["setpoint[2]"] / 10)
    fine["gyro_scale"] = f"0x{np.float32(1e-9).view(np.uint32):08x}"
    table = _open(tmp_path, blackbox(columns, fine)).table("main")
    milli = np.degrees(np.float32(1e-9) * 1e6) / 10
    np.testing.assert_allclose(table["gyroADC[1]"], columns["gyroADC[1]"] * milli, rtol=1e-6)


@pytest.mark.parametrize(
    ("revision", "volts", "amperes"),
    [
        ("Betaflight 4.0.0 (a) F7", 0.01, 0.01),
        ("Betaflight 3.5.7 (a) F4", 0.1, 0.01),
        ("Betaflight 3.1.0 (a) F3", 0.1, None),
        ("Betaflight 3.0.1 (a) F3", None, None),
        ("INAV 7.1.0 (a) F7", None, None),
        ("", None, None),
    ],
)
def test_battery_has_the_unit_of_its_version_or_is_left_out(
    tmp_path: Path, revision: str, volts: float | None, amperes: float | None
) -> None:
    columns = _columns(n=64)
    log = _open(tmp_path, blackbox(columns, {**SETTINGS, "Firmware revision": revision}))
    table = log.table("main")
    said = " ".join(f.message for f in log.findings if f.code == "unit-unknown")
    for name, scale in (("vbatLatest", volts), ("amperageLatest", amperes)):
        assert (name in said) is (scale is None)
        assert (name in table.columns) is (scale is not None)
        if scale is not None:
            np.testing.assert_allclose(table[name], columns[name] * scale)


@pytest.mark.parametrize(
    ("name", "value", "fields"),
    [
        ("gyro_scale", "", "gyroADC[0], gyroADC[1], gyroADC[2]"),
        ("gyro_scale", "0x7fc00000", "gyroADC[0], gyroADC[1], gyroADC[2]"),
        ("acc_1G", "0", "accSmooth[0], accSmooth[1], accSmooth[2]"),
    ],
)
def test_counts_of_unknown_size_are_left_out_and_said(
    tmp_path: Path, name: str, value: str, fields: str
) -> None:
    log = _open(tmp_path, blackbox(_columns(n=64), {**SETTINGS, name: value}))
    (said,) = log.findings
    assert f"no {name}: {fields} are counts" in said.message
    assert not set(fields.split(", ")) & set(log.table("main").columns)
    with pytest.raises(MissingColumnError):
        log.table("main")[fields.split(", ", maxsplit=1)[0]]


@pytest.mark.parametrize(
    ("name", "value"),
    [("Field I name", "time"), ("Field I encoding", "99"), ("Field I predictor", "")],
)
def test_header_that_contradicts_itself_is_refused(tmp_path: Path, name: str, value: str) -> None:
    path = tmp_path / "bad.bbl"
    path.write_bytes(header() + f"H {name}:{value}\n".encode() + END)
    with pytest.raises(LogFormatError):
        open_blackbox(path)
    path.write_bytes(blackbox(_columns(n=64))[: len(header()) + 3])
    with pytest.raises(LogFormatError, match="no frame of the loop"):
        open_blackbox(path)


def test_fields_that_take_no_bytes_do_not_fill_memory(tmp_path: Path) -> None:
    names = ["time", *(f"f{i}" for i in range(200))]
    lines = {
        "I name": names, "I signed": "0" * 201, "I predictor": "0" * 201, "I encoding": "9" * 201,
        "P predictor": "0" * 201, "P encoding": "9" * 201,
    }  # fmt: skip
    start = header().split(b"\n")[0]
    fields = "\n".join(f"H Field {key}:{','.join(value)}" for key, value in lines.items())
    path = tmp_path / "claims.bbl"
    path.write_bytes(start + b"\n" + fields.encode() + b"\n" + b"I" * 100_000)
    log = open_blackbox(path)
    assert sum(info.count for info in log.messages.values()) * 201 <= 16 * 110_000
    assert "more values" in log.skipped[-1].reason


def _asked(kind: int, rc: float, rc_rate: float, rate: float, expo: float) -> float:
    """Rate set-point of one stick, deg/s, as `fc/rc.c` of the firmware has it, line by line."""
    size, e = abs(rc), expo / 100.0
    factor = 1.0 / min(max(1.0 - size * rate / 100.0, 0.01), 1.0)
    if kind == 0:
        curved = rc * size**3 * e + rc * (1.0 - e) if expo else rc
        slope = rc_rate / 100.0
        if slope > 2.0:
            slope += 14.54 * (slope - 2.0)
        return 200.0 * slope * curved * (factor if rate else 1.0)
    if kind == 1:
        curved = (1.0 + 0.01 * expo * (rc * rc - 1.0)) * rc
        return 10.0 * rc_rate * curved * (1.0 + size * rate * 0.01)
    if kind == 2:
        return 2000.0 * factor * (rc**3 * e + rc * (1.0 - e)) * rc_rate / 1000.0
    if kind == 3:
        curved = size * (rc**5 * e + rc * (1.0 - e))
        return rc * rc_rate * 10.0 + max(0.0, rate * 10.0 - rc_rate * 10.0) * curved
    centre, most = rc_rate * 2.0, max(rate * 10.0, rc_rate * 2.0)
    share = (most / centre - 1.0) / (most / centre)
    curved = size**3 * e + size * (1.0 - e)
    return rc * centre / min(max(1.0 - curved * share, 0.01), 1.0)


CURVE_NAMES = ("Betaflight", "RaceFlight", "KISS", "Actual", "Quick")
OLD = tuple(replace(known, name=known.name.replace("setpoint", "debug")) for known in FIELDS)
RATES = ((220, 70, 10), (70, 60, 40), (100, 70, 30), (7, 67, 54), (90, 67, 20))


def test_set_points_that_were_not_logged_are_those_of_the_sticks(tmp_path: Path) -> None:
    """Betaflight 3 logs rcCommand and P terms: the firmware's curve between, and its proof."""
    for kind in range(len(RATES)):
        _check_sticks(tmp_path, kind)


def _check_sticks(tmp_path: Path, kind: int) -> None:
    n, rng = 3000, np.random.default_rng(kind)
    sticks = np.cumsum(rng.standard_normal((3, n)), axis=1)
    sticks = np.round(480.0 * sticks / np.abs(sticks).max(axis=1, keepdims=True)).astype(int)
    wanted = np.array([[_asked(kind, rc / 500.0, *RATES[kind]) for rc in row] for row in sticks])
    wanted = np.clip(wanted, -1998.0, 1998.0)
    rate = np.zeros_like(wanted)
    for k in range(1, n):
        rate[:, k] = rate[:, k - 1] + 0.05 * (wanted[:, k - 1] - rate[:, k - 1])
    rate = np.round(rate + rng.standard_normal((3, n)))
    columns = {"time": 10_000_000 + 500 * np.arange(n)}
    for k in range(3):
        columns |= {f"rcCommand[{k}]": sticks[k], f"gyroADC[{k}]": rate[k].astype(int)}
        columns[f"axisP[{k}]"] = np.round(0.032029 * 45 * (wanted[k] - rate[k])).astype(int)
    rates = dict(zip(("rc_rates", "rates", "rc_expo"), map(str, RATES[kind]), strict=True))
    settings = {**SETTINGS, "Firmware revision": "Betaflight 3.5.7 (c0ffee) STM32F405"}
    settings |= {name: ",".join([number] * 3) for name, number in rates.items()}
    exact = np.radians(wanted) * np.array([[1.0], [-1.0], [-1.0]])
    for told in ({"rates_type": str(kind)}, {}):
        log = _open(tmp_path, blackbox(columns, settings | told, OLD))
        found = [np.asarray(log.record()[name]) for name in ("p_ref", "q_ref", "r_ref")]
        np.testing.assert_allclose(found, exact, rtol=1e-9, atol=1e-9)
        said = next(f.message for f in log.findings if f.code == "set-points-of-sticks")
        assert CURVE_NAMES[kind] in said
    # A vehicle that levels itself asks for other rates: its P terms give that away.
    columns["axisP[0]"] = np.roll(columns["axisP[0]"], 800)
    other = _open(tmp_path, blackbox(columns, settings, OLD))
    assert "no-set-points" in {f.code for f in other.findings}
    assert "setpoint[0]" not in other.table("main").columns
