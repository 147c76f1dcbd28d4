"""What `tests.stress.mutants` takes for a function's change, a statement and a moved line."""

from __future__ import annotations

from pathlib import Path

from tests.stress.mutant_forks import _cold, in_a_fork
from tests.stress.mutants import Reached, _pieces, share
from tests.stress.mutations import functions_changed, moved, statement, told

TEXT = """
LIMIT = 3


class Filter:
    order = 2

    def gain(
        self,
        times=1,
    ):
        if times > 0:
            return [x + times for x in (1,
                                        LIMIT)]
        return []
"""


def _changed(before: str, after: str) -> list[str] | None:
    codes = [compile(each, "filter.py", "exec") for each in (TEXT, TEXT.replace(before, after))]
    found = functions_changed(*codes)
    return found and [new.co_qualname for _, new in found]


def test_a_change_is_of_a_function_or_of_what_runs_on_import() -> None:
    assert _changed("x + times", "x - times") == ["Filter.gain"]
    assert _changed("times > 0", "times > 1") == ["Filter.gain"]
    for before, after in (("= 3", "= 4"), ("order = 2", "order = 1"), ("times=1", "times=2")):
        assert _changed(before, after) is None
    assert functions_changed(*[compile(TEXT, "filter.py", "exec")] * 2) == []


def test_a_statement_is_the_innermost_without_its_body() -> None:
    assert statement(TEXT, 2) == range(2, 3)
    assert statement(TEXT, 10) == range(8, 12)  # A default stands in the head.
    assert statement(TEXT, 12) == range(12, 13)
    assert statement(TEXT, 14) == range(13, 15)


def test_lines_take_their_tests_to_where_they_stand_now() -> None:
    now = TEXT.replace("LIMIT = 3\n", "# why\nLIMIT = 4\n")
    places = moved(TEXT, now)
    assert 2 not in places
    assert places[12] == 13
    found = Reached({"filter.py": {13: {"a"}, 15: {"b"}}})
    assert found.of("filter.py", statement(now, 15)) == {"b"}


def test_a_change_is_told_by_its_lines_and_a_share_by_its_interval() -> None:
    new = TEXT.replace("(1,\n", "(2,\n")
    assert told(TEXT, new) == (
        "return [x + times for x in (1,",
        "return [x + times for x in (2,",
    )
    assert share(1, 10) == "10.0 % (0.3 to 44.5) of 10"
    assert share(0, 3) == "0.0 % (0.0 to 70.8) of 3"


WAITING = """
import time

def test_waits(): time.sleep(0.3)

def test_works():
    start = time.process_time()
    while time.process_time() < start + 0.1: pass

def test_is_left(): pass
"""


def test_no_test_begins_after_so_much_of_the_processors_time(tmp_path: Path) -> None:
    """A busy machine makes tests wait: they waited 0.3 s here, and did not end for that."""
    place = tmp_path / "test_waiting.py"
    place.write_text(WAITING)
    wrong = tmp_path / "test_wrong.py"
    wrong.write_text("def test_fails(): assert False")
    for file, most_s, ended in (
        (place, 0.09, ("survived", "", 1)),
        (place, 5.0, ("survived", "", 0)),
        (wrong, 0.0, ("killed", "test_wrong.py::test_fails", 0)),
    ):
        told = in_a_fork(lambda file=file, most_s=most_s: _cold(tmp_path, [str(file)], most_s), 60)
        assert (told[0], told[1].rpartition("/")[2], told[2]) == ended


def test_tests_of_a_file_stand_together_within_a_piece_of_the_time() -> None:
    known = Reached(seconds={"a::1": 0.1, "b::1": 0.1, "a::2": 0.1, "a::3": 2.0, "b::2": 3.0})
    every = ["a::3", "a::2", "a::1", "b::2", "b::1"]
    assert _pieces([*known.seconds], every, known, 1.0) == ["a::2", "a::1", "b::1", "a::3", "b::2"]
