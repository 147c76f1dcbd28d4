"""Fits: the model beside the measured response, and estimates with their intervals."""

from __future__ import annotations

from collections.abc import Sequence

from flightid.errors import UnknownNameError
from flightid.frozen import dataclass
from flightid.identification import Fit, FittedResponse
from flightid.plot import graph_objects as go
from flightid.plot import look
from flightid.plot.frequency_response import Curve, bode
from flightid.uncertainty.quantiles import interval_words, shown

ROW_PX = 34
FRAME_PX = 130


@dataclass(frozen=True)
class EstimateBar:
    """One parameter as it is drawn.

    Attributes
    ----------
    name : str
        Parameter and model.
    value, low, high : float
        Estimate and its 95 % interval, any unit.
    truth : float or None
        True value where it is known.

    Example
    -------
    >>> EstimateBar("Lp", -4.0, -4.2, -3.8).truth is None
    True
    """

    name: str
    value: float
    low: float
    high: float
    truth: float | None = None


def parameter_intervals(
    estimates: Sequence[EstimateBar], *, name: str = "estimate"
) -> go.PlotFigure:
    """Draw 95 % intervals in percent of the reference: the truth where known, else the estimate.

    Where the truth is zero, departures from it are in percent of the estimate.

    Parameters
    ----------
    estimates : sequence of EstimateBar
        Top to bottom.
    name : str
        Name in the legend.

    Returns
    -------
    PlotFigure

    Example
    -------
    >>> len(parameter_intervals([EstimateBar("Lp", -4.0, -4.2, -3.8, truth=-4.1)]).data)
    2
    """
    made = look.figure(height_px=FRAME_PX + ROW_PX * len(estimates))
    scaled = [_departures(item) for item in estimates]
    names = [item.name for item in estimates]
    centres = [values[0] for values in scaled]
    made.add_trace(
        go.Scatter(
            x=centres,
            y=names,
            name=f"{name} with {interval_words(shown())} interval",
            mode="markers",
            marker={"color": look.MODEL, "size": 8},
            error_x={
                "type": "data",
                "symmetric": False,
                "array": [max(values) - values[0] for values in scaled],
                "arrayminus": [values[0] - min(values) for values in scaled],
                "color": look.MODEL,
                "thickness": 1.6,
            },
        )
    )
    known = [item.name for item in estimates if item.truth is not None]
    if known:
        made.add_trace(
            go.Scatter(
                x=[0.0] * len(known),
                y=known,
                name="truth",
                mode="markers",
                marker={"color": look.TRUTH, "symbol": "diamond", "size": 9},
            )
        )
    made.update_yaxes(autorange="reversed", automargin=True)
    reference = "truth" if known else "estimate"
    made.update_xaxes(title_text=f"departure from the {reference} [%]")
    made.update_layout(hovermode="closest")
    return made


def _departures(item: EstimateBar) -> list[float]:
    """Of value and ends of the interval, percent; their half width where all else is zero."""
    reference = item.value if item.truth is None else item.truth
    scale = reference or item.value or 0.5 * (item.high - item.low) or 1.0
    return [100.0 * (edge - reference) / scale for edge in (item.value, item.low, item.high)]


def fit_figure(fit: Fit, name: str | None = None) -> go.PlotFigure:
    """Bode plot of one measured response, its 95 % band, and the model where it was fitted.

    Parameters
    ----------
    fit : Fit
        Result of `flightid.identify`.
    name : str, optional
        ``"output/input"``; default: the first response.

    Returns
    -------
    PlotFigure

    Raises
    ------
    UnknownNameError
        The fit has no such response.
    """
    for each in fit.responses:
        if name in (None, each.name):
            return _response_figure(each)
    raise UnknownNameError(
        "the fit has no such response",
        found=repr(name),
        needed=", ".join(each.name for each in fit.responses),
    )


def _response_figure(each: FittedResponse) -> go.PlotFigure:
    measured = each.measured
    low, high = each.band_rad_s
    inside = (measured.omega_rad_s >= low) & (measured.omega_rad_s <= high)
    curves = [
        Curve(
            "measured",
            measured.omega_rad_s,
            measured.response,
            coherence=measured.coherence,
            random_error=measured.random_error,
        ),
        Curve("model", measured.omega_rad_s[inside], each.model[inside], look.MODEL),
    ]
    return bode(curves, unit=measured.unit, band_rad_s=each.band_rad_s)
