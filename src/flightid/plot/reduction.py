"""Reductions: the cost and the guides along the path."""

from __future__ import annotations

from flightid.identification.reduction.result import Reduction, worst_percents
from flightid.plot import graph_objects as go
from flightid.plot import look

HEIGHT_PX = 520
FLATTENING = 10.0
"""Ratio of the highest cost to the path's from which a linear axis shows nothing of the path."""


def reduction_path(reduction: Reduction) -> go.PlotFigure:
    """Draw the average cost, and the worst insensitivity and Cramér–Rao bound, by step.

    Parameters
    ----------
    reduction : Reduction
        Result of `flightid.reduce`.

    Returns
    -------
    PlotFigure
    """
    made = look.figure(rows=2, height_px=HEIGHT_PX)
    labels = ["start", *(f"{k}  {each.name}" for k, each in enumerate(reduction.path, 1))]
    stands = [
        (0, reduction.start),
        *(
            (k, each.fit)
            for k, each in enumerate(reduction.path, 1)
            if each.accepted and each.fit is not None
        ),
    ]
    places = [k for k, _ in stands]
    made.add_trace(
        go.Scatter(
            x=places,
            y=[fit.average_cost for _, fit in stands],
            name="average cost",
            mode="lines+markers",
            line={"color": look.MODEL},
        ),
        row=1,
        col=1,
    )
    undone = [
        (k, each.cost_after)
        for k, each in enumerate(reduction.path, 1)
        if not each.accepted and each.cost_after is not None
    ]
    if undone:
        made.add_trace(
            go.Scatter(
                x=[k for k, _ in undone],
                y=[cost for _, cost in undone],
                name="undone",
                mode="markers",
                marker={"color": look.RIVAL, "symbol": "x", "size": 10},
            ),
            row=1,
            col=1,
        )
    _guides(made, reduction, stands)
    made.update_xaxes(tickmode="array", tickvals=list(range(len(labels))), ticktext=labels)
    made.update_xaxes(range=[-0.4, len(labels) - 0.6])
    made.update_xaxes(title_text="step and parameter", row=2, col=1)
    made.update_yaxes(title_text="average cost", **_cost_axis(stands, undone), row=1, col=1)
    made.update_yaxes(title_text="worst of all [%]", type="log", row=2, col=1)
    return made


def _cost_axis(stands: list, undone: list) -> dict[str, str]:  # type: ignore[type-arg]
    """From zero; in the logarithm where steps that were undone would flatten the path."""
    kept = max(fit.average_cost for _, fit in stands)
    highest = max((cost for _, cost in undone), default=kept)
    if kept > 0.0 and highest > FLATTENING * kept:
        return {"type": "log"}
    return {"rangemode": "tozero"}


def _guides(made: go.PlotFigure, reduction: Reduction, stands: list) -> None:  # type: ignore[type-arg]
    limits = reduction.limits
    curves = (
        ("insensitivity", 0, limits.maximum_insensitivity_percent, look.TRUTH, "solid"),
        ("Cramér–Rao bound", 1, limits.maximum_cramer_rao_percent, look.OTHER, "dash"),
    )
    for name, which, limit, colour, dash in curves:
        made.add_trace(
            go.Scatter(
                x=[k for k, _ in stands],
                y=[worst_percents(fit)[which] for _, fit in stands],
                name=name,
                mode="lines+markers",
                line={"color": colour, "dash": dash},
            ),
            row=2,
            col=1,
        )
        made.add_hline(
            y=limit, row=2, col=1, line={"color": colour, "dash": "dot", "width": 1}, opacity=0.7
        )
