"""The content tree as one self-contained HTML page.

The page asks nothing of the network: styles, plots and plotting library are inside it, and a
content policy that names the two scripts by their hash keeps anything else from running, whatever a
log may have smuggled into a name. A table's columns are made by its result's `summary()`, not here.
"""

from __future__ import annotations

import base64
import gzip
import hashlib
import json
from collections.abc import Mapping, Sequence
from functools import cache
from importlib.resources import files
from itertools import groupby
from typing import Any

import jinja2
from markupsafe import Markup

from flightid.conventions import Light
from flightid.plot.graph_objects import plotting_library
from flightid.report.content import Document, Figure
from flightid.report.glossary import GLOSSARY, symbols_in
from flightid.report.json import to_dict
from flightid.report.shared_arrays import SharedArrays
from flightid.report.unit_words import in_words
from flightid.table import Cell, Column, Table
from flightid.version import VERSION

DEFAULT_HEIGHT_PX = 420
LONG_PAYLOAD = 2048
"""Letters of a plot above which it is compressed."""
MANY_PLOTS = 8
"""Plots of a picture above which a phone scrolls it."""
LONG_CELL = 20
"""Letters of a cell above which its column keeps its width and the table scrolls instead."""
LONG_LIST, FEW_GOOD = 5, 2
"""Verdicts of a list above which green ones open on demand, where there are more than a few."""
LONG_TABLE = 12
"""Rows of a table above which it opens on demand, in any section but the first."""
LEAST_GAP = 3
"""Empty cells at the end of a row that are joined to one."""
CLASSES = {"number": " class=n", "long": " class=l", "text": ""}
_VALUE = Column("value", digits=6)


def to_html(document: Document, *, packed: bool = True) -> str:
    """Draw a document as a page that is readable offline, with interactive plots.

    Parameters
    ----------
    document : Document
        What to say.
    packed : bool
        Compress plots and the plotting library, which alone takes 0.7 MB instead of 1.5 MB
        (browsers since 2023 unpack them).

    Returns
    -------
    str
        The whole page.
    """
    tree = to_dict(document)
    numbers = _Numbering(packed, symbols_in(tree["sections"]))
    sections = [numbers.section(section) for section in tree["sections"]]
    has_plots = any(isinstance(block, Figure) for block in document.walk())
    library = plotting_library() if has_plots else ""
    script = "\n".join(map(_resource, (["gunzip.js"] if has_plots else []) + ["page.js"]))
    hashes = [_script_hash(text) for text in ([script, library] if has_plots else [script])]
    return (
        environment()
        .get_template("page.html")
        .render(
            **{key: tree[key] for key in ("title", "subtitle", "verdict", "tally", "footer")},
            sections=sections,
            version=VERSION,
            has_plots=has_plots,
            script_sources=Markup(" ".join(f"'{value}'" for value in hashes)),
            style=Markup(_resource("page.css")),
            script=Markup(script),
            packed="gzip" if packed else "no",
            library=Markup(_packed(library) if packed else library),
            arrays=Markup(_gzipped(numbers.arrays.stored())),
        )
    )


class _Numbering:
    """Adds to plain values what the template needs: identifiers, shown cells, plot payloads."""

    def __init__(self, packed: bool, symbols: Mapping[str, str]) -> None:
        self._packed = packed
        self._symbols = symbols
        self.arrays = SharedArrays()
        self._sections = 0
        self._plots = 0
        self._first: dict[str, str] = {}

    def section(self, values: dict[str, Any]) -> dict[str, Any]:
        self._sections += 1
        opening = self._sections == 1
        return {
            **values,
            "id": f"part-{self._sections}",
            "blocks": _abreast([self._block(each, opening) for each in values["blocks"]]),
            "sections": [self.section(inner) for inner in values["sections"]],
        }

    def _block(self, values: dict[str, Any], opening: bool) -> dict[str, Any]:
        match values["kind"]:
            case "table":
                long = len(values["rows"]) > LONG_TABLE and not opening
                shown = _shown_table(values, self._symbols)
                return {**values, **shown, "folded": values["folded"] or long}
            case "lights":
                return {**values, **_sorted_lights(values["findings"], opening=opening)}
            case "key_values":
                items = [(key, _VALUE.show(value)) for key, value in values["items"]]
                return {**values, "items": items}
            case "figure":
                self._plots += 1
                spec = values["spec"]
                told = self.arrays.referred(spec) if self._packed else spec
                text = in_words(_script_json(told))
                small = self._packed and len(text) > LONG_PAYLOAD
                place = f"plot-{self._plots}"
                return {
                    **values,
                    "id": place,
                    # A picture that is shown again, as the answer's is, is stored once.
                    "spec_id": self._first.setdefault(text, place),
                    "height": int(spec.get("layout", {}).get("height") or DEFAULT_HEIGHT_PX),
                    "wide": _is_wide(spec.get("layout", {})),
                    "half": False,
                    "packed": "gzip" if small else "no",
                    "payload": Markup(_gzipped(text.encode()) if small else text),
                }
        return values


def _sorted_lights(findings: list[dict[str, Any]], *, opening: bool) -> dict[str, Any]:
    """Verdicts to read, and those that are met, which open on demand where the list is long.

    What several of a row say to do stands with the first of them, and how many it is for.
    """
    good = [each for each in findings if each["light"] == Light.GREEN]
    if opening or len(findings) <= LONG_LIST or len(good) <= FEW_GOOD:
        return {"findings": _actions_once(findings), "good": []}
    rest = [each for each in findings if each["light"] != Light.GREEN]
    return {"findings": _actions_once(rest), "good": _actions_once(good)}


def _actions_once(findings: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """Findings of which the first of a row alike in what to do says it, and for how many."""
    told: list[dict[str, Any]] = []
    for action, same in groupby(findings, key=lambda each: each["action"]):
        first, *others = same
        also = f" (the same for the next{f' {len(others)}' if len(others) > 1 else ''})"
        also = also if action and others else ""
        told += [{**first, "action": f"{action}{also}"}, *({**e, "action": ""} for e in others)]
    return told


def _abreast(blocks: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """Mark pictures of one plot that follow another such: two of them share a line."""
    small = [
        each["kind"] == "figure" and not each["folded"] and not each["wide"]
        and "xaxis2" not in each["spec"].get("layout", {})
        for each in blocks
    ]  # fmt: skip
    for place, each in enumerate(blocks):
        if small[place] and (any(small[max(place - 1, 0) : place]) or any(small[place + 1 :][:1])):
            each["half"] = True
    return blocks


def _is_wide(layout: dict[str, Any]) -> bool:
    """Whether a phone scrolls a picture: it has a width of its own, or many plots."""
    return "width" in layout or sum(name.startswith("xaxis") for name in layout) > MANY_PLOTS


def _shown_table(values: dict[str, Any], symbols: Mapping[str, str]) -> dict[str, Any]:
    columns = tuple(
        Column(column["name"], column["unit"], digits)
        for column, digits in zip(values["columns"], values["digits"], strict=True)
    )
    table = Table(values["title"], columns, tuple(map(tuple, values["rows"])))
    kinds = [_kind(table, index) for index in range(len(columns))]
    headings = [
        {
            "name": column.name,
            "unit": column.unit,
            "kind": Markup(CLASSES[kind]),
            "meaning": GLOSSARY.get(column.name) or symbols.get(column.name, ""),
        }
        for column, kind in zip(columns, kinds, strict=True)
    ]
    rows = [_joined(*both) for both in zip(table.rows, table.shown(), strict=True)]
    names = [column.name for column in columns]
    if "parameter" in names and "meaning" not in names:
        place = names.index("parameter")
        for row in rows:
            row["told"] = {place: symbols.get(row["cells"][place], "")}
    return {"columns": headings, "rows": rows}


def _joined(cells: Sequence[Cell], shown: list[str]) -> dict[str, Any]:
    """A row whose last empty cells are one, as in a triangle of correlations."""
    known = max((place for place, cell in enumerate(cells, 1) if cell is not None), default=0)
    gap = len(cells) - known if len(cells) - known >= LEAST_GAP else 0
    return {"cells": shown[: len(shown) - gap], "gap": gap, "told": {}}


def _script_json(values: object) -> str:
    """JSON that no HTML parser can leave early: ``<`` is written as an escape."""
    text = json.dumps(values, allow_nan=False, separators=(",", ":"))
    return text.replace("<", "\\u003c").replace("&", "\\u0026")


def _script_hash(text: str) -> str:
    return "sha256-" + base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()


@cache
def _packed(text: str) -> str:
    return _gzipped(text.encode())


def _gzipped(content: bytes) -> str:
    return base64.b64encode(gzip.compress(content, 9, mtime=0)).decode()


@cache
def _resource(name: str) -> str:
    return files("flightid.report").joinpath("templates", name).read_text(encoding="utf-8")


@cache
def environment() -> jinja2.Environment:
    """What draws the templates: everything that comes from a log is text."""
    made = jinja2.Environment(
        finalize=lambda each: in_words(each) if type(each) is str else each,
        loader=jinja2.FunctionLoader(_resource),
        autoescape=True,
        undefined=jinja2.StrictUndefined,
        trim_blocks=False,
    )
    made.filters["in_words"] = lambda light: Light(light).words
    return made


def _kind(table: Table, index: int) -> str:
    """How a column is set: numbers to the right, sentences with room to be read."""
    if table.is_numeric(index):
        return "number"
    longest = max((len(str(row[index])) for row in table.rows), default=0)
    return "long" if longest > LONG_CELL else "text"
