"""Files that people hand in and that are neither logs nor records: what they are, what to do."""

from __future__ import annotations

import codecs
import re

UNPACK = "unpack it, and hand in the file in it"
TABLE = "save the table as CSV (UTF-8), one column a signal, with its time"
NO_DATA = "hand in the autopilot's own log, or a table of inputs and outputs with their time"
TRACK = "a track of positions holds no inputs: " + NO_DATA
SETTINGS = "settings hold no flight: " + NO_DATA
EXPORT = "export its channels to CSV or Parquet: one column a signal, with its time"

# Where in the first bytes, what stands there, what it is, what to do. The first that fits counts.
_SIGNS: tuple[tuple[int, bytes, str, str], ...] = (
    (0, b"\x1f\x8b", "gzip data", f"gunzip it: {UNPACK}"),
    (0, b"\x28\xb5\x2f\xfd", "data packed by zstd", f"zstd -d: {UNPACK}"),
    (0, b"BZh", "data packed by bzip2", f"bunzip2: {UNPACK}"),
    (0, b"\xfd7zXZ\x00", "data packed by xz", f"unxz: {UNPACK}"),
    (0, b"\x04\x22\x4d\x18", "data packed by lz4", f"lz4 -d: {UNPACK}"),
    (0, b"7z\xbc\xaf\x27\x1c", "a 7z archive", UNPACK),
    (0, b"Rar!", "a RAR archive", UNPACK),
    (257, b"ustar", "a tar archive", UNPACK),
    (0, b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1", "an old Excel or Word file", TABLE),
    (0, b"%PDF", "a PDF document", NO_DATA),
    (0, b"\x89PNG", "a picture (PNG)", NO_DATA),
    (0, b"\xff\xd8\xff", "a picture (JPEG)", NO_DATA),
    (0, b"GIF8", "a picture (GIF)", NO_DATA),
    (4, b"ftyp", "a video", NO_DATA),
    (0, b"RIFF", "sound or video (RIFF)", NO_DATA),
    (8, b".FIT", "a Garmin FIT activity", TRACK),
    (0, b"\x93NUMPY", "a NumPy array (.npy)", EXPORT),
    (0, b"\x80\x04\x95", "a Python pickle, which is never opened: it could run anything", EXPORT),
    (0, b"\x80\x05\x95", "a Python pickle, which is never opened: it could run anything", EXPORT),
    (0, b"TDSm", "LabVIEW measurements (TDMS)", EXPORT),
    (0, b"MDF     ", "ASAM measurements (MDF)", EXPORT),
    (0, b"ARROW1", "an Arrow or Feather table", EXPORT),
    (0, b"\xd4\xc3\xb2\xa1", "captured network packets", NO_DATA),
    (0, b"\x0a\x0d\x0d\x0a", "captured network packets", NO_DATA),
    (0, b"\x7fELF", "a program", NO_DATA),
    (0, b"MZ", "a program of Windows", NO_DATA),
    (0, b"ULog", "a ULog file of another version, or a damaged one", "copy it again"),
    (
        0,
        b"LOGH",
        "a log of DJI",
        "DJI's logs are closed: record with an open autopilot, or export CSV",
    ),
    (0, b"QGC WPL", "a mission of way-points", NO_DATA),
)
# Names of members that a zip archive begins with, and what it then is.
_ZIPPED: tuple[tuple[bytes, str, str], ...] = (
    (b"[Content_Types].xml", "an Excel workbook or other Office file", TABLE),
    (b"xl/", "an Excel workbook", TABLE),
    (b"opendocument.spreadsheet", "an OpenDocument spreadsheet", TABLE),
    (b".npy", "NumPy arrays (.npz)", EXPORT),
    (b".kml", "a track for maps (KMZ)", TRACK),
    (b"simulink/", "a Simulink model", "simulate it, and save its signals as CSV or .mat"),
)
# How texts begin that are no tables, after white space and a byte-order mark.
_TEXTS: tuple[tuple[re.Pattern[bytes], str, str], ...] = tuple(
    (re.compile(sign, re.IGNORECASE | re.DOTALL), found, action)
    for sign, found, action in (
        (rb"(<\?xml.*?)?<gpx", "a GPS track (GPX)", TRACK),
        (rb"(<\?xml.*?)?<kml", "a track for maps (KML)", TRACK),
        (rb"(<\?xml.*?)?<trainingcenter", "a training file (TCX)", TRACK),
        (
            rb"(<!--.*?-->\s*)?<(!doctype html|html|head|body)",
            "a web page, perhaps of a download that failed or asks to log in",
            "download the file itself, and look into it before handing it in",
        ),
        (rb"<\?xml|<[a-z]+[ >]", "XML", EXPORT),
        (rb'\{.*"board_id"', "firmware (.apj)", "hand in the flight's log"),
        (rb'\{.*"fileType"\s*:\s*"Plan"', "a mission of QGroundControl (.plan)", NO_DATA),
        (rb'\{.*"type"\s*:\s*"Feature', "a map (GeoJSON)", TRACK),
        (rb'\{\s*("|\})|\[\s*[\[{"\d\]-]', "JSON", EXPORT),
        (rb"# Onboard parameters|# Vehicle-Id", "parameters of QGroundControl", SETTINGS),
        (rb"#NOTE:[^\n]*\n[A-Z][A-Z0-9_]+,", "parameters of Mission Planner", SETTINGS),
        (rb"([A-Z][A-Z0-9_]{2,15}[, \t]+-?[\d.]+\r?\n){4}", "parameters of ArduPilot", SETTINGS),
        (rb"# (Betaflight|INAV)|(# )?(diff|dump)( all)?\r?\n", "a dump of settings", SETTINGS),
        (rb"version https://git-lfs", "a pointer of Git LFS, not the file", "git lfs pull"),
    )
)


def foreign(head: bytes) -> tuple[str, str] | None:
    """What a file of no use is by its first bytes, and what to do with it; None: not known.

    Parameters
    ----------
    head : bytes
        Its first kilobytes, or all of it.

    Example
    -------
    >>> foreign(b"%PDF-1.7")[0], foreign(b"time,u")
    ('a PDF document', None)
    """
    if not head:
        return "an empty file", "copy it again"
    if not head.strip(b"\xff") or not head.strip(b"\x00"):
        return f"nothing but bytes {head[0]:#04x}", "copy it again: the memory was erased there"
    if head.startswith(b"PK\x03\x04"):
        known = (pair for sign, *pair in _ZIPPED if sign in head)
        found, action = next(known, ["a zip archive", UNPACK])
        return found, action
    for place, sign, found, action in _SIGNS:
        if head[place : place + len(sign)] == sign:
            return found, action
    text = head.removeprefix(b"\xef\xbb\xbf").lstrip()
    return next(((found, action) for sign, found, action in _TEXTS if sign.match(text)), None)


def is_text(head: bytes) -> bool:
    """Whether a file is text, by its first bytes: none of them is zero but in UTF-16."""
    return head[:2] in (codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE) or (
        bool(head) and b"\x00" not in head
    )


def unknown_kind(head: bytes) -> str:
    """What a file is of which nothing else is known, in words that repeat nothing of it.

    Whoever hands a file in may not be whom it belongs to: a study or a fleet file names others.

    Example
    -------
    >>> unknown_kind(b"root:x:0:0"), unknown_kind(bytes([0, 1, 2]))
    ('text of no known kind', 'bytes of no known kind')
    """
    try:
        codecs.getincrementaldecoder("utf-8")().decode(head)  # it may be cut within a letter
        is_whole = is_text(head)
    except UnicodeDecodeError:
        is_whole = False
    return f"{'text' if is_whole else 'bytes'} of no known kind"
