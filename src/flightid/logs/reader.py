"""Open a log by what it contains, never by what its name ends in."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path

from flightid import _native
from flightid.errors import FileFormatError, LogFormatError
from flightid.logs.blackbox.decoded import is_decoded, open_decoded
from flightid.logs.blackbox.reader import PRODUCT, open_blackbox
from flightid.logs.dataflash.printed import open_printed
from flightid.logs.dataflash.sdlog2 import open_binary
from flightid.logs.log import Log
from flightid.logs.mavlink.reader import open_telemetry
from flightid.logs.ros.reader import is_vehicle_bag, open_bag
from flightid.logs.source import LogSource
from flightid.logs.ulog.reader import UlogSource
from flightid.reading import require_file
from flightid.record.formats.foreign import foreign, is_text, unknown_kind
from flightid.record.formats.sniff import file_format, is_bag

ULOG_MAGIC = b"ULog\x01\x12\x35"
DATAFLASH_HEADER = b"\xa3\x95"
TEXT_LOG = re.compile(
    rb"^FMT, *(\d+), *(\d+), *\w{1,4}, *[a-zA-Z]{1,16}, *\w[\w, ]*\r?$", re.MULTILINE
)
TEXT_WITHIN = 4096
"""Bytes in which a text log begins to define its messages; ground stations write lines before."""
SNIFFED = 65536
"""Bytes searched for a first DataFlash header: a log whose beginning is damaged is still a log."""


def _is_printed(head: bytes) -> bool:
    """Whether a line defines a message: type and length of one byte each, name, format, labels."""
    found = TEXT_LOG.finditer(head[:TEXT_WITHIN])
    return any(max(int(line[1]), int(line[2])) < 256 for line in found)


# Content test, name of the format, opener.
_FORMATS: tuple[tuple[Callable[[bytes], bool], str, Callable[[Path], LogSource]], ...] = (
    (lambda head: head.startswith(ULOG_MAGIC), "PX4 ULog", UlogSource),
    (lambda head: PRODUCT in head, "Betaflight or INAV blackbox", open_blackbox),
    (is_decoded, "decoded blackbox (CSV)", open_decoded),
    (_is_printed, "ArduPilot text log", open_printed),
    (_native.is_telemetry_log, "MAVLink telemetry", open_telemetry),
)
# In other files these two bytes may stand by chance: asked last, and not where rig records are.
_BY_CHANCE = (lambda head: DATAFLASH_HEADER in head, "ArduPilot DataFlash", open_binary)
# Beginnings of logs that are not read, and what to do with them.
_BROKEN: tuple[tuple[bytes, str, str], ...] = (
    (b"FMT,", "a text log without a whole definition", "hand in the .bin file it was made from"),
    (
        b"\xfd",
        "a MAVLink stream without stamps",
        "record it as .tlog, or hand in the vehicle's log",
    ),
)
BEGINNINGS = {
    ".ulg": "PX4 ULog begins with its header",
    ".bin": "DataFlash log begins with the definitions of its messages",
    ".bbl": "blackbox log begins with its header",
    ".bfl": "blackbox log begins with its header",
}
"""What the logs of a name begin with, without which nothing in them can be read."""


def read_log(path: str | Path) -> Log:
    """Open a flight log, whose format its content tells.

    ArduPilot DataFlash (binary and text), PX4 ULog and its forerunner sdlog2, blackbox logs of
    Betaflight and INAV, as they are or decoded to CSV, telemetry that ground stations record
    (``.tlog``), and bags of ROS with messages of px4_msgs or topics of MAVROS.

    The file is indexed once; columns are extracted when they are asked for. Damaged places are
    skipped and reported in `Log.skipped`.

    A binary DataFlash file is mapped where the system can, not copied, and has to stay as it is
    while its `Log` is in use: where another process has shortened it, even during a reading, that
    reading raises `LogFormatError`. Replacing the file by renaming another over it is harmless.
    Copy a log that is still being written or downloaded, and read the copy.

    Parameters
    ----------
    path : path-like
        The file. Its name does not matter.

    Raises
    ------
    LogFormatError
        The content is no log that flightid reads; the message says what it looks like.
    OSError
        The file cannot be read.

    Example
    -------
    >>> import flightid as fid
    >>> log = fid.read_log("flight.bin")                             # doctest: +SKIP
    >>> log.messages["RATE"].rate_hz                                 # doctest: +SKIP
    400.0
    """
    path = Path(path)
    head = _head(path)
    if is_vehicle_bag(path, head):
        return Log(path, open_bag(path))
    for holds, _, open_source in _FORMATS:
        if holds(head):
            return Log(path, open_source(path))
    if foreign(head) is None and _BY_CHANCE[0](head):
        try:
            return Log(path, _BY_CHANCE[2](path))
        except LogFormatError as error:
            size = path.stat().st_size
            raise _without_beginning(path, f"{size} bytes without one message") from error
    if _lacks_beginning(path, head):
        raise _without_beginning(path, unknown_kind(head))
    raise _not_a_log(path, head)


def is_log(path: str | Path) -> bool:
    """Whether `read_log` is the reader of a file, judged by its content: not of records of a rig.

    A log of an autopilot that flightid does not read counts too: `read_log` says what it is.

    Raises
    ------
    OSError
        The file cannot be read.
    """
    path = Path(path)
    head = _head(path)
    signs = (DATAFLASH_HEADER, *(magic for magic, _, _ in _BROKEN))
    strange = foreign(head)
    if strange is None and head.startswith(signs):
        return True
    if any(holds(head) for holds, _, _ in _FORMATS) or is_vehicle_bag(path, head):
        return True
    if strange is not None:
        return False
    try:
        file_format(path)
    except FileFormatError:
        return _BY_CHANCE[0](head) or _lacks_beginning(path, head)
    return False


def is_table_too(path: str | Path) -> bool:
    """Whether a log is a table of records as well: a bag, or a blackbox that was decoded to CSV.

    Raises
    ------
    OSError
        The file cannot be read.
    """
    path = Path(path)
    return is_bag(path) or is_decoded(_head(path))


def _head(path: Path) -> bytes:
    """First bytes of a file; none of a folder, which may be a bag of records."""
    require_file(path)
    if path.is_dir():
        return b""
    with path.open("rb") as file:
        return file.read(SNIFFED)


def _lacks_beginning(path: Path, head: bytes) -> bool:
    """Whether a file has a log's name and holds bytes, of which no reader knows the first."""
    if path.is_dir() or path.suffix.lower() not in BEGINNINGS or is_text(head):
        return False
    return foreign(head) is None and not any(head.startswith(magic) for magic, _, _ in _BROKEN)


def _without_beginning(path: Path, found: str) -> LogFormatError:
    """What is said of the rest of a log: its name tells what it was, as its content cannot."""
    begins = BEGINNINGS.get(path.suffix.lower(), "log begins with what defines its messages")
    return LogFormatError(
        f"{path.name} does not begin as a log does",
        found=found,
        needed=f"the whole log: a {begins}",
        action="copy the whole log from the card again; a part without its beginning has no reader",
    )


def _not_a_log(path: Path, head: bytes) -> LogFormatError:
    found, action = unknown_kind(head), "hand in the autopilot's own log file"
    broken = [(what, advice) for magic, what, advice in _BROKEN if head.startswith(magic)]
    if named := [*filter(None, [None if path.is_dir() else foreign(head)]), *broken]:
        found, action = named[0]
    else:
        try:
            kind = file_format(path)
        except FileFormatError:
            pass
        else:
            found = f"records ({kind})"
            action = f"flightid inspect {path.name} lists its columns, flightid run identifies"
    names = [name for _, name, _ in (*_FORMATS, _BY_CHANCE)]
    formats = " or ".join([*names, "a bag of PX4 or MAVROS"])
    return LogFormatError(f"{path.name} is not a log", found=found, needed=formats, action=action)
