"""Results of stages that a worker keeps, those that took long shared with the other workers.

A study of a rig is proposed, run and tuned by three processes, and who cancels work may end one:
none of them scans the orders of a model again. What is shared lies in a folder of the server that
nobody else can write, for it is unpickled; it ends with the server.
"""

from __future__ import annotations

import os
import pickle
import re
import shutil
import tempfile
import time
from collections import OrderedDict
from contextlib import suppress
from pathlib import Path
from typing import Any

HELD = 48
"""Results that a worker keeps, the oldest forgotten first."""
SLOW_S = 1.0
"""What took less is made again."""
MOST_BYTES = 64 << 20
"""Of one result that is shared."""
MOST_SHARED = 64
NAME = "flightid-stages-"
KEY = re.compile(r"[0-9a-f]{64}")


class StageCache(OrderedDict[str, Any]):
    """Results of stages, as many as `HELD`: those that were taken last.

    Example
    -------
    >>> cache = StageCache()
    >>> cache["a"] = 1
    >>> "a" in cache, "b" in cache
    (True, False)
    """

    def __init__(self) -> None:
        super().__init__()
        self._folder: Path | None = None
        self._asked: dict[str, float] = {}

    def share(self, folder: Path) -> None:
        """Share what takes long through a folder that nobody but this user can write."""
        self._folder = folder

    def __contains__(self, key: object) -> bool:
        """Whether a result is here or shared; whoever asks for one that is not makes it next."""
        if super().__contains__(key):
            return True
        if self._folder is None or not isinstance(key, str) or not KEY.fullmatch(key):
            return False
        with suppress(OSError, pickle.UnpicklingError, EOFError, AttributeError, ImportError):
            value = pickle.loads((self._folder / key).read_bytes())
            self[key] = value
            return True
        self._asked[key] = time.perf_counter()
        return False

    def __getitem__(self, key: str) -> Any:  # noqa: ANN401 - whatever a stage gives
        """A result, the youngest from now on."""
        self.move_to_end(key)
        return super().__getitem__(key)

    def __setitem__(self, key: str, value: object) -> None:
        """Keep a result, and forget the oldest."""
        super().__setitem__(key, value)
        while len(self) > HELD:
            self.popitem(last=False)
        begun = self._asked.pop(key, None)
        if self._folder is not None and begun and time.perf_counter() - begun > SLOW_S:
            self._shared(self._folder, key, value)

    def _shared(self, folder: Path, key: str, value: object) -> None:
        """What cannot be pickled (logs, which hold files open) each worker makes itself."""
        try:
            content = pickle.dumps(value)
        except (pickle.PicklingError, TypeError, AttributeError, RecursionError):
            return
        if len(content) > MOST_BYTES:
            return
        with suppress(OSError):
            new = folder / f"{key}.{os.getpid()}"
            new.write_bytes(content)
            new.replace(folder / key)
            kept = sorted(folder.iterdir(), key=lambda each: each.stat().st_mtime_ns)
            for old in kept[:-MOST_SHARED]:
                old.unlink(missing_ok=True)


def shared_folder() -> Path:
    """A folder of this process that no other user can open; those of servers that are gone go."""
    for old in Path(tempfile.gettempdir()).glob(f"{NAME}*"):
        pid = old.name.removeprefix(NAME).partition("-")[0]
        if pid.isdigit() and not _lives(int(pid)):
            shutil.rmtree(old, ignore_errors=True)
    return Path(tempfile.mkdtemp(prefix=f"{NAME}{os.getpid()}-"))


def _lives(pid: int) -> bool:
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    except OSError:
        return True
    return True
