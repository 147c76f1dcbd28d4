"""Words of the design: classes are nouns for what they hold, and the field's own words."""

from __future__ import annotations

import ast
import re

from tests.contract.source import PACKAGE, nodes, python_files, tree

PARTICIPLES = frozenset(
    {"Beside", "Chosen", "Cut", "Drawn", "Flown", "Found", "Given", "Held", "Kept", "Known", "Left"}
    | {"Made", "Met", "Said", "Shown", "Split", "Taken", "Unknown", "Written"}
)
NOUNS = {"Feed", "Need", "Seed", "Speed"}
# What nobody in the field would search for -> what they call it.
FOREIGN = {
    "Motion": "ODE model",
    "Room": "slack",
    "Tangent": "sensitivity",
    "Walk": "trajectory",
    "Promise": "worst case",
}


def _offences(name: str) -> list[str]:
    *_, last = re.findall(r"[A-Z][a-z0-9]*", name) or [name]
    if last in PARTICIPLES or (last.endswith("ed") and last not in NOUNS):
        return [f"{name}: a participle; name what it holds"]
    return [f"{name}: call it {FOREIGN[last]}"] if last in FOREIGN else []


def test_classes_are_nouns_for_what_they_hold() -> None:
    offenders = [
        f"{path.relative_to(PACKAGE)}:{node.lineno}: {line}"
        for path in python_files()
        for node in tree(path).body
        if isinstance(node, ast.ClassDef)
        for line in _offences(node.name)
    ]
    assert not offenders, "\n".join(offenders)


def _classes() -> dict[str, list[str]]:
    homes: dict[str, list[str]] = {}
    for path in python_files():
        for node in nodes(tree(path)):
            if isinstance(node, ast.ClassDef):
                homes.setdefault(node.name, []).append(f"{path.relative_to(PACKAGE)}:{node.lineno}")
    return homes


def _shared(homes: dict[str, list[str]]) -> list[str]:
    return [f"{name}: {', '.join(places)}" for name, places in homes.items() if len(places) > 1]


def test_no_two_classes_share_a_name() -> None:
    homes = _classes()
    assert "Fit" in homes
    offenders = _shared(homes)
    assert not offenders, "\n".join(offenders)


def test_a_shared_name_is_seen() -> None:
    assert _shared({"Fit": ["fit.py:1", "trim.py:9"], "Log": ["log.py:3"]}) == [
        "Fit: fit.py:1, trim.py:9"
    ]


def test_a_participle_is_seen() -> None:
    assert [bool(_offences(name)) for name in ("Taken", "_Staged", "LineFlown")] == [True] * 3
    assert _offences("MeasuredMotion") == ["MeasuredMotion: call it ODE model"]
    assert not any(_offences(name) for name in ("FittedRecord", "Speed", "ReferenceSpeed", "Fit"))
