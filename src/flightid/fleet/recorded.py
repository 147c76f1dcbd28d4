"""Files whose bytes a record has under another name or time of change, found by their digest."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from functools import lru_cache

from flightid.files import sha256_of_file
from flightid.fleet.addresses import LogAddress
from flightid.fleet.missing import LogEntry


def recorded_logs(
    addresses: Iterable[LogAddress], entries: Mapping[str, LogEntry]
) -> dict[str, str]:
    """Logs of those files, by address, whose bytes a record has.

    A file of this machine is read where a record has its size; one from afar is not.

    Parameters
    ----------
    addresses : iterable of LogAddress
        Files that no record stands for by address, size and time of change.
    entries : mapping of str to LogEntry
        Records by log.
    """
    sizes = {entry.bytes for entry in entries.values()}
    likely = [each for each in addresses if str(each.n_bytes) in sizes]
    found = {each.address: _digest(each) for each in likely}
    return {address: log for address, log in found.items() if log in entries}


def _digest(address: LogAddress) -> str:
    """Digest of a file of this machine; empty where it cannot be read, or is read from afar."""
    if address.local is None or address.problem:
        return ""
    try:
        return _digest_of(address.address, address.n_bytes, address.stamp)
    except OSError:
        return ""


@lru_cache(maxsize=1 << 16)
def _digest_of(path: str, n_bytes: int, stamp: str) -> str:
    """Taken once as long as size and time of change stay."""
    del n_bytes, stamp
    return sha256_of_file(path)
