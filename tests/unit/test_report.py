"""The content tree and its three faces."""

from __future__ import annotations

import base64
import gzip
import hashlib
import json
import re
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from flightid.conventions import Light
from flightid.errors import FileFormatError
from flightid.findings import Finding
from flightid.plot import look
from flightid.report.content import (
    Document,
    Figure,
    KeyValues,
    Lights,
    Paragraph,
    Section,
    TableBlock,
)
from flightid.report.figures import figure_block
from flightid.report.html import to_html
from flightid.report.json import from_dict, to_dict
from flightid.report.text import to_text
from flightid.table import Column, Table
from flightid.wrapping import wrapped
from tests.closeness import assert_close

VOID = {"meta", "br", "img", "link", "hr", "input"}
HOSTILE = "</script><img src=x onerror=alert(1)>\x1b[2J\"'&"


def _document(text: str = "Roll rate") -> Document:
    made = look.figure()
    made.add_trace(look.line(text, np.arange(3.0), np.array([1.0, 2.5, 4.0]), colour=look.MODEL))
    table = Table(text, (Column(text), Column("value", "1/s")), ((text, 1.23456789), ("b", None)))
    lights = tuple(Finding("code", light, f"{text} {light}", text) for light in Light)
    return Document(
        text,
        text,
        (
            Section(
                text,
                (
                    Paragraph(text),
                    Lights(lights, text),
                    Lights(()),
                    TableBlock(table),
                    figure_block(made, text),
                    figure_block(made, text, folded=True),
                ),
                (Section("Below", (TableBlock(table, folded=True), KeyValues(((text, 0.5),)))),),
            ),
        ),
        text,
    )


class _Structure(HTMLParser):
    """Collects tags, text and attributes, and checks that tags close in order."""

    def __init__(self) -> None:
        super().__init__(convert_charrefs=True)
        self.open: list[str] = []
        self.attributes: list[tuple[str, str, str]] = []
        self.identifiers: list[str] = []
        self.scripts: list[tuple[dict[str, str | None], str]] = []
        self.text: list[str] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        for key, value in attrs:
            self.attributes.append((tag, key, value or ""))
            if key == "id":
                self.identifiers.append(value or "")
        if tag == "script":
            self.scripts.append((dict(attrs), ""))
        if tag not in VOID:
            self.open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        assert self.open, f"</{tag}> closes nothing"
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        if self.open and self.open[-1] == "script":
            attributes, before = self.scripts[-1]
            self.scripts[-1] = (attributes, before + data)
        elif self.open and self.open[-1] != "style":
            self.text.append(data)


def _parsed(page: str) -> _Structure:
    parser = _Structure()
    parser.feed(page)
    parser.close()
    assert parser.open == []
    return parser


def test_page_is_well_formed_and_asks_nothing_of_the_network() -> None:
    parser = _parsed(to_html(_document()))
    assert len(parser.identifiers) == len(set(parser.identifiers))
    asking = {"src", "srcset", "action", "data", "poster", "background"}
    assert not [item for item in parser.attributes if item[1] in asking]
    assert all(value.startswith("#") for _, key, value in parser.attributes if key == "href")
    targets = {value[1:] for _, key, value in parser.attributes if key == "href"}
    assert targets <= set(parser.identifiers)


def test_policy_names_the_two_scripts_by_hash_and_nothing_else() -> None:
    page = to_html(_document())
    parser = _parsed(page)
    policy = next(value for _, key, value in parser.attributes if "script-src" in value)
    allowed = re.findall(r"sha256-[A-Za-z0-9+/=]+", policy)
    code = [text for attributes, text in parser.scripts if "type" not in attributes]
    packed = next(text for attributes, text in parser.scripts if attributes.get("id") == "library")
    sources = [*code, gzip.decompress(base64.b64decode(packed)).decode()]
    hashes = [
        "sha256-" + base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()
        for text in sources
    ]
    assert sorted(allowed) == sorted(hashes)
    assert "default-src 'none'" in policy
    assert "unsafe-eval" not in policy


def test_unpacked_page_holds_the_same_library() -> None:
    parser = _parsed(to_html(_document(), packed=False))
    library = next(text for attributes, text in parser.scripts if attributes.get("id") == "library")
    policy = next(value for _, _, value in parser.attributes if "script-src" in value)
    digest = base64.b64encode(hashlib.sha256(library.encode()).digest()).decode()
    assert f"sha256-{digest}" in policy


def test_page_without_plots_carries_no_library() -> None:
    page = to_html(Document("Short", "", (Section("Part", (Paragraph("text"),)),)))
    assert len(page) < 40_000
    assert "noscript" not in page


def test_hostile_strings_stay_text() -> None:
    document = _document(HOSTILE)
    parser = _parsed(to_html(document))
    assert not [item for item in parser.attributes if item[1].startswith("on")]
    assert "img" not in {tag for tag, _, _ in parser.attributes}
    assert sum("<img src=x onerror=alert(1)>" in text for text in parser.text) >= 8
    payload = next(text for attributes, text in parser.scripts if "data-plot" in attributes)
    assert json.loads(payload)["data"][0]["name"] == HOSTILE


def test_terminal_is_not_steered_by_a_log() -> None:
    assert "\x1b" not in to_text(_document(HOSTILE))


@given(st.text(max_size=60))
def test_any_text_survives_html_and_json(text: str) -> None:
    document = Document(text, text, (Section(text, (Paragraph(text),)),))
    _parsed(to_html(document))
    assert from_dict(json.loads(json.dumps(to_dict(document)))) == document


def test_json_holds_the_whole_tree() -> None:
    document = _document()
    assert from_dict(json.loads(json.dumps(to_dict(document), allow_nan=False))) == document


def test_text_html_and_json_show_the_same_numbers() -> None:
    document = _document()
    values = to_dict(document)
    cells = values["sections"][0]["blocks"][3]["rows"]
    assert cells[0][1] == 1.23456789
    shown = "1.235"
    assert shown in to_text(document)
    assert shown in "".join(_parsed(to_html(document)).text)
    assert values["tally"] == "1 green, 1 amber, 1 red, 1 not judged"
    for face in (to_text(document), to_html(document)):
        assert values["tally"] in face
    # The class of a style keeps the word of scripts; what is read is one word for one state.
    assert '<span class="word">not judged</span>' in to_html(document)
    assert '<span class="word">unknown</span>' not in to_html(document)


def test_verdict_is_the_worst_light() -> None:
    assert _document().verdict is Light.RED
    assert Document("x", "", ()).verdict is Light.GREEN
    assert Document("x", "", ()).tally == ""


def test_figures_are_kept_as_finely_as_a_screen_shows() -> None:
    made = look.figure()
    values = np.append(1e-6, np.linspace(0, 1, 1000) / 3)
    made.add_trace(look.line("a", values, values, colour=look.MODEL))
    spec = figure_block(made, "caption").spec
    packed = spec["data"][0]["x"]
    assert packed["dtype"] == "f4"
    kept = np.frombuffer(base64.b64decode(packed["bdata"]), "<f4")
    assert_close(kept, values, atol=0.5 / 3 / 2048, why="half a step of the curve's range")
    assert_close(kept[0], 1e-6, rtol=0.5 / 1024, why="and of a small number, for logarithmic axes")


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"schema": "other/1"}, "not a report: found other/1"),
        ({"sections": [{"title": "x"}]}, "do not fit together: found KeyError"),
        ({"sections": 3}, "do not fit together: found TypeError"),
        (
            {"sections": [{"title": "x", "blocks": [{"kind": "x"}], "sections": []}]},
            "there is no block of kind 'x'",
        ),
        (
            {
                "sections": [
                    {
                        "title": "x",
                        "blocks": [{"kind": "key_values", "title": "", "items": [["a", []]]}],
                        "sections": [],
                    }
                ]
            },
            "a cell holds list",
        ),
    ],
)
def test_a_strangers_values_are_checked(change: dict[str, object], said: str) -> None:
    with pytest.raises(FileFormatError, match=re.escape(said)):
        from_dict({**to_dict(_document()), **change})


def test_long_plots_are_compressed_and_hold_the_same_values() -> None:
    long = {"data": [{"type": "scatter", "y": list(range(5000)), "name": "y"}], "layout": {}}
    page = Document("Long", "", (Section("Plot", (Figure(long, "long"),)),))
    attributes, text = next(
        pair for pair in _parsed(to_html(page)).scripts if "data-plot" in pair[0]
    )
    assert attributes["data-packed"] == "gzip"
    assert json.loads(gzip.decompress(base64.b64decode(text))) == long
    plain = next(p for p in _parsed(to_html(page, packed=False)).scripts if "data-plot" in p[0])
    assert json.loads(plain[1]) == long


def test_a_plot_shown_twice_is_stored_once() -> None:
    drawn = Figure({"data": [{"type": "scatter", "y": [1, 2]}], "layout": {}}, "answer")
    samples = np.array([0.1, -3.0, np.nan, *range(20)], "<f4")
    held = {"dtype": "f4", "bdata": base64.b64encode(samples.tobytes()).decode()}
    other = Figure({"data": [{"type": "scatter", "x": held, "y": held}], "layout": {}}, "other")
    parts = (Section("Result", (drawn,)), Section("Roll", (other, replace(drawn, caption="again"))))
    page = to_html(Document("Twice", "", parts))
    assert sum("data-plot" in attributes for attributes, _ in _parsed(page).scripts) == 2
    assert re.findall(r'id="(plot-\d)" data-spec="(plot-\d)"', page) == [
        ("plot-1", "plot-1"), ("plot-2", "plot-2"), ("plot-3", "plot-1"),
    ]  # fmt: skip
    assert page.count('"stored":[0,92]') == 2
    packed = next(
        text for attributes, text in _parsed(page).scripts if attributes.get("id") == "arrays"
    )
    ranks = np.frombuffer(gzip.decompress(base64.b64decode(packed)), np.uint8).reshape(4, -1)
    steps = np.ascontiguousarray(ranks.T).view("<u4").ravel()
    assert np.cumsum(steps, dtype="<u4").tobytes() == samples.tobytes()


def test_commands_stay_on_one_line_and_wide_pictures_scroll() -> None:
    """What is to be typed can be copied; a phone scrolls a diagram with a width of its own."""
    command = "flightid compare before.BIN B --gains gains.param --level 0.9"
    text = f"gains of roll keep their margins at the worst vehicle: {command} says what changed"
    for width in range(20, 100, 7):
        lines = wrapped(f"{text}; flightid run rig.csv: then look.", width, later="  ")
        assert [each.count(command) for each in lines].count(1) == 1
        assert any("flightid run rig.csv:" in each for each in lines)
        assert " ".join(each.strip() for each in lines).startswith(text)
        assert all(len(each) <= width or "flightid" in each for each in lines)
    specs = [{"data": [], "layout": {**size, "height": 200}} for size in ({"width": 900}, {})]
    section = Section("Loops", tuple(Figure(spec, "drawn") for spec in specs))
    assert to_html(Document("Title", "", (section,))).count('class="wide"') == 1


def test_headings_tell_their_meaning_on_hover() -> None:
    table = Table("Fits", (Column("average cost"), Column("model")), ((1.0, "roll"),))
    page = to_html(Document("Glossary", "", (Section("Fits", (TableBlock(table),)),)))
    assert page.count("<abbr title=") == 1
    # A symbol that one table explains is explained wherever it stands, in headings and in rows.
    told = Table(
        "Parameters",
        (Column("parameter"), Column("value"), Column("meaning")),
        (("T_m", 0.045, "time constant of the motor"), ("Lp", -3.4, "")),
    )
    later = Table("All", (Column("parameter"), Column("T_m")), (("T_m", 1.0), ("Lp", 0.3)))
    inner = Section("Roll rate", (TableBlock(later),))
    whole = Document("t", "", (Section("Result", (TableBlock(told),), (inner,)),))
    said = '<abbr title="time constant of the motor">T_m</abbr>'
    assert to_html(whole).count(said) == 2
    assert to_html(whole).count("<abbr title=") == 2
    assert "How far a model lies from the measured responses" in page


def test_long_tables_fold_after_the_answer_and_small_pictures_stand_two_abreast() -> None:
    rows = tuple((f"parameter {n}", float(n)) for n in range(21))
    table = TableBlock(Table("Long", (Column("name"), Column("value")), rows))
    short = TableBlock(Table("Short", (Column("name"), Column("value")), rows[:12]))
    one = Figure({"data": [], "layout": {"xaxis": {}, "yaxis": {}}}, "one plot")
    two = Figure({"data": [], "layout": {"xaxis": {}, "xaxis2": {}}}, "two plots")
    answer = Section("Result", (table,))
    page = to_html(Document("T", "", (answer, Section("More", (table, short, one, two, one, one)))))
    assert page.count("<caption>Long</caption>") == page.count("<summary>Long</summary>") == 1
    assert page.count("<caption>Short</caption>") == 1
    assert page.count('class="half"') == 2, "the first stands alone: what follows has two plots"
    assert page.count("<td class=n>") == 21 + 21 + 12


def test_what_is_met_opens_on_demand_in_a_long_list_and_actions_stand_once() -> None:
    bad = [Finding("a", Light.AMBER, f"amber {n}", "fly a sweep") for n in range(3)]
    good = [Finding("b", Light.GREEN, f"green {n}") for n in range(4)]
    lists = (Lights((*good, *bad)), Lights((*good, bad[0])))
    page = to_html(Document("T", "", (Section("Result", lists), Section("More", lists))))
    assert page.count("<summary>4 met: green</summary>") == 1, "of the long list below the answer"
    assert [page.count(f"green {n}") for n in range(4)] == [4] * 4
    assert page.count("fly a sweep") == 4, "once in each list"
    assert page.count("fly a sweep (the same for the next 2)") == 2, "and for how many it is"
    told = page[page.index('id="part-2"') :]
    assert told.index("amber 0") < told.index("4 met: green") < told.index("green 0")


def test_lines_of_dark_pages_are_told_apart_by_lightness() -> None:
    """Measured and model lay 1.6 to 1 apart, which neither grey paper nor every eye parts."""
    root = Path(__file__).parents[2]
    pages = ("src/flightid/report/templates/page.js", "app/src/parts/Chart.svelte")
    for page in (root / each for each in pages):
        text = page.read_text("utf-8")
        shades = [
            re.search(rf'"{each}", "(#[0-9a-f]{{6}})"', text) for each in (look.BLACK, look.BLUE)
        ]
        measured, model = (_luminance(each[1]) for each in shades if each is not None)
        assert (measured + 0.05) / (model + 0.05) >= 3.0
        assert (model + 0.05) / (_luminance("#15191c") + 0.05) >= 4.5


def _luminance(colour: str) -> float:
    """Relative luminance, WCAG 2.2."""
    shares = [int(colour[at : at + 2], 16) / 255.0 for at in (1, 3, 5)]
    linear = [s / 12.92 if s <= 0.04045 else ((s + 0.055) / 1.055) ** 2.4 for s in shares]
    return sum(w * s for w, s in zip((0.2126, 0.7152, 0.0722), linear, strict=True))
