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
        for number, line in enumerate(path.read_text().splitlines(), 1):
            if QUANTILES.search(line):
                offenders.append(f"{path.relative_to(SOURCE)}:{number}: {line.strip()}")
    assert not offenders, "take half_width(level, freedom) of uncertainty/quantiles.py"


def test_no_result_keeps_an_interval_of_its_own() -> None:
    offenders = [
        str(path.relative_to(SOURCE))
        for path in sorted(SOURCE.rglob("*.py"))
        if path.name != MADE_IN
        and str(path.relative_to(SOURCE)) not in OTHERWISE
        and HAND_MADE.search(path.read_text())
    ]
    assert not offenders, "hold an Estimate instead of a standard error or interval beside a value"
