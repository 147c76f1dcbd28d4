"""What a flight tells: steps of closed loops, axes overlaid, and noise of the gyroscope."""

from __future__ import annotations

import math

import numpy as np

from flightid.errors import DataError
from flightid.plot import graph_objects as go
from flightid.plot import look
from flightid.review import FlightComparison, FlightReview, GyroNoise, LoopResponse

COLOURS = {"roll": look.BLUE, "pitch": look.ORANGE, "yaw": look.GREEN}
DASHES = {"roll": "solid", "pitch": "dash", "yaw": "dashdot"}


def flight_steps(review: FlightReview) -> go.PlotFigure:
    """Draw the steps of all loops that a flight tells, rate loops above attitude loops.

    Parameters
    ----------
    review : FlightReview

    Returns
    -------
    PlotFigure

    Raises
    ------
    DataError
        The flight tells no step.

    Example
    -------
    >>> flight_steps(fid.review_flight("flight.bin")).show()          # doctest: +SKIP
    """
    return loop_steps(*review.loops)


def loop_steps(*loops: LoopResponse) -> go.PlotFigure:
    """Draw steps of loops with their bands.

    Parameters
    ----------
    *loops : LoopResponse

    Returns
    -------
    PlotFigure

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


def compared_steps(result: FlightComparison) -> go.PlotFigure:
    """Draw the steps of two flights, or of a promise and a flight, one panel a loop.

    Parameters
    ----------
    result : FlightComparison

    Returns
    -------
    PlotFigure

    Example
    -------
    >>> compared_steps(fid.compare_flights("a.BIN", "b.BIN")).show()   # doctest: +SKIP
    """
    later = {loop.name: loop for loop in result.after}
    pairs = [(loop, later[loop.name]) for loop in result.before if loop.name in later]
    pairs = [pair for pair in pairs if pair[0].is_told and pair[1].is_told]
    made = look.figure(len(pairs), shared_x=False, height_px=110 + 190 * len(pairs))
    names = ("promised", "flown") if result.promised else result.names
    for row, pair in enumerate(pairs, start=1):
        end_s = min(loop.time_s[-1] for loop in pair)
        for name, loop, colour, dash in zip(
            names, pair, (look.ORANGE, look.BLUE), ("dash", "solid"), strict=True
        ):
            kept = loop.time_s <= end_s
            low, high = (edge[kept] for edge in loop.band())
            band = look.band(name, loop.time_s[kept], low, high, colour=colour)
            made.add_traces(band, rows=row, cols=1)
            line = look.line(
                name, loop.time_s[kept], loop.step[kept], colour=colour, dash=dash, legend=row == 1
            )
            made.add_trace(line, row=row, col=1)
    titles = [pair[0].name for pair in pairs]
    look.label_axes(made, x="time after a step of the set-point [s]", y=titles)
    return made


def gyro_spectrum(noise: GyroNoise) -> go.PlotFigure:
    """Draw the spectrum of a gyroscope with its bands, and below it against throttle.

    Parameters
    ----------
    noise : GyroNoise

    Returns
    -------
    PlotFigure

    Raises
    ------
    DataError
        The log holds no spectrum.

    Example
    -------
    >>> gyro_spectrum(fid.review_flight("flight.bin").noise).show()   # doctest: +SKIP
    """
    if not noise.is_told:
        raise DataError("there is no spectrum to draw", found=noise.reason)
    # One bin of throttle has no height: there is nothing to see across it.
    bins = noise.throttle.size > 1
    made = look.figure(2 if bins else 1, shared_x=True, height_px=560 if bins else 340)
    edges = noise.band()
    for place, (axis, colour) in enumerate(COLOURS.items()):
        low, middle, high = (
            math.degrees(1.0) * np.sqrt(curves[place])
            for curves in (edges[0], noise.spectrum, edges[1])
        )
        made.add_traces(look.band(axis, noise.frequency_hz, low, high, colour=colour), 1, 1)
        drawn = look.line(
            axis, noise.frequency_hz, middle, colour=colour, dash=DASHES[axis], width=1.3
        )
        made.add_trace(drawn, row=1, col=1)
    titles = ["deg/s per root Hz"]
    if bins:
        levels = 10.0 * np.log10(np.maximum(noise.by_throttle, np.finfo(float).tiny))
        heat = go.Heatmap(
            x=noise.frequency_hz,
            y=100.0 * noise.throttle,
            z=levels - np.median(levels),
            colorscale="Viridis",
            colorbar={"title": {"text": "dB"}, "len": 0.42, "y": 0.2},
        )
        made.add_trace(heat, row=2, col=1)
        titles.append("throttle [%]")
    look.label_axes(made, x="frequency [Hz]", y=titles)
    made.update_yaxes(type="log", row=1, col=1)
    return made
