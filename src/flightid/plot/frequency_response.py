"""Bode plots of estimated responses, with coherence and bands of their errors, and of models."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from flightid.errors import DataError
from flightid.frozen import dataclass
from flightid.plot import graph_objects as go
from flightid.plot import look
from flightid.responses.response_band import ResponseIntervals
from flightid.uncertainty.quantiles import half_width, shown

Array = NDArray[np.float64]
HEIGHTS = (2.2, 2.0, 1.1)
COLUMNS, CELL_PX = 3, 400


@dataclass(frozen=True, eq=False)
class Curve:
    """One response in a Bode plot.

    Attributes
    ----------
    name : str
        Name in the legend.
    omega_rad_s : ndarray, shape (n_freqs,)
        Frequencies, rad/s.
    response : ndarray of complex, shape (n_freqs,)
        Response.
    colour, dash : str
        Look of the line.
    coherence : ndarray, shape (n_freqs,), optional
        Coherence; shown below where any curve has it.
    random_error : ndarray, shape (n_freqs,), optional
        Normalised 1 σ random error; shown as a 95 % band.
    intervals : ResponseIntervals, optional
        Shown as the band in its place; they stand about this response.

    Example
    -------
    >>> Curve("model", np.array([1.0]), np.array([1.0 + 0.0j])).name
    'model'
    """

    name: str
    omega_rad_s: NDArray[np.float64]
    response: NDArray[np.complex128]
    colour: str = look.MEASURED
    dash: str = "solid"
    coherence: NDArray[np.float64] | None = None
    random_error: NDArray[np.float64] | None = None
    intervals: ResponseIntervals | None = None


def bode(
    curves: Sequence[Curve],
    *,
    unit: str = "",
    minimum_coherence: float = 0.6,
    band_rad_s: tuple[float, float] | None = None,
) -> go.PlotFigure:
    """Gain, phase and coherence over frequency.

    Parameters
    ----------
    curves : sequence of Curve
        What to show; the phase of later ones is shifted by whole turns to lie near the first's.
    unit : str
        Unit of the gain's reference, for example ``"rad/s"``.
    minimum_coherence : float
        Guideline drawn in the coherence plot.
    band_rad_s : tuple of float, optional
        What was used; beyond it all is greyed.

    Returns
    -------
    PlotFigure

    Raises
    ------
    DataError
        What is given are no curves: fits, models and responses draw themselves by ``.plot()``.

    Example
    -------
    >>> omega = np.array([1.0, 10.0])
    >>> len(bode([Curve("model", omega, 1 / (1j * omega))]).data)
    2
    """
    curves = _curves(curves)
    has_coherence = any(curve.coherence is not None for curve in curves)
    rows = 3 if has_coherence else 2
    made = look.figure(rows, row_heights=HEIGHTS[:rows], height_px=580 if rows > 2 else 490)
    _draw(made, curves, (1, 1), minimum_coherence, band_rad_s)
    titles = (look.axis_title("gain", f"dB re {unit}" if unit else "dB"), "phase [deg]")
    look.label_axes(made, x="frequency [rad/s]", y=(*titles, "coherence")[:rows], log_x=True)
    look.hertz_above(made)
    return made


def bode_page(
    cells: Mapping[str, Sequence[Curve]],
    *,
    minimum_coherence: float = 0.6,
    bands_rad_s: Mapping[str, tuple[float, float]] | None = None,
) -> go.PlotFigure:
    """Small Bode plots of many responses, `COLUMNS` of them beside each other.

    Parameters
    ----------
    cells : mapping of str to sequence of Curve
        What to show under each title; every response has coherence.
    minimum_coherence : float
        Guideline drawn in the plots of coherence.
    bands_rad_s : mapping of str to tuple of float, optional
        What was used of each; beyond it all is greyed.

    Returns
    -------
    PlotFigure

    Example
    -------
    >>> omega = np.array([1.0, 10.0])
    >>> curve = Curve("model", omega, 1 / (1j * omega), coherence=np.ones(2))
    >>> len(bode_page({"p/lat": [curve], "q/lon": [curve]}).data)
    6
    """
    lines = -(-len(cells) // COLUMNS)
    made = look.figure(
        3 * lines, COLUMNS, row_heights=HEIGHTS * lines, shared_x=False,
        height_px=look.MARGIN_PX + CELL_PX * lines,
    )  # fmt: skip
    for place, (title, curves) in enumerate(cells.items()):
        row, column = 3 * (place // COLUMNS) + 1, place % COLUMNS + 1
        band = (bands_rad_s or {}).get(title)
        _draw(made, curves, (row, column), minimum_coherence, band, legend=place == 0)
        made.add_annotation(
            row, column, text=f"<b>{title}</b>", x=0.0, y=1.0, xanchor="left", yanchor="bottom",
            showarrow=False,
        )  # fmt: skip
        number = 3 * (place // COLUMNS) * COLUMNS + column
        ends = {f"{axis}ref": f"{axis}{number if number > 1 else ''} domain" for axis in "xy"}
        made.layout["annotations"][-1].merge(ends)
    for column in range(1, COLUMNS + 1):
        titles = ("gain [dB]", "phase [deg]", "coherence") * lines if column == 1 else ()
        filled = 3 * -(-(len(cells) - column + 1) // COLUMNS)
        look.label_axes(
            made, x="frequency [rad/s]", y=titles or ("",) * filled, column=column, log_x=True
        )
    for number, (x, y) in enumerate(zip(made.select_xaxes(), made.select_yaxes(), strict=True)):
        line, column = number // COLUMNS, number % COLUMNS
        x.showticklabels = line % 3 == 2
        x.visible = y.visible = line // 3 * COLUMNS + column < len(cells)
    return made


def _draw(
    made: go.PlotFigure,
    curves: Sequence[Curve],
    place: tuple[int, int],
    minimum_coherence: float,
    band_rad_s: tuple[float, float] | None,
    *,
    legend: bool = True,
) -> None:
    """Gain, phase and coherence in three plots, the uppermost at a row and a column."""
    row, column = place
    for number, curve in enumerate(curves):
        phase_deg = _unwrapped_deg(curve.response)
        if number:
            phase_deg = phase_deg + _whole_turns(curves[0], curve, phase_deg)
        _add_gain(made, curve, place, legend=legend)
        _add_phase(made, curve, phase_deg, (row + 1, column))
        if curve.coherence is not None:
            drawn = _line(curve, curve.coherence, legend=False)
            made.add_trace(drawn, row=row + 2, col=column)
    rows = 2
    if any(curve.coherence is not None for curve in curves):
        rows = 3
        made.update_yaxes(range=[0, 1.05], row=row + 2, col=column)
        guide = {"color": look.LINE, "dash": "dot", "width": 1}
        made.add_hline(minimum_coherence, line=guide, row=row + 2, col=column)
    if band_rad_s is None:
        return
    ends = [end for c in curves for end in (c.omega_rad_s[0], c.omega_rad_s[-1])]
    for low, high in ((min(ends), band_rad_s[0]), (band_rad_s[1], max(ends))):
        for each in range(row, row + rows) if low < high else ():
            made.add_vrect(
                low, high, row=each, col=column, fillcolor=look.GREYED, line={"width": 0}
            )


def _curves(given: object) -> tuple[Curve, ...]:
    items = tuple(given) if isinstance(given, Iterable) else (given,)
    for item in items:
        if not isinstance(item, Curve):
            raise DataError(
                "curves were expected",
                found=type(item).__name__,
                needed="several Curve",
                action="fits, models and responses draw themselves: call .plot()",
            )
    return items


def _line(curve: Curve, values: NDArray[np.float64], *, legend: bool) -> go.Node:
    return look.line(
        curve.name, curve.omega_rad_s, values, colour=curve.colour, dash=curve.dash, legend=legend
    )


def _add_gain(made: go.PlotFigure, curve: Curve, place: tuple[int, int], *, legend: bool) -> None:
    magnitude = np.abs(curve.response)
    low, high = 0.0 * magnitude, magnitude
    if curve.intervals is not None:
        low, high = curve.intervals.gain
    elif curve.random_error is not None:
        wide = half_width(shown()) * curve.random_error
        low, high = magnitude * (1 - wide), magnitude * (1 + wide)
    # A lower edge at or below zero gain has no decibels; it is drawn 40 dB down.
    _add_band(made, curve, (_decibel(np.maximum(low, 0.01 * magnitude)), _decibel(high)), place)
    made.add_trace(_line(curve, _decibel(magnitude), legend=legend), *place)


def _add_phase(made: go.PlotFigure, curve: Curve, phase_deg: Array, place: tuple[int, int]) -> None:
    low, high = phase_deg, phase_deg
    if curve.intervals is not None:
        low, high = np.degrees(curve.intervals.phase_rad)
        turns = 360.0 * np.round((phase_deg - 0.5 * (low + high)) / 360.0)
        low, high = low + turns, high + turns
    elif curve.random_error is not None:
        wide = np.minimum(np.degrees(half_width(shown()) * curve.random_error), 180.0)
        low, high = phase_deg - wide, phase_deg + wide
    _add_band(made, curve, (low, high), place)
    made.add_trace(_line(curve, phase_deg, legend=False), *place)


def _add_band(
    made: go.PlotFigure, curve: Curve, edges: tuple[Array, Array], place: tuple[int, int]
) -> None:
    if curve.intervals is not None or curve.random_error is not None:
        drawn = look.band(curve.name, curve.omega_rad_s, *edges, colour=curve.colour)
        made.add_traces(drawn, *place)


def _decibel(magnitude: NDArray[np.float64]) -> NDArray[np.float64]:
    return 20 * np.log10(np.maximum(magnitude, np.finfo(np.float64).tiny))


def _unwrapped_deg(response: NDArray[np.complex128]) -> NDArray[np.float64]:
    return np.degrees(np.unwrap(np.angle(response)))


def _whole_turns(first: Curve, curve: Curve, phase_deg: NDArray[np.float64]) -> float:
    """Shift, a multiple of 360 deg, that brings a phase nearest to the first curve's."""
    reference = np.interp(
        np.log(curve.omega_rad_s), np.log(first.omega_rad_s), _unwrapped_deg(first.response)
    )
    return 360.0 * float(np.round(np.median(reference - phase_deg) / 360.0))
