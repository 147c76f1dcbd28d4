"""Limits and sizes stand in docs/numbers.md as they stand in the code: none changes unseen."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from pathlib import Path

from tools.numbers_page import AREAS, PAGE, ROOT, numbers, page

ELSEWHERE = {
    "TOPICS": "test_foreign_numbers.py and the log of sdlog2 in test_sdlog2.py",
    "KINDS": "words beside names of fields",
    "WORDS": "of signs",
    "NOISE": "words beside a name of a field",
}
"""Tables that are no limits, and no tables of foreign numbers."""


def test_the_page_of_named_numbers_is_that_of_the_code() -> None:
    assert PAGE.read_text(encoding="utf-8") == page(), "run: python tools/numbers_page.py --write"


def test_numbers_with_words_beside_them_are_told(tmp_path: Path) -> None:
    planted = tmp_path / "limits.py"
    planted.write_text(
        'LIMIT_S = 2.5\n"""Longest\ngap, s."""\nFEW, MANY = 3, 1 << 4\n"""Samples."""\nBARE = 7\n'
        'NAME = "x"\n"""No number."""\nFAST = Threshold(10, "Hz", "argued")\n'
        'SHARE: float = Threshold(0.5, "1", "half")\n'
    )
    assert list(numbers(planted)) == [
        ("LIMIT_S", "2.5", "Longest gap, s."),
        ("FEW, MANY", "3, 1 << 4", "Samples."),
        ("FAST", "10 Hz", "argued"),
        ("SHARE", "0.5", "half"),
    ]


def test_every_number_of_a_module_has_a_sentence_or_is_told_a_second_time() -> None:
    again = Path(__file__).parent / "test_foreign_numbers.py"
    foreign = set(re.findall(r"\w+", again.read_text(encoding="utf-8")))
    bare = [
        f"{path.relative_to(ROOT)}: {name}"
        for area in AREAS
        for path in sorted((ROOT / "src/flightid" / area).rglob("*.py"))
        for name in _bare(path)
        if name not in foreign and name not in ELSEWHERE
    ]
    assert not bare, f"say in a sentence below what it is: {bare}"


def test_a_number_without_a_sentence_is_found(tmp_path: Path) -> None:
    planted = tmp_path / "limits.py"
    planted.write_text('LIMIT_S = 2.5\n"""Longest gap, s."""\nBARE = {"a": 7}\nWORD = "x"\n')
    assert list(_bare(planted)) == ["BARE"]


def _bare(path: Path) -> Iterator[str]:
    """Names of numbers, and of tables of them, that the page does not tell."""
    told = {name for names, _, _ in numbers(path) for name in names.split(", ")}
    for each in ast.parse(path.read_text(encoding="utf-8")).body:
        if isinstance(each, ast.Assign | ast.AnnAssign) and each.value:
            target = each.targets[0] if isinstance(each, ast.Assign) else each.target
            names = ast.unparse(target).strip("()").split(", ")
            parts = (p for p in ast.walk(each.value) if isinstance(p, ast.Constant))
            if any(type(part.value) in (int, float) for part in parts) and names[0] not in told:
                yield names[0]
