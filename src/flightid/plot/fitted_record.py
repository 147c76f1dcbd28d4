"""Time-domain fits: model beside measurement, and residuals, record by record."""

from __future__ import annotations

import numpy as np

from flightid.identification import FittedRecord
from flightid.plot import graph_objects as go
from flightid.plot import look
from flightid.plot.record import Panel, Trace, time_histories


def record_figure(item: FittedRecord, *, residuals: bool = True) -> go.PlotFigure:
    """Draw the inputs, and each output as measured and as the fitted model gives it.

    Parameters
    ----------
    item : FittedRecord
        One record of a `Fit`.
    residuals : bool
        Draw measured minus model below each output.

    Returns
    -------
    PlotFigure
    """
    measured, modelled = item.measured, item.modelled
    time_s = measured.time_s
    panels = [
        Panel(
            look.axis_title(name, measured.unit(name)),
            (Trace("input", time_s, measured[name], look.OTHER),),
        )
        for name in modelled.inputs
        if np.ptp(measured[name]) > 0
    ]
    for name in item.outputs:
        unit = measured.unit(name)
        drawn = (
            Trace("measured", time_s, measured[name], look.MEASURED),
            Trace("model", time_s, modelled[name], look.MODEL, "dash"),
        )
        panels.append(Panel(look.axis_title(name, unit), drawn))
        if residuals:
            left = Trace("measured minus model", time_s, item.residual(name), look.RIVAL)
            panels.append(Panel(look.axis_title(f"{name} error", unit), (left,)))
    return time_histories(panels)
