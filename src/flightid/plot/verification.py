"""Verifications: prediction beside measurement, residuals, and the mismatch envelopes."""

from __future__ import annotations

import plotly.graph_objects as go

from flightid.plot import look
from flightid.plot.record import Panel, Trace, time_histories
from flightid.validation import Mismatch, Prediction


def prediction(item: Prediction) -> go.Figure:
    """Draw the inputs, and each output as measured and as predicted.

    Parameters
    ----------
    item : Prediction
        One record of a `Verification`.

    Returns
    -------
    plotly.graph_objects.Figure
    """
    measured, predicted = item.measured, item.predicted
    time_s = measured.time_s
    panels = [
        Panel(
            look.axis_title(name, measured.unit(name)),
            (Trace("input", time_s, measured[name], look.OTHER),),
        )
        for name in predicted.inputs
    ]
    outputs = [name for name in predicted.channels if name not in predicted.inputs]
    panels += [
        Panel(
            look.axis_title(name, measured.unit(name)),
            (
                Trace("measured", time_s, measured[name], look.MEASURED),
                Trace("model", time_s, predicted[name], look.MODEL, "dash"),
            ),
        )
        for name in outputs
    ]
    return time_histories(panels)


def residuals(item: Prediction) -> go.Figure:
    """Draw measured minus predicted for each output.

    Parameters
    ----------
    item : Prediction
        One record of a `Verification`.

    Returns
    -------
    plotly.graph_objects.Figure
    """
    predicted = item.predicted
    names = [name for name in predicted.channels if name not in predicted.inputs]
    return time_histories(
        [
            Panel(
                look.axis_title(f"{name} error", predicted.unit(name)),
                (Trace("measured minus model", predicted.time_s, item.residual(name), look.RIVAL),),
            )
            for name in names
        ]
    )


def mismatch_envelopes(item: Mismatch) -> go.Figure:
    """Draw the ratio model over flight inside its envelopes.

    Parameters
    ----------
    item : Mismatch
        Result of `flightid.validation.mismatch`.

    Returns
    -------
    plotly.graph_objects.Figure
    """
    made = look.figure(2)
    bounds = item.envelopes
    rows = (
        (bounds.gain_lower_db, bounds.gain_upper_db, item.gain_db),
        (bounds.phase_lower_deg, bounds.phase_upper_deg, item.phase_deg),
    )
    for row, (low, high, ratios) in enumerate(rows, start=1):
        for edge in look.band("envelope", bounds.omega_rad_s, low, high, colour=look.TRUTH):
            made.add_trace(edge, row=row, col=1)
        for index, (name, ratio) in enumerate(zip(item.names, ratios, strict=True)):
            made.add_trace(
                look.line(
                    name,
                    bounds.omega_rad_s,
                    ratio,
                    colour=look.SERIES[index % len(look.SERIES)],
                    dash=look.DASHES[index % len(look.DASHES)],
                    legend=row == 1,
                ),
                row=row,
                col=1,
            )
    titles = ["gain model/flight [dB]", "phase model/flight [deg]"]
    look.label_axes(made, x="frequency [rad/s]", y=titles, log_x=True)
    return made
