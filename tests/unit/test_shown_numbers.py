"""Numbers in words: with their ends, beside their limits, with units as a reader writes them."""

from __future__ import annotations

import math
import re

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from flightid.conventions import Light
from flightid.findings import Finding, digits_apart, held, ranged, told_apart
from flightid.plot import look
from flightid.report.content import Document, Lights, Paragraph, Section, TableBlock
from flightid.report.figures import figure_block
from flightid.report.html import to_html
from flightid.report.unit_words import in_words
from flightid.table import Column, Table

SOME = st.floats(1e-4, 1e5)


@given(SOME, SOME, SOME)
def test_a_number_and_its_ends_have_one_decimal_and_tell_the_width(
    middle: float, below: float, above: float
) -> None:
    """1.2 stood beside 1.15 to 1.25."""
    ends = (middle - below, middle + above)
    told = re.fullmatch(r"(\S+) \((\S+) to (\S+)\)", ranged(middle, ends))
    assert told is not None
    places = {len(each.partition(".")[2]) for each in told.groups() if each != "0"}
    assert len(places) == 1
    width, shown = below + above, float(told[3]) - float(told[2])
    assert abs(shown - width) <= 0.11 * width


@pytest.mark.parametrize(
    ("value", "ends", "said"),
    [
        (1.2, (1.15, 1.25), "1.20 (1.15 to 1.25)"),
        (84.2, (71.3, 98.0), "84.2 (71.3 to 98.0)"),
        (12345.0, (12000.0, 13000.0), "12300 (12000 to 13000)"),
        (0.0, (0.0, 7.48), "0 (0 to 7.48)"),
        (0.5, (0.2, math.inf), "0.5 (0.2 to inf)"),
        (3.0, (3.0, 3.0), "3"),
    ],
)
def test_numbers_with_ends_by_hand(value: float, ends: tuple[float, float], said: str) -> None:
    assert ranged(value, ends) == said


@given(st.floats(0.5, 2.0), st.floats(1e-7, 0.1), st.booleans())
def test_no_number_is_shown_on_the_other_side_of_its_limit(
    limit: float, apart: float, above: bool
) -> None:
    limit = float(f"{limit:.4g}")
    value = limit * (1.0 + apart if above else 1.0 - apart)
    assert (float(told_apart(value, limit, decimals=2)) > limit) == above
    for least in (True, False):
        digits = digits_apart(value, limit, least=least)
        shown = held(value, digits, least=least) or 0.0
        assert (shown >= limit if least else shown <= limit) == (above is least)


def test_units_of_sentences_tables_and_pictures_of_a_page_have_raised_powers() -> None:
    """Tables of the page had rad/s², its sentences and the report opened apart rad/s^2."""
    made = look.figure()
    made.add_trace(look.line("a", np.arange(3.0), np.arange(3.0), colour=look.MODEL))
    made.update_yaxes(title_text="a [m/s^2]")
    table = Table("t", (Column("K", "rad/s^2/V"),), ((1.0,),), ("in ft/s^2",))
    blocks = (
        Paragraph("3 deg/s^2"), TableBlock(table), figure_block(made, "of kg m^2"),
        Lights((Finding("a", Light.RED, "K = 20 rad/s^2", "more than 5 m/s^2"),)),
    )  # fmt: skip
    page = to_html(Document("x^2 in s^2", "", (Section("s", blocks),)), packed=False)
    page = page[: page.index('id="library"')]
    assert not re.findall(r"(?:rad|deg|m|ft)/s\^2|m\^2", page)
    for told in ("deg/s²", "rad/s²/V", "ft/s²", "rad/s²", "5 m/s²", "kg m²", "a [m/s²]"):
        assert told in page, told
    assert "x^2 in s²" in page
    assert in_words("s^20, x^2 and names^2 stay") == "s^20, x^2 and names^2 stay"
