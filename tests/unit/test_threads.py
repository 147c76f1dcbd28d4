"""Verbs called from Python hold the linear-algebra libraries to one thread, and give it back."""

from __future__ import annotations

from threading import Thread

import pytest
import scipy.linalg
from threadpoolctl import threadpool_info, threadpool_limits

from flightid.threads import LINEAR_ALGEBRA, on_one_thread


def threads() -> set[int]:
    """Threads of each library for linear algebra that is loaded."""
    assert scipy.linalg.lapack
    return {each["num_threads"] for each in threadpool_info() if each["user_api"] == "blas"}


def test_a_verb_has_one_thread_and_what_held_before_holds_after_it(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    for name in LINEAR_ALGEBRA:
        monkeypatch.delenv(name, raising=False)

    @on_one_thread
    def verb(inner: bool = True) -> set[int]:
        return on_one_thread(verb)(inner=False) if inner else threads()

    @on_one_thread
    def beside_another() -> set[int]:
        other = Thread(target=verb)
        other.start()
        other.join()
        return threads()

    with threadpool_limits(2, user_api="blas"):
        assert verb() == {1}
        assert threads() == {2}
        with pytest.raises(ZeroDivisionError):
            on_one_thread(lambda: 1 // 0)()
        assert threads() == {2}
        assert beside_another() == {1}, "the other's end does not take this one's limit off"
        assert threads() == {2}
        monkeypatch.setenv(LINEAR_ALGEBRA[0], "2")
        assert verb() == {2}, "a number that the surroundings ask for is kept"
