"""What page and server tell each other of plots: formulas, layouts, filters tried on noise."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from flightid.app.gain_schemas import GainFile
from flightid.app.schemas import Message, ShownFinding

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


class FilterValue(Message):
    """A parameter of a filter: as flown, and as it is tried."""

    name: str
    flown: float
    known: bool
    """Whether the log tells it; else it is what firmware takes."""
    value: float


class FilterAxis(Message):
    """What the filters make of the noise of one axis; spectra in dB of 1 (rad/s)² per Hz."""

    axis: str
    ahead: list[float | None]
    flown: list[float | None]
    edited: list[float | None]
    phase_flown_deg: float
    phase_edited_deg: float
    noise_flown_percent: float
    noise_edited_percent: float
    stages: list[str]


class FilterScreen(Message):
    """Filters of a vehicle on the noise of its flight."""

    values: list[FilterValue]
    refused: dict[str, str]
    """Why a value of the study is not tried, by its name; all others are."""
    highest: float
    """Largest value that a filter may have; the least is 0."""
    suggested: dict[str, float]
    at_hz: float
    measured: bool
    raw: bool
    """Whether the noise was logged ahead of the filters."""
    seen_hz: float
    """Up to where the log shows noise, half of its rate."""
    frequency_hz: list[float]
    axes: list[FilterAxis]
    findings: list[ShownFinding]
    """What they cost; a red one leaves no files."""
    files: list[GainFile]
    """To set what is tried, and the way back; none where nothing differs."""
    python: str


class FilterRequest(Message):
    """Filters to try, by the autopilot's names; the others stay as flown."""

    values: dict[str, float] = Field(default_factory=dict, max_length=64)
