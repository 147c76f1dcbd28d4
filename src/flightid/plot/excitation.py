"""Designed inputs: over time, over frequency, and what a plan expects of them."""

from __future__ import annotations

import numpy as np

from flightid.excitation import Excitation, Plan
from flightid.excitation.excitation import COVERAGE_LEVEL_DB
from flightid.excitation.plan import LEAST_COHERENCE
from flightid.plot import graph_objects as go
from flightid.plot import look
from flightid.plot.record import Panel, Trace, time_histories


def excitation_history(excitation: Excitation) -> go.PlotFigure:
    """Draw each input over time, one panel each.

    Parameters
    ----------
    excitation : Excitation
        What would be flown.

    Returns
    -------
    PlotFigure
    """
    return time_histories(
        [
            Panel(
                look.axis_title(name, excitation.unit),
                (Trace(name, excitation.time_s, samples, _colour(index), _dash(index)),),
            )
            for index, (name, samples) in enumerate(excitation.by_name.items())
        ]
    )


def plan_spectrum(plan: Plan) -> go.PlotFigure:
    """Draw the spectra of a plan with the coherence and random error that it expects.

    Parameters
    ----------
    plan : Plan
        What would be flown, and on what.

    Returns
    -------
    PlotFigure
    """
    made = look.figure(3)
    _add_spectrum(made, plan.excitation, plan.band_rad_s)
    for index, axis in enumerate(plan.axes):
        for row, values in ((2, axis.coherence), (3, 100 * axis.random_error)):
            made.add_trace(
                look.line(
                    axis.name,
                    plan.omega_rad_s,
                    values,
                    colour=_colour(index),
                    dash=_dash(index),
                    legend=False,
                ),
                row=row,
                col=1,
            )
    made.add_hline(y=LEAST_COHERENCE, line={"dash": "dot", "color": look.LINE}, row=2, col=1)
    made.update_yaxes(range=[0, 1.05], row=2, col=1)
    made.update_yaxes(type="log", row=3, col=1)
    titles = ["power below peak [dB]", "expected coherence", "expected error [%]"]
    look.label_axes(made, x="frequency [rad/s]", y=titles, log_x=True)
    return made


def _add_spectrum(made: go.PlotFigure, excitation: Excitation, band: tuple[float, float]) -> None:
    spectrum = excitation.smoothed_spectrum()
    floor = np.finfo(np.float64).tiny
    for index, (name, density) in enumerate(zip(spectrum.names, spectrum.density, strict=True)):
        level = 10 * np.log10(np.maximum(density / np.max(density), floor))
        shown = level > 4 * COVERAGE_LEVEL_DB
        made.add_trace(
            look.line(
                name,
                spectrum.omega_rad_s[shown],
                level[shown],
                colour=_colour(index),
                dash=_dash(index),
            ),
            row=1,
            col=1,
        )
    made.add_vrect(
        x0=band[0], x1=band[1], fillcolor=look.GREEN, opacity=0.08, line_width=0, row=1, col=1
    )
    made.add_hline(y=COVERAGE_LEVEL_DB, line={"dash": "dot", "color": look.LINE}, row=1, col=1)


def _colour(index: int) -> str:
    return look.SERIES[index % len(look.SERIES)]


def _dash(index: int) -> str:
    return look.DASHES[index % len(look.DASHES)]
