"""ARCHITECTURE.md names files and rooms that exist, and every room."""

from __future__ import annotations

import re

from tests.contract.source import PACKAGE, ROOT, rust_files
from tests.contract.test_imports import ENDS, ORDER, SHOW

TEXT = (ROOT / "ARCHITECTURE.md").read_text(encoding="utf-8")
NAMED = re.findall(r"`([\w./<>-]+(?:\.(?:py|rs|toml)|/))`", TEXT)


def _exists(name: str) -> bool:
    pattern = re.sub(r"<\w+>", "*", name)
    if "/" not in name.rstrip("/"):
        return any(PACKAGE.rglob(pattern)) or any(path.name == name for path in rust_files())
    return any(list(folder.glob(pattern)) for folder in (PACKAGE, ROOT))


def test_files_that_it_names_exist() -> None:
    assert len(NAMED) > 60
    lost = sorted({name for name in NAMED if not _exists(name)})
    assert not lost


def test_its_table_has_every_room_in_the_order_of_the_import_rule() -> None:
    rooms = [
        name
        for row in re.findall(r"^\| (`.*?) \|", TEXT, re.MULTILINE)[:30]
        for name in re.findall(r"`(\w+)`", row)
    ]
    table = [name for name in rooms if name in {*ORDER, *SHOW, *ENDS}]
    assert table[: len(ORDER)] == ORDER
    assert set(table[len(ORDER) :]) == {*SHOW, "study", "fleet", "app", "cli"}
