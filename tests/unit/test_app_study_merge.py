"""Two versions of one study: what differs, and both together where nothing of one is lost."""

from __future__ import annotations

import pytest

pytest.importorskip("fastapi", reason="the extra app is not installed")

from flightid.app.study_edits import KeyEdit
from flightid.app.study_merge import MOST_LINES, merge_studies, merged_lines, shown_lines

BASE = '[study]\nseed = 0\nstarts = 4\n\n[[model]]\nname = "Roll"\n\n[[model]]\nname = "Pitch"\n'


def _mine(value: int) -> str:
    return BASE.replace("starts = 4", f"starts = {value}")


def test_changes_of_neighbouring_lines_are_taken_together() -> None:
    told = merge_studies(BASE, _mine(5), BASE.replace("seed = 0", "seed = 2"))
    assert told.merged == BASE.replace("seed = 0", "seed = 2").replace("starts = 4", "starts = 5")
    marked = [(each.side, each.text) for each in told.lines if each.side in ("theirs", "mine")]
    assert sorted(marked) == [
        ("mine", "seed = 0"),
        ("mine", "starts = 5"),
        ("theirs", "seed = 2"),
        ("theirs", "starts = 4"),
    ]


@pytest.mark.parametrize(
    ("mine", "theirs"),
    [
        (_mine(5), _mine(6)),  # one line
        (_mine(5), BASE.replace("starts = 4\n", "")),  # taken out there
        (BASE + "# a\n", BASE + "# b\n"),  # two insertions at one place
        (BASE.replace("seed = 0", "seed = 0\ntitle = 'a'"), BASE.replace("starts", "title")),
    ],
)
def test_changes_that_touch_are_not_merged(mine: str, theirs: str) -> None:
    told = merge_studies(BASE, mine, theirs)
    assert told.merged is None
    assert "same lines" in told.why
    assert any(each.side == "mine" for each in told.lines)


def test_lines_that_are_no_study_together_are_not_merged() -> None:
    mine = BASE.replace("seed = 0", "seed = 0\ntitle = 'a'")
    theirs = BASE.replace("starts = 4\n", "starts = 4\ntitle = 'b'\n")
    told = merge_studies(BASE, mine, theirs)
    assert told.merged is None
    assert "no TOML" in told.why


def test_the_same_change_of_both_and_a_change_of_one_are_whole() -> None:
    assert merged_lines(BASE, _mine(5), _mine(5)) == _mine(5)
    assert merged_lines(BASE, BASE, _mine(5)) == _mine(5)
    assert merged_lines(BASE, _mine(5), BASE) == _mine(5)
    both = _mine(5).replace("seed = 0", "seed = 1")
    assert merged_lines(BASE, both, _mine(5)) == both


def test_keys_are_taken_together_at_one_place_but_not_over_another_value() -> None:
    key = ("model", 0, "response", "n_omega")
    edit = [KeyEdit(("model", 0, "response", "minimum_coherence"), 0.7)]
    theirs = BASE.replace('name = "Roll"\n', 'name = "Roll"\nresponse = {n_omega = 31}\n')
    told = merge_studies(BASE, BASE, theirs, edit)
    assert "n_omega = 31" in str(told.merged)
    assert "minimum_coherence = 0.7" in str(told.merged)
    assert "n_omega" not in told.mine
    over = merge_studies(BASE, BASE, theirs, [KeyEdit(key, 33)])
    assert over.merged is None
    assert "same keys" in over.why
    # A model before it: the number of the path is another model's now.
    moved = BASE.replace('[[model]]\nname = "Roll"', '[[model]]\nname = "Yaw"', 1)
    assert merge_studies(BASE, BASE, moved, edit).merged is None


def test_texts_too_long_to_compare_are_left_whole() -> None:
    long = "\n".join(f"# {k}" for k in range(MOST_LINES + 1))
    assert merged_lines(long, long + "\n# mine", "# theirs\n" + long) is None
    assert shown_lines(long, long + "\n# mine") == []
