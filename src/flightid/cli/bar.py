"""Progress on standard error: a bar on a terminal, a line now and then in a file."""

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
FIRST_LINE_S, LINE_S, LINE_SHARE = 10.0, 30.0, 0.1
"""In a file: when the first line comes, and after how long the next, or what share of the time."""
FEWEST = 5
"""Times that work came on, below which nothing is said of the rest: workers come in step."""


class Bar:
    """One bar; appears after `PATIENCE_S` and vanishes when the work ends.

    Where there is no terminal a line is written after `FIRST_LINE_S`, and then the more seldom the
    longer the work takes.

    Parameters
    ----------
    label : str
        What is being done.
    total : int or None
        Number of steps.
    stream : text stream
        Where to draw.
    """

    def __init__(self, label: str, total: int | None, stream: TextIO) -> None:
        self._label = "".join(letter for letter in label if letter.isprintable())[:LABEL_WIDTH]
        self._total, self._done = total, 0
        self._stream, self._begun = stream, time.monotonic()
        self._came, self._first, self._first_at = 0, 0, self._begun
        self._ended = Event()
        draw = self._draw if stream.isatty() else self._tell
        self._thread = Thread(target=draw, daemon=True)
        self._thread.start()

    def advance(self, steps: int = 1) -> None:
        """Count steps that are done."""
        self._done += steps
        self._came += 1
        if self._came == 1:
            self._first, self._first_at = self._done, time.monotonic()

    def close(self) -> None:
        """Take the bar away."""
        self._ended.set()
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

    def _tell(self) -> None:
        """Whole lines, for whoever follows or keeps a file."""
        wait_s = FIRST_LINE_S
        while not self._ended.wait(wait_s):
            passed_s = time.monotonic() - self._begun
            left = self._left(time.monotonic() - self._first_at)
            said = " ".join(filter(None, (self._label, self._counted(), left)))
            try:
                self._stream.write(f"{said}\n")
                self._stream.flush()
            except (OSError, ValueError):
                return  # Nobody reads it any more; the work goes on.
            wait_s = max(LINE_S, LINE_SHARE * passed_s)

    def _line(self) -> str:
        drawn = ""
        if self._total:
            drawn = f"{'━' * (WIDTH * min(self._done, self._total) // self._total):<{WIDTH}}"
        return " ".join(filter(None, (self._label, drawn, self._counted())))

    def _counted(self) -> str:
        """Steps that are done, and the time that they took."""
        clock = _clock(time.monotonic() - self._begun)
        return f"{self._done}/{self._total} {clock}" if self._total else clock

    def _left(self, since_s: float) -> str:
        """The time that the rest takes if it goes on as since the first step.

        What came before that was start-up: counted, it made half an hour of four minutes.
        """
        since = self._done - self._first
        if not self._total or not since or self._came < FEWEST or self._done >= self._total:
            return ""
        return f"(about {_clock(since_s * (self._total - self._done) / since)} left)"


def _clock(seconds: float) -> str:
    return f"{int(seconds) // 60}:{int(seconds) % 60:02d}"


def bar_display(label: str, total: int | None) -> Bar:
    """Make a bar on standard error; a display for `flightid.progress.shown_by`."""
    return Bar(label, total, sys.stderr)
