"""Time histories, thinned so that a page stays small and no peak is lost."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from flightid.frozen import dataclass
from flightid.plot import graph_objects as go
from flightid.plot import look
from flightid.plot.thinning import thinned

MAXIMUM_POINTS = 3000
SMOOTH_POINTS = 300
ONE_COLUMN = 7
"""Most panels that stand below each other; more stand in two columns."""


@dataclass(frozen=True, eq=False)
class Trace:
    """One signal over time.

    Attributes
    ----------
    name : str
        Name in the legend.
    time_s : ndarray, shape (n_samples,)
        Stamps, s.
    samples : ndarray, shape (n_samples,)
        Values, in the panel's unit.
    colour, dash : str
        Look of the line.

    Example
    -------
    >>> Trace("p", np.array([0.0, 0.1]), np.array([0.0, 0.2])).dash
    'solid'
    """

    name: str
    time_s: NDArray[np.float64]
    samples: NDArray[np.float64]
    colour: str = look.MEASURED
    dash: str = "solid"


@dataclass(frozen=True, eq=False)
class Panel:
    """One plot of several signals with one unit.

    Attributes
    ----------
    title : str
        Title of its y axis, unit included.
    traces : tuple of Trace
        Signals.

    Example
    -------
    >>> Panel("p [rad/s]", ()).title
    'p [rad/s]'
    """

    title: str
    traces: tuple[Trace, ...]


def time_histories(panels: Sequence[Panel]) -> go.PlotFigure:
    """Draw panels over one time axis: below each other, many of them in two columns.

    Parameters
    ----------
    panels : sequence of Panel
        Top to bottom.

    Returns
    -------
    PlotFigure

    Example
    -------
    >>> trace = Trace("p", np.array([0.0, 0.1]), np.array([0.0, 0.2]))
    >>> len(time_histories([Panel("p [rad/s]", (trace,))]).data)
    1
    """
    columns = 2 if len(panels) > ONE_COLUMN else 1
    made = look.figure(-(-len(panels) // columns), columns)
    named: set[str] = set()
    for place, panel in enumerate(panels):
        for trace in panel.traces:
            time_s, samples = thinned(trace.time_s, trace.samples, MAXIMUM_POINTS)
            made.add_trace(
                look.line(
                    trace.name,
                    time_s,
                    samples,
                    colour=trace.colour,
                    dash=trace.dash,
                    width=1.3,
                    legend=trace.name not in named,
                ),
                row=place // columns + 1,
                col=place % columns + 1,
            )
            named.add(trace.name)
    for axes in (made.select_xaxes, made.select_yaxes):
        for axis in list(axes())[len(panels) :]:
            axis.visible = False
    for column in range(columns):
        titles = [panel.title for panel in panels[column::columns]]
        look.label_axes(made, x="time [s]", y=titles, column=column + 1)
    return made


def sparse(n: int) -> slice:
    """Every so many points of a smooth curve of n, as many as a screen can tell apart."""
    return slice(None, None, max(1, n // SMOOTH_POINTS))
