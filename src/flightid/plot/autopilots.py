"""Pictures of an autopilot's controller: its paths over frequency, and its replay beside a log."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from flightid.control.autopilots.axis_loop import AxisLoop
from flightid.control.autopilots.replay_result import Replay
from flightid.plot import graph_objects as go
from flightid.plot import look
from flightid.plot.frequency_response import Curve, bode
from flightid.plot.record import Panel, Trace, time_histories

SHOWN_TERMS = ("P", "I", "D", "FF", "DFF")
QUIET_SHARE = 1e-6


def controller(loop: AxisLoop, omega_rad_s: NDArray[np.float64] | None = None) -> go.PlotFigure:
    """Feedback and set-point path of a controller, with the terms that make the feedback.

    Parameters
    ----------
    loop : AxisLoop
        Controller.
    omega_rad_s : ndarray, shape (n,), optional
        Frequencies, rad/s; default: three decades up to half the loop rate.

    Returns
    -------
    PlotFigure
    """
    highest = np.pi * loop.loop_rate_hz
    omega = np.geomspace(highest / 1000, highest, 400) if omega_rad_s is None else omega_rad_s
    terms, names = loop.basis(omega)
    gains = loop.gains
    curves = [
        Curve("feedback from raw gyro", omega, loop.feedback(omega), look.MODEL),
        Curve("from rate set-point", omega, loop.forward(omega), look.RIVAL, "dash"),
    ]
    colours = (look.GREEN, look.PURPLE, look.YELLOW)
    for name, term, colour in zip(names, terms, colours, strict=False):
        if gains[name] != 0:
            curves.append(Curve(name, omega, gains[name] * term, colour, "dot"))
    return bode(curves, unit=f"{loop.output_unit}/(rad/s)")


def replay(result: Replay) -> go.PlotFigure:
    """Logged and replayed output, their difference, and the terms that move.

    Parameters
    ----------
    result : Replay
        Replay of one axis.

    Returns
    -------
    PlotFigure
    """
    unit = result.loop.output_unit
    time_s = result.time_s
    panels = [_pair(result, "output", look.axis_title(f"{result.loop.axis} output", unit))]
    error = Trace("replayed minus logged", time_s, result.error, look.RIVAL)
    panels.append(Panel(look.axis_title("difference", unit), (error,)))
    largest = float(np.abs(result.logged["output"]).max())
    for name in SHOWN_TERMS:
        moves = name in result.logged and np.std(result.logged[name]) > QUIET_SHARE * largest
        if moves:
            panels.append(_pair(result, name, look.axis_title(name, unit)))
    made = time_histories(panels)
    # A difference of rounding errors reads better as 5e-8 than with a letter for nano.
    made.update_yaxes(exponentformat="e", row=2)
    return made


def _pair(result: Replay, name: str, title: str) -> Panel:
    logged = Trace("logged", result.time_s, result.logged[name], look.MEASURED)
    replayed = Trace("replayed", result.time_s, result.replayed[name], look.MODEL, "dash")
    return Panel(title, (logged, replayed))
