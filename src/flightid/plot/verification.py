"""Verifications: predictions beside measurement, residuals, and the mismatch envelopes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from flightid.errors import UnknownNameError
from flightid.plot import graph_objects as go
from flightid.plot import look
from flightid.plot.record import Panel, Trace, time_histories
from flightid.validation import Comparison, Mismatch, Prediction

RIVALS = (look.ORANGE, look.PURPLE, look.SKY, look.YELLOW)
Models = Mapping[str, Prediction]


def prediction(item: Prediction) -> go.PlotFigure:
    """Draw the inputs, and each output as measured and as predicted.

    Parameters
    ----------
    item : Prediction
        One record of a `Verification`.

    Returns
    -------
    PlotFigure
    """
    return _predictions({"model": item})


def comparison(item: Comparison, record: int = 0) -> go.PlotFigure:
    """Draw the inputs, and each output as measured and as every model predicts it.

    Parameters
    ----------
    item : Comparison
        Several models on the same records.
    record : int
        Which record, from 0.

    Returns
    -------
    PlotFigure
    """
    return _predictions(
        {name: each.predictions[record] for name, each in item.verifications.items()}
    )


def _predictions(models: Models) -> go.PlotFigure:
    first = next(iter(models.values()))
    measured, inputs = first.measured, first.predicted.inputs
    time_s = measured.time_s
    panels = [
        Panel(
            look.axis_title(name, measured.unit(name)),
            (Trace("input", time_s, measured[name], look.OTHER),),
        )
        for name in inputs
        if np.ptp(measured[name]) > 0
    ]
    for name in (each for each in first.predicted.channels if each not in inputs):
        drawn = [Trace("measured", time_s, measured[name], look.MEASURED)]
        drawn += [
            Trace(label, time_s, each.predicted[name], *_style(place))
            for place, (label, each) in enumerate(models.items())
        ]
        panels.append(Panel(look.axis_title(name, measured.unit(name)), tuple(drawn)))
    return time_histories(panels)


def _style(place: int) -> tuple[str, str]:
    """Colour and dash of a model: the first in blue, rivals in their own colours."""
    if place == 0:
        return look.MODEL, "dash"
    return RIVALS[(place - 1) % len(RIVALS)], look.DASHES[(place + 1) % len(look.DASHES)]


def residuals(item: Prediction) -> go.PlotFigure:
    """Draw measured minus predicted for each output.

    Parameters
    ----------
    item : Prediction
        One record of a `Verification`.

    Returns
    -------
    PlotFigure
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


def mismatch_envelopes(item: Mismatch, name: str | None = None) -> go.PlotFigure:
    """Draw the ratio model over flight inside its envelopes.

    Parameters
    ----------
    item : Mismatch
        Result of `flightid.validation.mismatch`.
    name : str, optional
        One pair ``"output/input"``; default: all of them.

    Returns
    -------
    PlotFigure

    Raises
    ------
    UnknownNameError
        There is no such pair.
    """
    drawn = item.names if name is None else (name,)
    styles = [
        (look.SERIES[place % len(look.SERIES)], look.DASHES[place % len(look.DASHES)])
        for place in range(len(drawn))
    ]
    return _envelopes([(each, item, each) for each in drawn], styles)


def mismatch_comparison(items: Mapping[str, Mismatch], name: str) -> go.PlotFigure:
    """Draw one pair's ratio model over flight for several models inside the envelopes.

    Parameters
    ----------
    items : mapping of str to Mismatch
        By name of the model; the first is the one on trial.
    name : str
        Pair ``"output/input"`` that every model has.

    Returns
    -------
    PlotFigure

    Raises
    ------
    UnknownNameError
        A model has no such pair.
    """
    styles = [_style(place) for place in range(len(items))]
    return _envelopes([(label, each, name) for label, each in items.items()], styles)


def _envelopes(
    drawn: Sequence[tuple[str, Mismatch, str]], styles: Sequence[tuple[str, str]]
) -> go.PlotFigure:
    """Ratios by label, where coherence carries a judgement of them."""
    bounds = drawn[0][1].envelopes
    made = look.figure(2)
    limits = (
        (bounds.gain_lower_db, bounds.gain_upper_db),
        (bounds.phase_lower_deg, bounds.phase_upper_deg),
    )
    for row, (low, high) in enumerate(limits, start=1):
        for edge in look.band("envelope", bounds.omega_rad_s, low, high, colour=look.TRUTH):
            made.add_trace(edge, row=row, col=1)
        for (label, item, pair), (colour, dash) in zip(drawn, styles, strict=True):
            place = _place(item, pair)
            seen = item.judged[place]
            made.add_trace(
                look.line(
                    label,
                    item.envelopes.omega_rad_s[seen],
                    (item.gain_db, item.phase_deg)[row - 1][place][seen],
                    colour=colour,
                    dash=dash,
                    legend=row == 1,
                ),
                row=row,
                col=1,
            )
    titles = ["gain model/flight [dB]", "phase model/flight [deg]"]
    look.label_axes(made, x="frequency [rad/s]", y=titles, log_x=True)
    return made


def _place(item: Mismatch, pair: str) -> int:
    if pair not in item.names:
        raise UnknownNameError("there is no such pair", found=pair, needed=", ".join(item.names))
    return item.names.index(pair)
