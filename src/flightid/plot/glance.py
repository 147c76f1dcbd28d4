"""A flight at a glance: throttle, modes, time in the air, and what models were made of."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from flightid.plot import graph_objects as go
from flightid.plot import look
from flightid.plot.thinning import thinned
from flightid.record import Record
from flightid.review import FlightReview

SHORTEST_NAMED = 0.05
"""Part of the flight below which a mode is shaded but not named."""
SHOWN_POINTS = 1500
NAMES_PX = 20
Used = Mapping[str, Sequence[tuple[Record, Sequence[str]]]]


def has_glance(review: FlightReview) -> bool:
    """Whether a flight tells throttle or modes to draw."""
    return review.throttle is not None or bool(review.identity.modes)


def flight_glance(review: FlightReview, used: Used | None = None) -> go.PlotFigure:
    """Draw throttle over the flight with its modes, and below it what models were made of.

    Parameters
    ----------
    review : FlightReview
    used : mapping of str to sequence of (Record, channels), optional
        Records cut from the log with the channels to draw, by what they were used for; channels of
        one unit share a plot.

    Returns
    -------
    PlotFigure
    """
    cut = [(words, *each) for words, several in (used or {}).items() for each in several]
    units = list(dict.fromkeys(record.unit(name) for _, record, names in cut for name in names))
    made = look.figure(1 + len(units), height_px=150 + 150 * (1 + len(units)))
    if review.throttle is not None:
        time_s, values = thinned(review.throttle.time_s, review.throttle.values, SHOWN_POINTS)
        made.add_trace(look.line("throttle", time_s, 100.0 * values, colour=look.BLACK, width=1.2))
    titles = ["throttle [%]"]
    for row, unit in enumerate(units, 2):
        there = [n for _, record, names in cut for n in names if record.unit(n) == unit]
        titles.append(look.axis_title(", ".join(dict.fromkeys(there)), unit))
        for place, words in enumerate(used or {}):
            for label, record, names in cut:
                for name in names if label == words else ():
                    if record.unit(name) != unit:
                        continue
                    time_s, values = thinned(record.time_s, record[name], SHOWN_POINTS)
                    drawn = look.line(
                        words, time_s, values, width=1.2, legend=False,
                        colour=look.SERIES[place % len(look.SERIES)],
                    )  # fmt: skip
                    if not any(each.name == words for each in made.data):
                        drawn["showlegend"] = True
                    made.add_trace(drawn, row=row)
    look.label_axes(made, x="time on the autopilot's clock [s]", y=titles)
    _modes(made, review)
    return made


def _modes(made: go.PlotFigure, review: FlightReview) -> None:
    """Shade the time in the air, and name modes where they begin."""
    for start_s, stop_s in review.phases.airborne:
        made.add_vrect(start_s, stop_s, row=1, fillcolor=look.AIR, line={"width": 0})
    ends = [end for each in review.identity.modes for end in (each.start_s, each.stop_s)]
    for span in review.identity.modes:
        made.add_vline(span.start_s, row=1, line={"color": look.LINE, "dash": "dot", "width": 1})
        if span.stop_s - span.start_s > SHORTEST_NAMED * float(np.ptp(ends)):
            made.add_annotation(
                row=1, text=span.mode, x=span.start_s, y=1.0, xanchor="left", yanchor="bottom",
                showarrow=False, font={"size": 11},
            )  # fmt: skip
            made.layout["annotations"][-1]["yref"] = "y domain"
    # The legend stands above the names of the modes.
    inner = made.layout["height"] - 110
    made.update_layout(legend={"y": 1.0 + NAMES_PX / inner}, margin={"t": 60})
    made.update_yaxes(rangemode="tozero", row=1)
