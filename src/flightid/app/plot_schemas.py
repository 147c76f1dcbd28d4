"""What the page and the server tell each other of plots: formulas of fields, layouts."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from flightid.app.schemas import Message

LAYOUT_NAME = "^[A-Za-z0-9_][A-Za-z0-9_ -]{0,59}$"
PaneSeries = Annotated[
    list[Annotated[str, Field(min_length=1, max_length=600)]], Field(min_length=1, max_length=12)
]


class FormulaUnit(Message):
    """A formula of fields that can be plotted."""

    series: str
    """What a view asks for: the formula behind an equals sign."""
    unit: str


class PlotLayout(Message):
    """Plots that stand on the screen Flight: panes, each with fields or formulas of fields."""

    name: Annotated[str, Field(pattern=LAYOUT_NAME)]
    panes: Annotated[list[PaneSeries], Field(min_length=1, max_length=40)]
