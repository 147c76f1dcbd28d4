"""Files are written whole or not at all."""

from __future__ import annotations

import hashlib
import os
import time
from pathlib import Path

import pytest

from flightid.files import STALE_S, sha256_of_file, write_atomically


@pytest.mark.parametrize("content", [b"abc", "abc", lambda path: path.write_bytes(b"abc")])
def test_bytes_text_and_writers_arrive_whole(tmp_path: Path, content: object) -> None:
    path = write_atomically(tmp_path / "out.csv", content)
    assert path.read_bytes() == b"abc"
    assert [entry.name for entry in tmp_path.iterdir()] == ["out.csv"]


@pytest.mark.parametrize("error", [ValueError, KeyboardInterrupt, SystemExit])
def test_failure_or_interrupt_leaves_the_old_file_and_no_other(
    tmp_path: Path, error: type[BaseException]
) -> None:
    path = tmp_path / "out.csv"
    path.write_bytes(b"old")

    def half(temporary: Path) -> None:
        temporary.write_bytes(b"half")
        raise error

    with pytest.raises(error):
        write_atomically(path, half)
    assert path.read_bytes() == b"old"
    assert [entry.name for entry in tmp_path.iterdir()] == ["out.csv"]


def test_bytes_are_on_the_disk_before_the_name_and_the_name_at_the_end(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path, flushed = tmp_path / "a.txt", []
    monkeypatch.setattr(
        os, "fsync", lambda handle: flushed.append((os.fstat(handle).st_ino, path.exists()))
    )
    write_atomically(path, "new")
    assert flushed == [(path.stat().st_ino, False), (tmp_path.stat().st_ino, True)]


def test_a_writer_sees_the_final_suffix(tmp_path: Path) -> None:
    suffixes = []
    write_atomically(tmp_path / "a.parquet", lambda p: (suffixes.append(p.suffix), p.touch()))
    assert suffixes == [".parquet"]


def test_missing_folder_is_an_os_error(tmp_path: Path) -> None:
    with pytest.raises(OSError, match="nowhere"):
        write_atomically(tmp_path / "nowhere" / "a.txt", b"")


def test_hash_of_a_file_longer_than_a_block(tmp_path: Path) -> None:
    content = bytes(range(256)) * 5000
    (tmp_path / "long").write_bytes(content)
    assert sha256_of_file(tmp_path / "long") == hashlib.sha256(content).hexdigest()


def test_what_killed_writers_left_goes_and_nothing_else(tmp_path: Path) -> None:
    stale, young = (tmp_path / f".a.{mark}.part.csv" for mark in ("0123456789ab", "1123456789ab"))
    other = tmp_path / ".a.mine.part.csv"
    for path in (stale, young, other):
        path.touch()
    for path in (stale, other):
        os.utime(path, (0.0, time.time() - 2.0 * STALE_S))
    write_atomically(tmp_path / "a.csv", b"x")
    assert sorted(tmp_path.iterdir()) == sorted([young, other, tmp_path / "a.csv"])
