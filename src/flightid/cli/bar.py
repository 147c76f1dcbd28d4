"""A progress bar on standard error, for work that takes longer than a second."""

from __future__ import annotations

import sys
import time
from threading import Event, Thread
from typing import TextIO

PATIENCE_S = 1.0
"""Work shorter than this shows nothing."""
REDRAWN_S = 0.1
WIDTH = 30
LABEL_WIDTH = 40
CLEAR = "\r\x1b[K"


class Bar:
    """One bar; appears after `PATIENCE_S` and vanishes when the work ends.

    Parameters
    ----------
    label : str
        What is being done.
    total : int or None
        Number of steps.
    stream : text stream
        Where to draw; one that is no terminal shows nothing.
    """

    def __init__(self, label: str, total: int | None, stream: TextIO) -> None:
        self._label = "".join(letter for letter in label if letter.isprintable())[:LABEL_WIDTH]
        self._total, self._done = total, 0
        self._stream, self._begun = stream, time.monotonic()
        self._ended = Event()
        self._thread = Thread(target=self._draw, daemon=True)
        if stream.isatty():
            self._thread.start()

    def advance(self, steps: int = 1) -> None:
        """Count steps that are done."""
        self._done += steps

    def close(self) -> None:
        """Take the bar away."""
        self._ended.set()
        if self._thread.ident is not None:
            self._thread.join()

    def _draw(self) -> None:
        if self._ended.wait(PATIENCE_S):
            return
        while True:
            self._stream.write(CLEAR + self._line())
            self._stream.flush()
            if self._ended.wait(REDRAWN_S):
                break
        self._stream.write(CLEAR)
        self._stream.flush()

    def _line(self) -> str:
        minutes, seconds = divmod(int(time.monotonic() - self._begun), 60)
        clock = f"{minutes}:{seconds:02d}"
        if not self._total:
            return f"{self._label} {clock}"
        full = WIDTH * min(self._done, self._total) // self._total
        return f"{self._label} {'━' * full:<{WIDTH}} {self._done}/{self._total} {clock}"


def bar_display(label: str, total: int | None) -> Bar:
    """Make a bar on standard error; a display for `flightid.progress.shown_by`."""
    return Bar(label, total, sys.stderr)
