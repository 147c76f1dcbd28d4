"""Cross-validation of black-box models: inputs, measured and predicted output of a record."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import plotly.graph_objects as go

from flightid.plot import look
from flightid.plot.record import Panel, Trace, time_histories
from flightid.validation import CrossRun

STYLES = ((look.MODEL, "dash"), (look.ORANGE, "dot"), (look.PURPLE, "dashdot"))


def cross_runs(runs: Sequence[CrossRun]) -> go.Figure:
    """Draw inputs, and the output as measured and as each run predicts it.

    Parameters
    ----------
    runs : sequence of CrossRun
        Of one record.

    Returns
    -------
    plotly.graph_objects.Figure
    """
    first = runs[0]
    record, output = first.record, first.output
    panels = [
        Panel(
            look.axis_title(name, record.unit(name)),
            (Trace("input", record.time_s, record[name], look.OTHER),),
        )
        for name in record.inputs
        if np.ptp(record[name]) > 0
    ]
    drawn = [Trace("measured", record.time_s, record[output], look.MEASURED)]
    drawn += [
        Trace(f"{run.model}, {run.horizon}", record.time_s, run.predicted, *style)
        for run, style in zip(runs, STYLES, strict=False)
    ]
    panels.append(Panel(look.axis_title(output, record.unit(output)), tuple(drawn)))
    errors = [
        Trace(f"{run.model}, {run.horizon}", *_error(run), *style)
        for run, style in zip(runs, STYLES, strict=False)
    ]
    panels.append(Panel(look.axis_title(f"{output} error", record.unit(output)), tuple(errors)))
    return time_histories(panels)


def _error(run: CrossRun) -> tuple[np.ndarray, np.ndarray]:
    measured, predicted = run.scored
    return run.record.time_s[run.start :], measured - predicted
