"""Fields of a log over time, and the gyro's noise behind filters that were tried."""

from __future__ import annotations

import numpy as np

from flightid.logs.field_plot import FieldPlot
from flightid.plot import graph_objects as go
from flightid.plot import look
from flightid.plot.record import Panel, Trace, time_histories
from flightid.review.tried_filters import TriedFilters

LEAST = 1e-12
"""(rad/s)²/Hz below which nothing is drawn."""


def field_history(plot: FieldPlot) -> go.PlotFigure:
    """Draw fields over one time: a panel for each unit.

    Parameters
    ----------
    plot : FieldPlot

    Returns
    -------
    PlotFigure

    Example
    -------
    >>> import numpy as np
    >>> from flightid.logs.field_plot import FieldSeries
    >>> line = FieldSeries("ATT.Roll", "deg", np.array([0.0, 1.0]), np.array([0.0, 2.0]))
    >>> field_history(FieldPlot((line,))).layout.yaxis.title.text
    'ATT.Roll [deg]'
    """
    panels = []
    for unit in dict.fromkeys(each.unit for each in plot.series):
        lines = [each for each in plot.series if each.unit == unit]
        colours = (look.SERIES[k % len(look.SERIES)] for k in range(len(lines)))
        traces = [
            Trace(each.name, each.time_s, each.values, colour)
            for each, colour in zip(lines, colours, strict=True)
        ]
        title = look.axis_title(", ".join(each.name for each in lines), unit)
        panels.append(Panel(title, tuple(traces)))
    return time_histories(panels)


def tried_noise(tried: TriedFilters, *, axis: str = "roll") -> go.PlotFigure:
    """Draw the gyro's noise ahead of the filters, behind the flown and behind the tried ones.

    Parameters
    ----------
    tried : TriedFilters
    axis : str

    Returns
    -------
    PlotFigure

    Example
    -------
    >>> tried_noise(tried).show()                                     # doctest: +SKIP
    """
    shown = next(each for each in tried.axes if each.axis == axis)
    made = look.figure()
    curves = (
        ("ahead of the filters", shown.ahead, look.MEASURED, "solid"),
        ("behind the flown", shown.flown, look.MEASURED, "dash"),
        ("behind the tried", shown.edited, look.MODEL, "solid"),
    )
    for name, density, colour, dash in curves:
        seen = np.where(density >= LEAST, density, np.nan)
        level = 10.0 * np.log10(seen)
        drawn = look.line(name, shown.frequency_hz, level, colour=colour, dash=dash, width=1.3)
        made.add_trace(drawn, row=1, col=1)
    look.label_axes(made, x="frequency [Hz]", y=["dB of (rad/s)²/Hz"])
    return made
