"""Each loss that `tests.stress.kills` looks for is seen where it is planted."""

from __future__ import annotations

import json
import os
import platform
import sys
from pathlib import Path

from flightid.study.owner import OWNER
from tests.stress.losses import aside, contents, harm, loss, next_run, others

HEX = "0123456789ab"
DEAD = json.dumps({"machine": platform.node(), "process": 2**22 + 1})
"""A note of a process that no Linux starts: their numbers end below."""
CLEARS = """
import shutil, sys
from pathlib import Path
final = Path(sys.argv[1])
for each in final.parent.glob(f".{final.name}.*.part"):
    shutil.rmtree(each)
"""


def test_losses_are_seen(tmp_path: Path) -> None:
    final, read = tmp_path / "out", tmp_path / "read.csv"
    final.mkdir()
    for file, text in (("results.json", "{}"), ("report.html", "<html></html>"), ("a.c", "int a;")):
        (final / file).write_text(text)
    read.write_text("t,u\n")
    before, apart = contents(final), others([tmp_path], [final])
    fixed = {"a.c": before["a.c"]}
    assert set(before) == {"results.json", "report.html", "a.c"}
    assert list(apart) == [read]

    def planted(file: str, text: str) -> str:
        (final / file).write_text(text)
        told = loss(final, before, fixed)
        (final / file).write_bytes(before.get(file, b""))
        return told

    assert loss(final, before, fixed) == ""
    assert planted("results.json", "{").startswith("half of results.json")
    assert planted("report.html", "<html>") == "half of report.html"
    assert planted("a.c", "int b;") == "other bytes in a.c"
    assert planted("b.c", "") == "with ['b.c']"
    (final / "b.c").unlink()
    (final / f".a.{HEX}.part.c").write_text("int")  # On its way, and no part of the result.
    assert loss(final, before, fixed) == ""
    assert next_run([sys.executable, "-c", ""], final, before, fixed).startswith("the next run lea")
    (final / f".a.{HEX}.part.c").unlink()

    left = tmp_path / f".out.{HEX}.part"
    left.mkdir()
    (left / OWNER).write_text(DEAD)
    assert aside(final) == [left]
    assert harm(apart, others([tmp_path], [final])) == ""
    assert next_run([sys.executable, "-c", ""], final, before, fixed).startswith("the next run lea")
    assert next_run([sys.executable, "-c", CLEARS, str(final)], final, before, fixed) == ""
    told = next_run([sys.executable, "-c", "raise SystemExit(3)"], final, before, fixed)
    assert told.startswith("the next run ends with 3")
    read.write_text("t,u\n0,")
    (tmp_path / "strewn.tmp").write_text("")
    assert harm(apart, others([tmp_path], [final])).count(str(tmp_path)) == 2
    os.rename(final, tmp_path / "elsewhere")
    assert loss(final, before, fixed) == "gone"
    os.rename(tmp_path / "elsewhere", tmp_path / f".out.{HEX}.old")
    assert loss(final, before, fixed) == ""
