from __future__ import annotations

import pytest

from flightid.progress import progress, shown_by, track


class _Recorder:
    def __init__(self, label: str, total: int | None) -> None:
        self.label, self.total, self.steps, self.closed = label, total, 0, False

    def advance(self, steps: int = 1) -> None:
        self.steps += steps

    def close(self) -> None:
        self.closed = True


@pytest.fixture
def made() -> list[_Recorder]:
    return []


def _display(made: list[_Recorder]):
    def display(label: str, total: int | None) -> _Recorder:
        made.append(_Recorder(label, total))
        return made[-1]

    return display


def test_silent_without_a_display() -> None:
    with progress(2, "work") as advance:
        advance()
        advance(1)


def test_counts_and_closes(made: list[_Recorder]) -> None:
    with shown_by(_display(made)), progress(5, "work") as advance:
        advance()
        advance(3)
        assert not made[0].closed
    assert (made[0].label, made[0].total, made[0].steps, made[0].closed) == ("work", 5, 4, True)


def test_closes_when_interrupted(made: list[_Recorder]) -> None:
    with shown_by(_display(made)), pytest.raises(KeyboardInterrupt), progress(5, "work"):
        raise KeyboardInterrupt
    assert made[0].closed


def test_track_knows_the_length_where_there_is_one(made: list[_Recorder]) -> None:
    with shown_by(_display(made)):
        assert list(track([1, 2, 3], "list")) == [1, 2, 3]
        assert list(track(iter([1]), "iterator")) == [1]
    assert [(meter.total, meter.steps, meter.closed) for meter in made] == [
        (3, 3, True),
        (None, 1, True),
    ]


def test_the_display_is_gone_after_its_block(made: list[_Recorder]) -> None:
    with shown_by(_display(made)):
        pass
    with progress(1, "later"):
        pass
    assert made == []
