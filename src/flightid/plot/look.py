"""The shared look of all pictures: colours, fonts, axes, and bands of uncertainty."""

from __future__ import annotations

import math
from functools import lru_cache
from typing import TYPE_CHECKING, Any

from flightid.plot import graph_objects as go

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import ArrayLike

BLACK = "#3a3f44"
ORANGE = "#d55e00"
SKY = "#56b4e9"
GREEN = "#009e73"
YELLOW = "#e69f00"
BLUE = "#0072b2"
PURPLE = "#cc79a7"
"""Okabe and Ito's colours (Color Universal Design, 2008), black softened."""

MEASURED, MODEL, RIVAL, TRUTH, OTHER = BLACK, BLUE, ORANGE, GREEN, PURPLE
SERIES = (BLUE, ORANGE, GREEN, PURPLE, YELLOW, SKY, BLACK)
DASHES = ("solid", "dash", "dot", "dashdot", "longdash", "longdashdot", "solid")
FONT = "system-ui, -apple-system, 'Segoe UI', Roboto, 'Helvetica Neue', Arial, sans-serif"
GRID = "rgba(128,128,128,0.22)"
LINE = "rgba(128,128,128,0.65)"
AIR = "rgba(86,180,233,0.13)"
GREYED = "rgba(128,128,128,0.2)"
BAND_OPACITY = 0.16
# 1, 2 and 5 of each decade, whole: the library's own labels drop the zeros of 20 and 50.
LOG_TICKS = [digit * 10.0**decade for decade in range(-5, 6) for digit in (1, 2, 5)]
LOG_LABELS = [f"{tick:g}" for tick in LOG_TICKS]
ROW_HEIGHT_PX = 170
GAP_PX = 36
"""Between plots whose x axes have numbers of their own."""
MARGIN_PX = 130
HERTZ_PX, ABOVE_HERTZ_PX = 90, 42
"""Margin of a figure with an axis in hertz above it, and where in it the legend begins."""


def axis_title(quantity: str, unit: str = "") -> str:
    """Title of an axis.

    Example
    -------
    >>> axis_title("roll rate", "rad/s"), axis_title("az", "m/s^2"), axis_title("coherence")
    ('roll rate [rad/s]', 'az [m/s²]', 'coherence')
    """
    shown = unit.replace("^2", "²").replace("^3", "³")
    return f"{quantity} [{shown}]" if unit and unit != "1" else quantity


def figure(
    rows: int = 1,
    columns: int = 1,
    *,
    title: str = "",
    row_heights: Sequence[float] | None = None,
    column_titles: Sequence[str] | None = None,
    shared_x: bool = True,
    height_px: int | None = None,
    gap_px: int = GAP_PX,
) -> go.PlotFigure:
    """Empty figure in the shared look, with a grid of plots that share their x axes by column.

    Parameters
    ----------
    rows, columns : int
        Number of plots.
    title : str
        Title of the whole; a report writes it as a caption instead.
    row_heights : sequence of float, optional
        Relative heights.
    column_titles : sequence of str, optional
        One above each column.
    shared_x : bool
        Zooming one plot zooms those above and below.
    height_px : int, optional
        Height; default: by the number of rows.
    gap_px : int
        Between rows whose x axes have numbers of their own; a title between them takes more.

    Returns
    -------
    PlotFigure
    """
    height = height_px or MARGIN_PX + ROW_HEIGHT_PX * rows
    heights, titles = tuple(row_heights or ()), tuple(column_titles or ())
    return _empty(rows, columns, title, heights, titles, shared_x, height, gap_px).copied()


@lru_cache(maxsize=64)
def _empty(
    rows: int,
    columns: int,
    title: str,
    heights: tuple[float, ...],
    titles: tuple[str, ...],
    shared_x: bool,
    height: int,
    gap_px: int,
) -> go.PlotFigure:
    """What figures of one form are copies of: a copy costs a fiftieth of a figure."""
    free = 0.07 if shared_x else min(0.5, gap_px * (rows - 1) / (height - 90))
    made = go.PlotFigure(
        rows,
        columns,
        row_heights=heights or None,
        column_titles=titles,
        shared_x=shared_x,
        between_rows=free,
    )
    made.update_layout(
        title={"text": title} if title else {},
        font={"family": FONT, "size": 13},
        height=height,
        margin={"l": 70, "r": 20, "t": 60 if title else 40, "b": 50},
        plot_bgcolor="rgba(0,0,0,0)",
        paper_bgcolor="rgba(0,0,0,0)",
        legend={"orientation": "h", "y": 1.02, "yanchor": "bottom", "x": 0.0},
        hovermode="x unified",
        colorway=list(SERIES),
    )
    box: dict[str, Any] = {"showline": True, "linecolor": LINE, "mirror": True, "gridcolor": GRID}
    # Units stand in the titles: a letter for micro behind a number would be a second one.
    box["exponentformat"] = "power"
    made.update_xaxes(zeroline=False, ticks="outside", tickcolor=LINE, **box)
    made.update_yaxes(zeroline=False, ticks="outside", tickcolor=LINE, title_standoff=6, **box)
    return made


def label_axes(
    made: go.PlotFigure, *, x: str, y: Sequence[str], column: int = 1, log_x: bool = False
) -> None:
    """Title the axes of one column; only the lowest x axis carries the title, and numbers.

    Parameters
    ----------
    made : PlotFigure
        Figure of `figure`.
    x : str
        Title of the shared x axis.
    y : sequence of str
        Titles of the y axes, top to bottom.
    column : int
        Column, from 1.
    log_x : bool
        Logarithmic frequency axis.
    """
    # Axes are set one by one: `update_xaxes` takes ten times as long as the rest of a picture.
    for title, axis in zip(y, made.select_yaxes(col=column), strict=False):
        axis.title.text = title
    below = list(made.select_xaxes(col=column))
    for axis in below if log_x else ():
        axis.type, axis.tickvals, axis.ticktext = "log", LOG_TICKS, LOG_LABELS
        axis.minor.showgrid, axis.tickfont.size = False, 11
    lowest = below[len(y) - 1]
    lowest.title.text, lowest.showticklabels = x, True


def hertz_above(made: go.PlotFigure) -> None:
    """Put an axis in hertz above the uppermost plot, whose own frequencies are in rad/s."""
    ticks = [2.0 * math.pi * tick for tick in LOG_TICKS]
    made.layout.xaxis99 = {
        "overlaying": "x", "matches": "x", "side": "top", "type": "log", "tickvals": ticks,
        "ticktext": LOG_LABELS, "tickfont": {"size": 11}, "ticks": "outside", "tickcolor": LINE,
        "showgrid": False, "anchor": "y",
        "title": {"text": "frequency [Hz]", "standoff": 4, "font": {"size": 11}},
    }  # fmt: skip
    # An axis without a series is not drawn: it takes the last line of its plot.
    next(each for each in reversed(made.data) if each["xaxis"] == "x")["xaxis"] = "x99"
    inner_px = made.layout.height - HERTZ_PX - made.layout.margin["b"]
    made.update_layout(margin={"t": HERTZ_PX}, legend={"y": 1.0 + ABOVE_HERTZ_PX / inner_px})


def line(
    name: str,
    x: ArrayLike,
    y: ArrayLike,
    *,
    colour: str,
    dash: str = "solid",
    width: float = 1.8,
    legend: bool = True,
    hover: str | None = None,
) -> go.Node:
    """Line of one series; series of one `name` share a legend entry and hide together."""
    return go.Scatter(
        x=x,
        y=y,
        name=name,
        legendgroup=name,
        showlegend=legend,
        mode="lines",
        line={"color": colour, "dash": dash, "width": width},
        hovertemplate=hover,
    )


def band(
    name: str, x: ArrayLike, low: ArrayLike, high: ArrayLike, *, colour: str
) -> tuple[go.Node, go.Node]:
    """Shaded band between two curves (its lower edge, then its upper edge with the fill).

    Parameters
    ----------
    name : str
        Series it belongs to; it hides with that series.
    x, low, high : array_like, shape (n,)
        Abscissa and the two edges.
    colour : str
        Colour as ``#rrggbb``.

    Returns
    -------
    tuple of Node
    """
    red, green, blue = (int(colour[i : i + 2], 16) for i in (1, 3, 5))
    edge: dict[str, Any] = {
        "x": x,
        "legendgroup": name,
        "showlegend": False,
        "hoverinfo": "skip",
        "mode": "lines",
        "line": {"width": 0},
    }
    fill = f"rgba({red},{green},{blue},{BAND_OPACITY})"
    return (go.Scatter(y=low, **edge), go.Scatter(y=high, fill="tonexty", fillcolor=fill, **edge))
