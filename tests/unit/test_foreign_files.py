"""Files of other kinds are named for what they are, whatever their names and readers."""

from __future__ import annotations

import gzip
import io
import zipfile
from pathlib import Path

import pytest

import flightid as fid
from flightid.errors import FlightidError
from flightid.logs import is_log
from flightid.record.formats.foreign import foreign


def zipped(member: str) -> bytes:
    made = io.BytesIO()
    with zipfile.ZipFile(made, "w") as archive:
        archive.writestr(member, "x")
    return made.getvalue()


PARAMETERS = b"ACRO_BAL_PITCH,1\nACRO_BAL_ROLL,1\nAHRS_EKF_TYPE,3\nARMING_CHECK,1\n"
KINDS = {
    "empty": (b"", "an empty file"),
    "erased": (b"\xff" * 5000, "nothing but bytes 0xff"),
    "gzip of a log": (gzip.compress(b"\xa3\x95\x80" * 400), "gzip data"),
    "zstd": (b"\x28\xb5\x2f\xfd" + bytes(40) + b"\xa3\x95", "zstd"),
    "7z": (b"7z\xbc\xaf\x27\x1c" + bytes(40), "7z archive"),
    "zip": (zipped("00000001.BIN"), "a zip archive"),
    "workbook": (zipped("[Content_Types].xml"), "Excel workbook"),
    "numpy": (zipped("p.npy"), "NumPy arrays"),
    "tar": (b"a.bin" + bytes(252) + b"ustar\x0000" + bytes(200), "a tar archive"),
    "old workbook": (b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1" + bytes(40), "old Excel"),
    "document": (b"%PDF-1.7\n%", "a PDF document"),
    "picture": (b"\x89PNG\r\n\x1a\n" + bytes(9), "a picture"),
    "video": (b"\0\0\0\x18ftypmp42", "a video"),
    "activity": (b"\x0e\x10\xd9\x07\0\0\0\0.FIT", "Garmin"),
    "pickle": (b"\x80\x04\x95\x0c\0\0", "never opened"),
    "track": (b'<?xml version="1.0"?>\n<gpx version="1.1">', "GPX"),
    "map": (b'\xef\xbb\xbf<?xml version="1.0"?>\n<kml>', "KML"),
    "training": (b"<?xml?><TrainingCenterDatabase>", "TCX"),
    "page": (b"\n<!DOCTYPE html><html>", "a web page"),
    "json": (b'{"a": [1, 2]}', "JSON"),
    "mission": (b'{"fileType": "Plan"}', "a mission"),
    "way-points": (b"QGC WPL 110\n0\t1", "way-points"),
    "parameters": (PARAMETERS, "parameters of ArduPilot"),
    "settings": (b"# diff all\n\n# version\n", "dump of settings"),
    "firmware": (b'{"board_id": 9, "image": ""}', "firmware"),
    "labview": (b"TDSm" + bytes(20), "LabVIEW"),
    "measurements": (b"MDF     4.10", "MDF"),
    "feather": (b"ARROW1\0\0", "Feather"),
    "pointer": (b"version https://git-lfs.github.com/spec/v1\n", "Git LFS"),
    "newer ulog": (b"ULog\x02" + bytes(30), "ULog"),
    "stream": (b"\xfd\x09\x00" + bytes(30), "without stamps"),
}


@pytest.mark.parametrize("suffix", [".csv", ".bin"])
@pytest.mark.parametrize("kind", KINDS)
def test_a_foreign_file_is_named_and_told_what_to_do(
    kind: str, suffix: str, tmp_path: Path
) -> None:
    content, named = KINDS[kind]
    path = tmp_path / f"flight{suffix}"
    path.write_bytes(content)
    readers = (fid.read_log,) if is_log(path) else (fid.read_log, fid.read_records)
    for read in readers:
        with pytest.raises(FlightidError) as caught:
            read(path)
        assert named in str(caught.value)
        assert "Next: " in str(caught.value)


@pytest.mark.parametrize(
    "head", [b"time,u\n0,1\n", b"\xa3\x95\x80\x80", b"1;2;3\n", b"# a note\ntime,u\n", b"[s],m\n"]
)
def test_tables_and_logs_are_not_foreign(head: bytes) -> None:
    assert foreign(head) is None


@pytest.mark.parametrize(
    ("name", "begins"), [("x.ulg", "a PX4 ULog begins"), ("X.BIN", "a DataFlash log begins")]
)
@pytest.mark.parametrize("rest", [b"\x80\x3f\x01\x32\xa3\x95\x07\x91", b"\x80\x3f\x01\x32\x00\x44"])
def test_the_rest_of_a_log_is_named_and_told_what_to_do(
    name: str, begins: str, rest: bytes, tmp_path: Path
) -> None:
    """A ULog was "not a DataFlash log", or sent a reader of a terminal to `read_log`."""
    path = tmp_path / name
    path.write_bytes(rest * 9)
    assert is_log(path)
    with pytest.raises(FlightidError, match=f"{begins}.*Next: copy the whole log from the card"):
        fid.read_log(path)
    path = path.with_suffix(".rec")
    path.write_bytes(b"\x80\x00\x01\x00" * 9)
    with pytest.raises(FlightidError, match=r"bytes of no known kind.*flightid inspect FILE"):
        fid.read_records(path)
