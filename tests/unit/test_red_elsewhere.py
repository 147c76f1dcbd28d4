"""A page whose models are amber says at its head what else is red."""

from __future__ import annotations

from flightid.conventions import Light
from flightid.findings import Finding
from flightid.report.content import Lights, Section
from flightid.study.elsewhere import red_elsewhere


def _section(*names: str) -> Section:
    reds = tuple(Finding("margin", Light.RED, name, "lower it") for name in names)
    return Section("Loop", (Lights((*reds, Finding("fine", Light.GREEN, "fine"))),))


def test_red_reasons_are_named_by_their_section_and_the_rest_counted() -> None:
    amber, red = (Finding("answer", light, "models") for light in (Light.AMBER, Light.RED))
    deep = Section("Gains", (), (_section("a", "b", "c", "d", "e"),))
    told = red_elsewhere([amber], [deep])
    assert [each.message for each in told] == [
        *("Loop: a", "Loop: b", "Loop: c"),
        "2 more red reasons below",
    ]
    assert red_elsewhere([amber], [_section("a")])[0].action == "lower it"
    assert red_elsewhere([red], [deep]) == ()
    repeated = Section("Loop", (Lights((red,), repeats=True),))
    assert red_elsewhere([amber], [repeated]) == ()
