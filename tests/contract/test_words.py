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


JOINED = re.compile(r"\{[^{}]*%\}|(?<=[\d}])%(?=[ ,.;:)\"'])")
"""A percent sign without its space: of a format, or behind a number or a value of a sentence."""


def test_percent_signs_stand_apart() -> None:
    """Sentences had "99.0%" beside "93.5 %"."""
    offenders = [
        f"{path.relative_to(PACKAGE)}:{node.lineno}"
        for path in python_files()
        for node in nodes(tree(path))
        if (isinstance(node, ast.FormattedValue) and _is_percent(node))
        or (isinstance(node, ast.JoinedStr) and JOINED.search(_flat(node)))
    ]
    assert not offenders, "write f'{100.0 * share:.0f} %': " + ", ".join(offenders)


def _is_percent(node: ast.FormattedValue) -> bool:
    return node.format_spec is not None and ast.unparse(node.format_spec).rstrip("'\"").endswith(
        "%"
    )


def _flat(node: ast.JoinedStr) -> str:
    """Text of a sentence, a number in place of each value."""
    parts = (each.value if isinstance(each, ast.Constant) else "0" for each in node.values)
    return "".join(map(str, parts)) + " "


def test_a_joined_percent_sign_is_seen() -> None:
    (planted,) = ast.parse("f'{share:.0%} of them'").body
    (format_,) = (n for n in ast.walk(planted) if isinstance(n, ast.FormattedValue))
    assert _is_percent(format_)
    (planted,) = ast.parse("f'at {share}% of them'").body
    (sentence,) = (n for n in ast.walk(planted) if isinstance(n, ast.JoinedStr))
    assert JOINED.search(_flat(sentence))


def test_a_participle_is_seen() -> None:
    assert [bool(_offences(name)) for name in ("Taken", "_Staged", "LineFlown")] == [True] * 3
    assert _offences("MeasuredMotion") == ["MeasuredMotion: call it ODE model"]
    assert not any(_offences(name) for name in ("FittedRecord", "Speed", "ReferenceSpeed", "Fit"))
