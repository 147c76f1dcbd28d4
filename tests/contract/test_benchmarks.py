"""`make bench` runs every module that returns a table, and no program of its own."""

from __future__ import annotations

from benchmarks.__main__ import topics

from tests.contract.source import ROOT


def test_topics_are_the_modules_that_return_a_table() -> None:
    modules = {path.stem: path.read_text("utf-8") for path in (ROOT / "benchmarks").glob("*.py")}
    tables = {name for name, text in modules.items() if "\ndef run(" in text}
    assert set(topics()) == tables
    assert {"verbs", "responses"} <= tables
    assert not {"app_demo", "__main__"} & tables, "they open windows or have no table"
