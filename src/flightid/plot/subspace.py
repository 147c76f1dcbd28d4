"""Subspace fits: singular values and criteria over the order."""

from __future__ import annotations

import numpy as np

from flightid.identification import OrderChoice
from flightid.plot import graph_objects as go
from flightid.plot import look


def singular_values(order: OrderChoice) -> go.PlotFigure:
    """Draw singular values on a logarithmic axis and the order criteria below.

    Parameters
    ----------
    order : OrderChoice
        Of a fit's `SubspaceDetails`.

    Returns
    -------
    PlotFigure
    """
    made = look.figure(2)
    values = order.singular_values[: max(2 * len(order.svc), 2)]
    states = np.arange(1, values.size + 1)
    kept = states <= order.chosen
    for name, chosen, colour in (
        (f"{order.chosen} states kept", kept, look.MODEL),
        ("left out", ~kept, look.LINE),
    ):
        bars = go.Bar(x=states[chosen], y=values[chosen], name=name, marker={"color": colour})
        made.add_trace(bars, row=1, col=1)
    candidates = np.arange(1, len(order.svc) + 1)
    made.add_trace(
        go.Scatter(
            x=candidates,
            y=order.svc,
            name="SVC",
            mode="lines+markers",
            line={"color": look.RIVAL},
        ),
        row=2,
        col=1,
    )
    made.update_yaxes(type="log", row=1, col=1)
    look.label_axes(made, x="states", y=["singular value", "SVC"])
    made.update_layout(hovermode="closest", barmode="overlay")
    return made
