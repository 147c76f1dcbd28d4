"""Questions that end on time: worked out in a thread, for which whoever asks waits so long."""

from __future__ import annotations

import contextlib
import threading
from collections.abc import Callable
from typing import Any

GRACE_S = 2.0
"""How long an interrupted question may take to let go, s."""


class TimedConnection:
    """A DuckDB connection that takes one question at a time and waits for none longer than told.

    DuckDB looks at an interruption between its steps alone; a step that makes one huge value goes
    on. It is left to its thread then, the connection takes no other question until it is over, and
    it closes when it is.

    Parameters
    ----------
    connection : duckdb.DuckDBPyConnection
    """

    def __init__(self, connection: Any) -> None:  # noqa: ANN401 - of a library that an extra installs
        self._connection = connection
        self._thread: threading.Thread | None = None

    @property
    def is_held(self) -> bool:
        """Whether a question that was given up is still being worked out."""
        return self._thread is not None and self._thread.is_alive()

    def work_out(self, task: Callable[[], Any], time_s: float) -> Any:  # noqa: ANN401 - what the task gives
        """What a task on the connection gives.

        Parameters
        ----------
        task : callable
        time_s : float
            Longest time for it, s.

        Raises
        ------
        TimeoutError
            It takes longer, or an earlier one that was given up is not over.
        """
        if self.is_held:
            raise TimeoutError("an earlier question, given up, is still being worked out")
        told: dict[str, Any] = {}

        def work() -> None:
            try:
                told["answer"] = task()
            except BaseException as error:  # Raised again where it is waited for.
                told["error"] = error

        thread = self._thread = threading.Thread(target=work, daemon=True)
        thread.start()
        try:
            thread.join(time_s)
        finally:
            is_late = thread.is_alive()
            if is_late:
                self._connection.interrupt()
                thread.join(GRACE_S)
        if is_late:
            raise TimeoutError(f"no answer after {time_s:g} s")
        if "error" in told:
            # Taken out first: held by its own frame, it would keep the connection alive.
            raise told.pop("error")
        return told["answer"]

    def close(self) -> None:
        """Let go of the connection, where a question holds it as soon as that is over."""
        if not self.is_held:
            self._connection.close()
            return
        held, connection = self._thread, self._connection

        def close_later() -> None:
            assert held is not None
            held.join()
            with contextlib.suppress(Exception):
                connection.close()

        threading.Thread(target=close_later, daemon=True).start()
