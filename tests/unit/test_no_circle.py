"""Commands that a log's pages name next lead on: none of them leads back to itself."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import flightid as fid
from flightid.errors import FlightidError
from flightid.inspection.carried import carried_axes
from flightid.planning.plan import plan_flight
from flightid.study.proposal import propose_study
from tests.ordinary_log import write_ordinary_log
from tests.strangers import inspected_logs

NAMED = re.compile(r"flightid (inspect|flight|tune|run|plan|advise) +(\S+)")


def _pages(path: Path) -> dict[str, str]:
    """What each command says of a log, where it does not make models or gains."""
    log = fid.read_log(path)
    made = propose_study([path], folder=path.parent, tune=True)
    try:
        planned = " ".join(map(str, plan_flight(log).findings))
    except FlightidError as error:
        planned = str(error)
    refused = "" if made.models else made.refusal()
    return {
        "inspect": fid.inspect_log(log).to_text(), "flight": fid.review_flight(log).to_text(),
        "tune": refused, "run": refused, "plan": planned,
    }  # fmt: skip


def _named(pages: Mapping[str, str], log: str) -> dict[str, set[str]]:
    """Commands of the same log that each page names."""
    words = {page: " ".join(text.split()) for page, text in pages.items()}
    return {
        page: {verb for verb, what in NAMED.findall(text) if what.startswith(log)}
        for page, text in words.items()
    }


def _circle(named: Mapping[str, set[str]], way: tuple[str, ...]) -> tuple[str, ...]:
    """A way that comes to a command twice; empty where none does."""
    if way[-1] in way[:-1]:
        return way
    ways = (_circle(named, (*way, verb)) for verb in sorted(named.get(way[-1], ())))
    return next(filter(None, ways), ())


def test_a_circle_is_found() -> None:
    pages = {"tune": "see flightid flight a.bin", "flight": "Next: flightid\n  tune a.bin (gains)"}
    named = _named(pages, "a.bin")
    assert _circle(named, ("tune",)) == ("tune", "flight", "tune")
    assert _circle(_named(pages, "b.bin"), ("tune",)) == ()


@pytest.mark.parametrize("kind", ["weak", "swept", "ordinary"])
def test_no_page_of_a_log_leads_back(kind: str, tmp_path: Path) -> None:
    path = tmp_path / f"{kind}.bin"
    if kind == "ordinary":
        write_ordinary_log(path, duration_s=20.0)
    else:
        random = np.random.default_rng([0, 1215])
        flight = inspected_logs.sound(random)
        if kind == "weak":
            change = inspected_logs.BARREN["injection within gusts"]
            flight = replace(flight, **change)  # type: ignore[arg-type]
        inspected_logs.write(flight, random, path)
    pages = _pages(path)
    named = _named(pages, path.name)
    for page in pages:
        assert _circle(named, (page,)) == (), named
    if kind == "weak":
        assert carried_axes(fid.inspect_log(path)) == ()
        assert "tune" not in named["flight"] | named["inspect"], "tune has nothing of this log"
        assert "plan" in named["tune"] & named["inspect"] & named["flight"]
