"""Damaged files at every reader, and those that once broke one; `make fuzz` throws millions."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from flightid.errors import FileFormatError
from tests.fuzz.mutations import damaged
from tests.fuzz.runs import KEPT, ended, made, sound

RUNS = 80


def test_damaged_files_are_read_or_refused(tmp_path: Path) -> None:
    ends = [ended(*made(seed), tmp_path) for seed in range(RUNS)]
    assert ends.count("refused") > RUNS // 3
    assert ends.count("read") > RUNS // 20


def test_what_once_broke_a_reader_is_refused(tmp_path: Path) -> None:
    kept = sorted(KEPT.glob("*~*"))
    assert len(kept) >= 3
    for path in kept:
        reader = sound()[path.name.split("~")[0]]
        assert ended(reader, path.read_bytes(), tmp_path) == "refused", path.name


def test_sound_files_are_read(tmp_path: Path) -> None:
    refused = [
        name
        for name, seed in sound().items()
        if name not in {"fit.json", "results.json"}
        and ended(seed, seed.content, tmp_path) != "read"
    ]
    assert refused == []


def test_a_reader_with_a_fault_would_be_told(tmp_path: Path) -> None:
    seed = sound()["vehicle.parm"]

    def broken(path: Path) -> object:
        raise IndexError(path.name)

    with pytest.raises(IndexError):
        ended(type(seed)(seed.name, broken, seed.content), seed.content, tmp_path)
    with pytest.raises(FileFormatError):
        seed.read(_written(tmp_path / "a.parm", b"one two three"))


def _written(path: Path, content: bytes) -> Path:
    path.write_bytes(content)
    return path


def test_damage_repeats_with_its_seed() -> None:
    assert made(5) == made(5)
    random = np.random.default_rng(1)
    assert len({damaged(random, b"abcdefgh", b"", is_text=False) for _ in range(20)}) > 5
