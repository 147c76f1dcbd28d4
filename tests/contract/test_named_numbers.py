"""Limits and sizes stand in docs/numbers.md as they stand in the code: none changes unseen."""

from __future__ import annotations

from pathlib import Path

from tools.numbers_page import PAGE, numbers, page


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
