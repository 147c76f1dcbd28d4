"""Pictures of a fleet: vehicles beside their type, and parameters over time."""

from __future__ import annotations

import datetime
from collections.abc import Mapping, Sequence

import numpy as np

from flightid.fleet.statistics.parameter_history import ParameterHistory
from flightid.fleet.statistics.population import Population
from flightid.plot import graph_objects as go
from flightid.plot import look
from flightid.uncertainty.quantiles import half_width, shown

COLUMNS = 3
ROW_PX = 190
TITLED_GAP_PX = 58
"""Between rows of panels, of which each has a title above it."""
MOST_NAMED = 8
"""Vehicles named at an axis; of more every second, third …."""


def history_picture(
    histories: Sequence[ParameterHistory], labels: Mapping[str, str] | None = None
) -> go.PlotFigure:
    """Small multiples: flights with intervals, the level behind them, when it changed.

    Parameters
    ----------
    histories : sequence of ParameterHistory
        At least one.
    labels : mapping of str to str, optional
        Parameters in words.
    """
    columns = min(COLUMNS, len(histories))
    rows = -(-len(histories) // columns)
    made = look.figure(rows, columns, shared_x=False, height_px=110 + ROW_PX * rows)
    made.update_layout(hovermode="closest", showlegend=False)
    for number, each in enumerate(histories):
        row, column = number // columns + 1, number % columns + 1
        name = (labels or {}).get(each.name, each.name)
        _history(made, each, name, row, column)
    return made


def _history(made: go.PlotFigure, each: ParameterHistory, name: str, row: int, column: int) -> None:
    at = [_date(instant) for instant in each.time_s]
    colour = look.ORANGE if each.is_alarm else look.BLUE
    half = half_width(shown()) * np.sqrt(each.variances)
    ends = each.track.ends(shown())
    made.add_traces(look.band("level", at, ends[:, 0], ends[:, 1], colour=colour), row, column)
    made.add_trace(look.line("level", at, each.track.level, colour=colour), row, column)
    points = go.Scatter(
        x=at,
        y=each.values,
        error_y={"type": "data", "array": half, "thickness": 1, "width": 0, "color": look.LINE},
        mode="markers",
        marker={"color": look.BLACK, "size": 4},
        showlegend=False,
        hovertemplate=f"{each.vehicle}<br>%{{x}}<br>{name} %{{y:.4g}}<extra></extra>",
    )
    made.add_trace(points, row, column)
    if each.is_alarm and each.changed_s is not None:
        low, high = (_date(instant) for instant in each.changed_s)
        bottom, top = float(np.min(each.values - half)), float(np.max(each.values + half))
        made.add_shape(
            row, column, type="rect", x0=low, x1=high, y0=bottom, y1=top,
            fillcolor="rgba(213,94,0,0.18)", line={"width": 0},
        )  # fmt: skip
    for event in each.happened:
        bottom, top = float(np.min(each.values - half)), float(np.max(each.values + half))
        when = _date(event.time_s)
        made.add_trace(
            go.Scatter(
                x=[when, when],
                y=[bottom, top],
                mode="lines",
                line={"color": look.PURPLE, "width": 1.5, "dash": "dot"},
                showlegend=False,
                hovertemplate=f"{event.what}<extra></extra>",
            ),
            row,
            column,
        )
    made.update_xaxes(row=row, col=column, type="date", nticks=3, tickformat="%Y-%m-%d")
    unit = "" if each.unit == "1" else each.unit
    title = look.axis_title(f"{each.vehicle}: {name}", unit)
    made.update_yaxes(row=row, col=column, title_text=title, title_font={"size": 11})


def _date(instant: float) -> str:
    return datetime.datetime.fromtimestamp(instant, datetime.UTC).strftime("%Y-%m-%d %H:%M:%S")


def type_picture(population: Population, labels: Mapping[str, str] | None = None) -> go.PlotFigure:
    """Each vehicle's own estimate in percent of the type's mean, and where the next one lies.

    Parameters
    ----------
    population : Population
    labels : mapping of str to str, optional
        Parameters in words.
    """
    names = [n for n in population.names if population.parameters[n].mean.value != 0.0]
    columns = min(COLUMNS, max(len(names), 1))
    rows = max(1, -(-len(names) // columns))
    height = 110 + (ROW_PX + TITLED_GAP_PX - look.GAP_PX) * rows
    made = look.figure(rows, columns, shared_x=False, height_px=height, gap_px=TITLED_GAP_PX)
    made.update_layout(hovermode="closest", showlegend=False)
    every = population.data.members
    apart = -(-len(every) // MOST_NAMED)
    for number, name in enumerate(names):
        row, column = number // columns + 1, number % columns + 1
        i, found = population.names.index(name), population.parameters[name]
        mean = found.mean.value
        there = [n for n, own in enumerate(population.own) if own[2][i]]
        vehicles = [population.data.members[n] for n in there]
        values = np.array([population.own[n][0][i] for n in there])
        errors = np.sqrt([population.own[n][1][i, i] for n in there])
        percent = 100.0 / abs(mean)
        # By name in every panel, so that each vehicle stands at one place.
        place = np.array(there, dtype=np.float64)
        ends = found.next_vehicle.interval(shown())
        if ends is not None:
            edge = np.array([-0.6, len(every) - 0.4])
            low, high = ((end - mean) * percent for end in ends)
            band = look.band("next", edge, np.full(2, low), np.full(2, high), colour=look.GREEN)
            made.add_traces(band, row, column)
        made.add_trace(
            go.Scatter(
                x=place,
                y=(values - mean) * percent,
                error_y={
                    "type": "data", "array": half_width(shown()) * errors * percent,
                    "thickness": 1, "width": 0, "color": look.LINE,
                },
                text=vehicles,
                mode="markers",
                marker={"color": look.BLUE, "size": 5},
                showlegend=False,
                hovertemplate="%{text}<br>%{y:.2f} %<extra></extra>",
            ),
            row,
            column,
        )  # fmt: skip
        title = "beside the mean [%]" if column == 1 else ""
        made.add_annotation(
            row, column, text=(labels or {}).get(name, name), showarrow=False, x=0.5, y=1.0,
            xanchor="center", yanchor="bottom", font={"size": 12},
        )  # fmt: skip
        # Above its own panel, wherever a narrow page puts that.
        note = made.layout["annotations"][-1]
        note.update({"xref": f"{note['xref']} domain", "yref": f"{note['yref']} domain"})
        made.update_xaxes(
            row=row,
            col=column,
            tickmode="array",
            tickvals=list(range(0, len(every), apart)),
            ticktext=every[::apart],
            range=[-0.6, len(every) - 0.4],
        )
        made.update_yaxes(row=row, col=column, title_text=title)
    return made
