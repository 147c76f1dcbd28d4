"""A progress bar on standard error, for work that takes longer than a second."""

from __future__ import annotations

from threading import Timer

from rich.console import Console
from rich.progress import BarColumn, Progress, SpinnerColumn, TextColumn, TimeElapsedColumn

PATIENCE_S = 1.0
"""Work shorter than this shows nothing."""


class Bar:
    """One bar; appears after `PATIENCE_S` and vanishes when the work ends.

    Parameters
    ----------
    label : str
        What is being done.
    total : int or None
        Number of steps.
    console : rich.console.Console
        Where to draw; a console that is no terminal shows nothing.
    """

    def __init__(self, label: str, total: int | None, console: Console) -> None:
        self._live = Progress(
            SpinnerColumn(),
            TextColumn("{task.description}", markup=False),
            BarColumn(),
            TextColumn("{task.completed}/{task.total}" if total else ""),
            TimeElapsedColumn(),
            console=console,
            transient=True,
            disable=not console.is_terminal,
        )
        self._task = self._live.add_task(label, total=total)
        self._timer = Timer(PATIENCE_S, self._live.start)
        self._timer.daemon = True
        self._timer.start()

    def advance(self, steps: int = 1) -> None:
        """Count steps that are done."""
        self._live.advance(self._task, steps)

    def close(self) -> None:
        """Take the bar away."""
        self._timer.cancel()
        self._timer.join()
        self._live.stop()


def bar_display(label: str, total: int | None) -> Bar:
    """Make a bar on standard error; a display for `flightid.progress.shown_by`."""
    return Bar(label, total, Console(stderr=True))
