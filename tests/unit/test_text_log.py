"""Text logs of ArduPilot: printed by pymavlink's reading of a binary log, they read as that log."""

from pathlib import Path

import numpy as np
import pytest

import flightid as fid
from flightid.errors import LogFormatError
from flightid.logs import is_log
from tests.ordinary_log import write_ordinary_log

DFReader = pytest.importorskip("pymavlink.DFReader")


def _printed(path: Path) -> list[str]:
    """Lines as ground stations print them: a name, and numbers that the format's letters scale."""
    lines = []
    log = DFReader.DFReader_binary(str(path))
    while (message := log.recv_msg()) is not None:
        values = [
            raw.split(b"\0")[0].decode() if isinstance(raw, bytes) else repr(raw * (scale or 1))
            for raw, scale in zip(message._elements, message.fmt.msg_mults, strict=True)
        ]
        lines.append(", ".join([message.get_type(), *values]))
    log.filehandle.close()
    return lines


@pytest.fixture(scope="module")
def flown(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, list[str]]:
    path = tmp_path_factory.mktemp("text") / "flight.BIN"
    write_ordinary_log(path, duration_s=4.0)
    return path, _printed(path)


def _open(folder: Path, lines: list[str], name: str = "flight.log") -> fid.Log:
    path = folder / name
    path.write_text("\r\n".join(lines))
    return fid.read_log(path)


def test_reads_as_the_binary_log(tmp_path: Path, flown: tuple[Path, list[str]]) -> None:
    binary, printed = fid.read_log(flown[0]), _open(tmp_path, flown[1])
    assert set(printed.messages) == set(binary.messages)
    assert printed.parameters == binary.parameters
    assert printed.firmware == binary.firmware
    for name in ("RATE", "ANG", "RCOU", "BAT"):
        for field, values in binary.table(name).arrays().items():
            np.testing.assert_array_equal(printed.table(name)[field], values, err_msg=field)
    assert not [f for f in printed.findings if f.code == "lines-skipped"]


def test_lines_that_are_no_message_are_counted(
    tmp_path: Path, flown: tuple[Path, list[str]]
) -> None:
    bad = ["RATE, 1, 2", "NONE, 3", "RATE, x" + ", 1" * 12]
    log = _open(tmp_path, [*flown[1][:60], *bad, *flown[1][60:]])
    said = next(f.message for f in log.findings if f.code == "lines-skipped")
    assert "3 lines" in said
    assert len(log.table("RATE")) == len(fid.read_log(flown[0]).table("RATE"))


def test_text_with_commas_and_modes_by_name(tmp_path: Path) -> None:
    lines = [
        "FMT, 128, 89, FMT, BBnNZ, Type,Length,Name,Format,Columns",
        "FMT, 4, 75, MSG, QZ, TimeUS,Message",
        "FMT, 3, 14, MODE, QMBB, TimeUS,Mode,ModeNum,Rsn",
        "FMT, 9, 25, POS, QLLce, TimeUS, Lat, Lng, Alt, RelAlt",
        "MSG, 1000000, ArduCopter V4.5.7, of a friend",
        "MODE, 1000000, Loiter, 5, 1",
        "POS, 2000000, -35.3632621, 149.1652373, -3.25, 584.19",
    ]
    log = _open(tmp_path, lines)
    assert log.table("MSG").text("Message") == ["ArduCopter V4.5.7, of a friend"]
    assert any(event.text.startswith("LOITER") for event in log.events)
    table = log.table("POS")
    assert table["Lat"][0] == -35.3632621
    assert table["Alt"][0] == -3.25


@pytest.mark.parametrize("before", [[], ["Mission Planner 1.3", "", "# of a friend"]])
def test_logs_without_a_definition_of_definitions_in_front(
    tmp_path: Path, flown: tuple[Path, list[str]], before: list[str]
) -> None:
    rest = [line for line in flown[1] if not line.startswith("FMT, 128")]
    assert len(rest) < len(flown[1])
    log = _open(tmp_path, [*before, *rest])
    assert len(log.table("RATE")) == len(fid.read_log(flown[0]).table("RATE"))
    assert log.parameters == fid.read_log(flown[0]).parameters
    assert is_log(log.path)
    with pytest.raises(LogFormatError):
        _open(tmp_path, ["FMT, 300, 89, RATE, Qf, TimeUS,R", "RATE, 1, 2"], "no.log")


def test_nothing_but_definitions_is_no_log(tmp_path: Path) -> None:
    with pytest.raises(LogFormatError):
        _open(tmp_path, ["FMT, 128, 89, FMT, BBnN, Type"])
