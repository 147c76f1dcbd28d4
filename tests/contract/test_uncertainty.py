"""Quantiles, estimates and their carrying-on have one home each."""

from __future__ import annotations

import re
from pathlib import Path

import flightid

SOURCE = Path(flightid.__file__).parent
HOME = SOURCE / "uncertainty" / "quantiles.py"
QUANTILES = re.compile(
    r"(?<![\w.])(1\.96\d*|1\.959\d*|2\.576|2\.5758\d*|1\.645|1\.6448\d*)(?![\w.])"
    r"|\b(norm|t)\.(ppf|isf|interval)\b|\bstdtrit\b|\bndtri\b|NormalDist|NORMAL_95|erfinv"
)
WORDS = (
    *("1.96", "1.959", "2.57", "1.64", ".ppf", ".isf", ".interval", "stdtrit"),
    *("ndtri", "NormalDist", "NORMAL_95", "erfinv"),
)  # worth a look by the expression, which is slow
HAND_MADE = re.compile(r"^    (interval95|stderr)\w*: ", re.MULTILINE)
MADE_IN = "estimate.py"
OTHERWISE = {
    "control/margins/margins.py",  # curves over frequency
    "conditioning/align.py",  # the slope of one phase, in samples
    "excitation/plan.py",  # three expected errors of a flight that is not yet flown
    "identification/narx/details.py",
}


def test_quantiles_stand_in_one_file() -> None:
    offenders = []
    for path in sorted(SOURCE.rglob("*.py")):
        if path == HOME:
            continue
        text = path.read_text("utf-8")
        if not any(word in text for word in WORDS):
            continue
        for match in QUANTILES.finditer(text):
            number = text.count("\n", 0, match.start()) + 1
            offenders.append(f"{path.relative_to(SOURCE)}:{number}: {match[0]}")
    assert not offenders, "take half_width(level, freedom) of uncertainty/quantiles.py"


def test_a_quantile_elsewhere_is_seen() -> None:
    for planted in (
        *("1.96", "1.9600", "1.95996", "2.576", "2.5758", "1.645", "1.64485", "norm.ppf", "t.isf"),
        *("t.interval", "stdtrit(", "ndtri(", "NormalDist", "NORMAL_95", "erfinv"),
    ):
        assert QUANTILES.search(f"x = 2 * {planted}")
        assert any(word in planted for word in WORDS)


def test_no_result_keeps_an_interval_of_its_own() -> None:
    offenders = [
        str(path.relative_to(SOURCE))
        for path in sorted(SOURCE.rglob("*.py"))
        if path.name != MADE_IN
        and str(path.relative_to(SOURCE)) not in OTHERWISE
        and HAND_MADE.search(path.read_text())
    ]
    assert not offenders, "hold an Estimate instead of a standard error or interval beside a value"


LITERAL = re.compile(r"Column\([^)]*\b9[59] %")
METHOD = re.compile(r"    def (\w+)\(self([^)]*)\)(.*?)(?=\n    def |\n\n\n|\Z)", re.DOTALL)
SPEAKS = re.compile(r"\b(interval_words|estimate_table)\(")
OF_STUDIES = "study/"  # a page has one level


def _without_level(text: str) -> list[str]:
    """Methods that print intervals and take no level; what they call is told it."""
    return [
        found[1]
        for found in METHOD.finditer(text)
        if SPEAKS.search(found[3]) and "level" not in found[2]
    ]


def test_tables_with_intervals_take_a_level() -> None:
    offenders = []
    for path in sorted(SOURCE.rglob("*.py")):
        place, text = str(path.relative_to(SOURCE)), path.read_text()
        if LITERAL.search(text) and not place.startswith(OF_STUDIES):
            offenders.append(f"{place}: a column at a level that nobody can choose")
        offenders += [f"{place}: {name} takes no level" for name in _without_level(text)]
    assert not offenders, "\n".join(offenders)
    assert LITERAL.search('Column("frequency, 95 %")')
    assert _without_level("    def table(self) -> Table:\n        estimate_table(x)") == ["table"]
