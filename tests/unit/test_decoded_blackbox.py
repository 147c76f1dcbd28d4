"""Blackbox logs that were decoded to CSV beside the logs themselves."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

import flightid as fid
from flightid.conventions import Light
from flightid.errors import DataError, LogFormatError
from flightid.logs import is_log
from flightid.logs.blackbox.resolution import resolution_of
from tests.blackbox_builder import FIELDS, SETTINGS, blackbox

UNITS = {"time": " (us)", "vbatLatest": " (V)", "amperageLatest": " (A)"}
NAMES = [known.name for known in FIELDS]


def _columns(n: int = 300) -> dict[str, np.ndarray]:
    rng = np.random.default_rng(0)
    made = {known.name: np.round(200 * rng.standard_normal(n)).astype(int) for known in FIELDS[2:]}
    for known in FIELDS:
        if not known.signed:
            made[known.name] = np.abs(made.get(known.name, np.zeros(n, int))) % 1500
    made["rcCommand[3]"] = 1000 + made["rcCommand[3]"] % 1000
    made["time"] = 10_000_000 + 500 * np.arange(n)
    made["loopIteration"] = 2 * np.arange(n)
    return made


def _decode(columns: dict[str, np.ndarray], path: Path) -> None:
    """As ``blackbox_decode`` prints: ", " between cells, units, flags in words behind."""
    heads = [f"{name}{UNITS.get(name, '')}" for name in NAMES]
    lines = [", ".join([*heads, "flightModeFlags (flags)", "rxSignalReceived"])]
    for row in range(len(columns["time"])):
        cells = [
            f"{columns[name][row] / 100:.3f}" if UNITS.get(name, "") in (" (V)", " (A)")
            else f"{columns[name][row]:3d}"
            for name in NAMES
        ]  # fmt: skip
        lines.append(", ".join([*cells, "0" if row < 100 else "ANGLE_MODE", "1"]))
    path.write_text("\n".join(lines) + "\n")


def _explore(columns: dict[str, np.ndarray], settings: dict[str, str], path: Path) -> None:
    """As a Blackbox Explorer exports: the header's lines, then counts, and fields of its own."""
    lines = [f'"{name}","{value}"' for name, value in settings.items()]
    lines.append(",".join(f'"{name}"' for name in [*NAMES, "heading[0]"]))
    lines += [
        ",".join([*(str(columns[name][row]) for name in NAMES), "NaN"])
        for row in range(len(columns["time"]))
    ]
    path.write_text("\n".join(lines) + "\n")


def test_a_decoded_log_is_the_log(tmp_path: Path) -> None:
    columns = _columns()
    binary = tmp_path / "LOG00001.BFL"
    binary.write_bytes(blackbox(columns))
    truth = fid.read_log(binary)
    decoded, explored = tmp_path / "LOG00001.01.csv", tmp_path / "LOG00001.csv"
    _decode(columns, decoded)
    _explore(columns, SETTINGS, explored)
    for path, has_settings in ((decoded, False), (explored, True)):
        assert is_log(path)
        log = fid.read_log(path)
        assert (log.kind, log.vehicle) == ("betaflight", "copter")
        assert ("settings-unknown" in {f.code for f in log.findings}) is not has_settings
        np.testing.assert_array_equal(log.table("main").time_s, truth.table("main").time_s)
        skipped = () if has_settings else ("accSmooth[0]", "accSmooth[1]", "accSmooth[2]")
        for name in NAMES:
            if name in skipped:
                assert name not in log.table("main")
                continue
            exact = truth.table("main")[name]
            np.testing.assert_allclose(log.table("main")[name], exact, rtol=1e-12, atol=1e-12)
        for name in ("p", "q_ref", "tau_psi", "thrust"):
            np.testing.assert_allclose(log.record()[name], truth.record()[name], atol=1e-12)
        assert (log.parameters.get("p_roll") == 45.0) is has_settings
    modes = [(e.time_s, e.text) for e in fid.read_log(decoded).events if e.kind == "mode"]
    assert modes == [(10.0, "ACRO"), (10.05, "ANGLE")]


def test_headers_beside_a_decoded_log_tell_its_gains_and_units(tmp_path: Path) -> None:
    columns, path = _columns(), tmp_path / "LOG00001.01.csv"
    _decode(columns, path)
    with pytest.raises(DataError, match="holds no parameters"):
        fid.axis_loop_of(fid.read_log(path), "roll")
    fine = {**SETTINGS, "blackbox_high_resolution": "1"}
    rows = ['"fieldname","fieldvalue"', *(f'"{name}","{value}"' for name, value in fine.items())]
    (tmp_path / "LOG00001.01.headers.csv").write_text("\n".join(rows) + "\n")
    log = fid.read_log(path)
    assert log.findings == ()
    assert fid.axis_loop_of(log, "roll").gains["p_roll"] == 45.0
    assert log.table("main")["gyroADC[0]"][5] == columns["gyroADC[0]"][5] / 10.0
    assert log.table("main")["accSmooth[2]"][5] == columns["accSmooth[2]"][5] / 2048.0


def test_units_behind_names_count(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    path.write_text(
        "loopIteration, time (s), axisRate[0], vbat, gyroADC[0] (rad/s), accSmooth[2] (m/s/s)\n"
        "0, 1.5, 10, 1580, 0.5, 9.80665\n2, 1.501, 10, 1580, 0.25, 4.903325\n"
    )
    log = fid.read_log(path)
    table = log.table("main")
    assert (log.kind, log.firmware) == ("inav", "INAV, version not told")
    np.testing.assert_allclose(table.time_s, [1.5, 1.501])
    np.testing.assert_allclose(table["gyroADC[0]"], np.degrees([0.5, 0.25]))
    np.testing.assert_allclose(table["accSmooth[2]"], [1.0, 0.5])
    assert {f.code for f in log.findings} == {"settings-unknown"}
    assert "vbat" not in table, "nobody tells what one of it is"


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("loopIteration, time (us), axisP[0]\n1, 2\n", "one cell for each heading"),
        ("loopIteration, time (us), axisP[0]\nX, X, 2\n", "rows of the loop"),
        ("loopIteration, time (us), axisP[0]", "blackbox_decode"),
    ],
)
def test_broken_ones_are_refused(tmp_path: Path, text: str, said: str) -> None:
    path = tmp_path / "bad.csv"
    path.write_text(text)
    with pytest.raises(LogFormatError, match=said):
        fid.read_log(path)


FINE = (*(f"{name}[{axis}]" for name in ("gyroADC", "rcCommand", "setpoint") for axis in range(3)),
        "rcCommand[3]", "setpoint[3]")  # fmt: skip


def _turning(*, fine: bool, without: tuple[str, ...] = ()) -> dict[str, np.ndarray]:
    """Rates that follow their set-points, of up to some 150 deg/s: none beyond a limit."""
    made = _columns()
    moved = np.round(100.0 * np.sin(0.1 * np.arange(300)[:, None] + np.arange(3)))
    for axis in range(3):
        made[f"setpoint[{axis}]"] = made[f"gyroADC[{axis}]"] = moved[:, axis]
        made[f"rcCommand[{axis}]"] = np.round(0.3 * moved[:, axis])
    made["rcCommand[3]"], made["setpoint[3]"] = np.full(300, 1400), np.full(300, 380)
    scaled = {name: (10 if fine and name in FINE else 1) * each for name, each in made.items()}
    return {name: each for name, each in scaled.items() if not name.startswith(without or ("-",))}


def _written(columns: dict[str, np.ndarray], path: Path, unit: str = "") -> Path:
    heads = [f"{name} ({unit})" if unit and name.startswith("gyro") else name for name in columns]
    heads = [
        "loopIteration",
        "time (us)",
        *(h for h in heads if h not in ("loopIteration", "time")),
    ]
    rest = [each for name, each in columns.items() if name not in ("loopIteration", "time")]
    rows = np.stack([columns["loopIteration"], columns["time"], *rest], axis=1)
    lines = [", ".join(heads), *(", ".join(f"{cell:g}" for cell in row) for row in rows)]
    path.write_text("\n".join(lines) + "\n")
    return path


@pytest.mark.parametrize("fine", [False, True])
@pytest.mark.parametrize(
    ("without", "sign"),
    [
        ((), "the throttle stick counts from"),
        (("rcCommand",), r"setpoint\[3\] counts to"),
    ],
)
def test_counts_tell_their_resolution_without_a_header(
    tmp_path: Path, fine: bool, without: tuple[str, ...], sign: str
) -> None:
    columns = _turning(fine=fine, without=without)
    log = fid.read_log(_written(columns, tmp_path / "a.csv"))
    size = 10.0 if fine else 1.0
    for name in ("gyroADC[1]", "setpoint[0]"):
        np.testing.assert_allclose(log.table("main")[name], columns[name] / size)
    said = {finding.code: finding for finding in log.findings}
    assert "unit-assumed" not in said
    assert re.search(sign, said["unit-of-counts"].message)


def test_rates_whose_counts_nothing_tells_are_said_to_be_assumed(tmp_path: Path) -> None:
    columns = _turning(fine=True, without=("rcCommand", "setpoint[3]"))
    path = _written(columns, tmp_path / "a.csv")
    for findings in (fid.read_log(path).findings, fid.review_flight(path).findings):
        said = {finding.code: finding for finding in findings}
        assert said["unit-assumed"].light is Light.AMBER
        assert "ten times too large if it was" in said["unit-assumed"].message
        assert "--unit-rotation" not in said["unit-assumed"].action


@pytest.mark.parametrize("divided", [False, True])
def test_a_decoder_s_deg_s_may_be_ten_times_too_large(tmp_path: Path, divided: bool) -> None:
    columns = _turning(fine=True)
    truth = columns["gyroADC[0]"] / 10.0
    if divided:
        for axis in range(3):
            columns[f"gyroADC[{axis}]"] = columns[f"gyroADC[{axis}]"] / 10.0
    log = fid.read_log(_written(columns, tmp_path / "a.csv", "deg/s"))
    np.testing.assert_allclose(log.table("main")["gyroADC[0]"], truth)


def test_counts_a_tenth_beyond_a_limit_are_finer() -> None:
    """A trim or a rounding reaches past it; of throttle, counts within it are plain."""
    for name, limit in (("rcCommand[1]", 500.0), ("setpoint[2]", 1998.0), ("setpoint[3]", 1000.0)):
        within, beyond = (
            resolution_of({}, {name: np.array([0.0, times * limit])}) for times in (1.09, 1.11)
        )
        assert within.is_fine is (False if name == "setpoint[3]" else None)
        assert beyond.is_fine is True
        assert beyond.sign == f"{name} counts to {1.11 * limit:,.0f}, and its limit is {limit:,.0f}"
