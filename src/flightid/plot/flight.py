"""Steps of closed loops from ordinary flying, axes overlaid, with their bands."""

from __future__ import annotations

import plotly.graph_objects as go

from flightid.errors import DataError
from flightid.plot import look
from flightid.review import FlightReview, LoopResponse

COLOURS = {"roll": look.BLUE, "pitch": look.ORANGE, "yaw": look.GREEN}
DASHES = {"roll": "solid", "pitch": "dash", "yaw": "dashdot"}


def flight_steps(review: FlightReview) -> go.Figure:
    """Draw the steps of all loops that a flight tells, rate loops above attitude loops.

    Parameters
    ----------
    review : FlightReview

    Returns
    -------
    plotly.graph_objects.Figure

    Raises
    ------
    DataError
        The flight tells no step.

    Example
    -------
    >>> flight_steps(fid.review_flight("flight.bin")).show()          # doctest: +SKIP
    """
    return loop_steps(*review.loops)


def loop_steps(*loops: LoopResponse) -> go.Figure:
    """Draw steps of loops with their bands.

    Parameters
    ----------
    *loops : LoopResponse

    Returns
    -------
    plotly.graph_objects.Figure

    Raises
    ------
    DataError
        None of them tells a step.

    Example
    -------
    >>> loop_steps(review["roll rate"]).show()                        # doctest: +SKIP
    """
    told = [loop for loop in loops if loop.is_told]
    if not told:
        why = {loop.reason for loop in loops if loop.reason}
        raise DataError("the flight tells no step to draw", found="; ".join(sorted(why)))
    kinds = list(dict.fromkeys(loop.loop for loop in told))
    made = look.figure(len(kinds), shared_x=False, height_px=110 + 230 * len(kinds))
    shown: set[str] = set()
    for loop in told:
        row, colour = kinds.index(loop.loop) + 1, COLOURS[loop.axis]
        made.add_traces(
            look.band(loop.axis, loop.time_s, *loop.band(), colour=colour),
            rows=row,
            cols=1,
        )
        made.add_trace(
            look.line(
                loop.axis,
                loop.time_s,
                loop.step,
                colour=colour,
                dash=DASHES[loop.axis],
                legend=loop.axis not in shown,
            ),
            row=row,
            col=1,
        )
        shown.add(loop.axis)
    look.label_axes(
        made, x="time after a step of the set-point [s]", y=[f"{k} per set-point" for k in kinds]
    )
    for row in range(1, len(kinds) + 1):
        made.add_hline(1.0, line={"color": look.LINE, "dash": "dot", "width": 1}, row=row, col=1)
    return made
