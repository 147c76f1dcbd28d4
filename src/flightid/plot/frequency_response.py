"""Bode plots of estimated responses, with coherence and bands of their errors, and of models."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from flightid.errors import DataError
from flightid.plot import graph_objects as go
from flightid.plot import look
from flightid.responses.response_band import TAKEN_OUT, ResponseIntervals
from flightid.uncertainty.quantiles import half_width, shown

Array = NDArray[np.float64]


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
        Shown as the band in its place.

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
    curves: Sequence[Curve], *, unit: str = "", minimum_coherence: float = 0.6
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
    made = look.figure(rows, row_heights=(2.2, 2.0, 1.1)[:rows], height_px=560 if rows > 2 else 470)
    for number, curve in enumerate(curves):
        phase_deg = _unwrapped_deg(curve.response)
        if number:
            phase_deg = phase_deg + _whole_turns(curves[0], curve, phase_deg)
        _add_gain(made, curve)
        _add_phase(made, curve, phase_deg)
        if curve.coherence is not None:
            made.add_trace(_line(curve, curve.coherence, legend=False), row=3, col=1)
    titles = (look.axis_title("gain", f"dB re {unit}" if unit else "dB"), "phase [deg]")
    look.label_axes(made, x="frequency [rad/s]", y=(*titles, "coherence")[:rows], log_x=True)
    if has_coherence:
        made.update_yaxes(range=[0, 1.05], row=3, col=1)
        made.add_hline(
            minimum_coherence, line={"color": look.LINE, "dash": "dot", "width": 1}, row=3, col=1
        )
    return made


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


def _add_gain(made: go.PlotFigure, curve: Curve) -> None:
    magnitude = np.abs(curve.response)
    low, high = 0.0 * magnitude, magnitude
    if curve.intervals is not None:
        low, high = curve.intervals.gain
    elif curve.random_error is not None:
        wide = half_width(shown()) * curve.random_error
        low, high = magnitude * (1 - wide), magnitude * (1 + wide)
    # A lower edge at or below zero gain has no decibels; it is drawn 40 dB down.
    _add_band(made, curve, (_decibel(np.maximum(low, 0.01 * magnitude)), _decibel(high)), 1)
    made.add_trace(_line(curve, _decibel(magnitude), legend=True), row=1, col=1)
    if curve.intervals is not None:
        _add_centre(made, curve, _decibel(np.abs(curve.intervals.centre)), 1)


def _add_phase(made: go.PlotFigure, curve: Curve, phase_deg: NDArray[np.float64]) -> None:
    low, high = phase_deg, phase_deg
    if curve.intervals is not None:
        low, high = np.degrees(curve.intervals.phase_rad)
        turns = 360.0 * np.round((phase_deg - 0.5 * (low + high)) / 360.0)
        low, high = low + turns, high + turns
    elif curve.random_error is not None:
        wide = np.minimum(np.degrees(half_width(shown()) * curve.random_error), 180.0)
        low, high = phase_deg - wide, phase_deg + wide
    _add_band(made, curve, (low, high), 2)
    made.add_trace(_line(curve, phase_deg, legend=False), row=2, col=1)
    if curve.intervals is not None:
        _add_centre(made, curve, 0.5 * (low + high), 2)


def _add_centre(made: go.PlotFigure, curve: Curve, values: Array, row: int) -> None:
    """What the band stands about, where leakage and resolution were taken out."""
    assert curve.intervals is not None
    if curve.intervals.reason == TAKEN_OUT:
        name = f"{curve.name}, leakage taken out"
        drawn = look.line(
            name, curve.omega_rad_s, values, colour=look.RIVAL, dash="dot", legend=row == 1
        )
        made.add_trace(drawn, row=row, col=1)


def _add_band(made: go.PlotFigure, curve: Curve, edges: tuple[Array, Array], row: int) -> None:
    if curve.intervals is not None or curve.random_error is not None:
        drawn = look.band(curve.name, curve.omega_rad_s, *edges, colour=curve.colour)
        made.add_traces(drawn, rows=row, cols=1)


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
