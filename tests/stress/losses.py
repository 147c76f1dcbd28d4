"""What a killed command may not do: leave half a file, harm others, fail when it is run again."""

from __future__ import annotations

import hashlib
import json
import os
import re
import subprocess
import tomllib
from collections.abc import Callable, Iterable, Mapping, Sequence
from io import BytesIO
from pathlib import Path

import h5py

from flightid.files import STALE_S
from flightid.study.owner import OWNER, UNKNOWN_S

LATER_S = 2.0 * max(STALE_S, UNKNOWN_S)
"""After so long nobody waits for the writer of a file, or of a folder without a note of one, s."""
ASIDE = re.compile(r"\.(.+)\.[0-9a-f]{12}\.(?:part|old)(\.\w+)?")
"""Names under which results are written, or kept until the new ones stand."""


def contents(path: Path) -> dict[str, bytes]:
    """Files of a result by their path in it, or one file; but those still being written."""
    if path.is_file():
        return {path.name: path.read_bytes()}
    files = (each for each in path.rglob("*") if each.is_file() and not ASIDE.fullmatch(each.name))
    return {str(each.relative_to(path)): each.read_bytes() for each in files}


def aside(path: Path) -> list[Path]:
    """What stands in a result's folder, or in it, under a name of `ASIDE`."""
    found = [*path.parent.iterdir(), *(path.rglob(".*") if path.is_dir() else ())]
    return [each for each in found if ASIDE.fullmatch(each.name)]


def _opened(content: bytes) -> None:
    h5py.File(BytesIO(content)).close()


READERS: Mapping[str, Callable[[bytes], object]] = {
    ".json": json.loads,
    ".toml": lambda content: tomllib.loads(content.decode("utf-8")),
    ".nc": _opened,
}
"""What fails on half a file, by the end of its name."""


def loss(path: Path, before: Mapping[str, bytes], fixed: Mapping[str, bytes]) -> str:
    """What is wrong after a kill; empty where the old or a whole new result stands.

    `fixed` are files that hold the same bytes whenever their command ends.
    """
    if not path.exists():
        return "" if [*path.parent.glob(f".{path.name}.*.old")] else "gone"
    after = contents(path)
    if missing := set(before) - set(after):
        return f"without {sorted(missing)[:3]}"
    if strange := set(after) - set(before):
        return f"with {sorted(strange)[:3]}"
    for name, content in after.items():
        if content != fixed.get(name, content):
            return f"other bytes in {name}"
        if name.endswith(".html") and not content.rstrip().endswith(b"</html>"):
            return f"half of {name}"
        try:
            READERS.get(Path(name).suffix, bytes)(content)
        except (OSError, ValueError) as error:
            return f"half of {name}: {error}"
    return "" if all(after.values()) else "empty files"


def others(folders: Iterable[Path], results: Iterable[Path]) -> dict[Path, str]:
    """SHA-256 of each file of those folders that is no part of a result, or of one on the way."""
    own = {each for path in results for each in (path, *aside(path))}
    return {
        each: hashlib.sha256(each.read_bytes()).hexdigest()
        for folder in folders
        for each in folder.rglob("*")
        if each.is_file() and own.isdisjoint((each, *each.parents))
    }


def harm(before: Mapping[Path, str], after: Mapping[Path, str]) -> str:
    """Which of the files that a command reads, or has nothing to do with, differ since."""
    differ = [each for each in {**before, **after} if before.get(each) != after.get(each)]
    return f"harmed or strewn {sorted(map(str, differ))[:3]}" if differ else ""


def next_run(
    words: Sequence[str], path: Path, before: Mapping[str, bytes], fixed: Mapping[str, bytes]
) -> str:
    """What is wrong when the command is run again, much later: it ends well and clears all aside.

    A folder with a note of its writer, who is dead, is as it was left: it goes at once.
    """
    for each in aside(path):
        if each.is_file() or not (each / OWNER).exists():
            long_ago = each.stat().st_mtime - LATER_S
            os.utime(each, (long_ago, long_ago))
    made = subprocess.run(words, stdout=-3, stderr=subprocess.PIPE, check=False)
    if made.returncode:
        return f"the next run ends with {made.returncode}: {made.stderr.decode()[-200:]}"
    if left := aside(path):
        return f"the next run leaves {[each.name for each in left][:3]}"
    told = loss(path, before, fixed)
    return told and f"after the next run: {told}"
