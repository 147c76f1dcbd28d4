"""Loops: Bode, Nyquist and Nichols pictures with their margins, disk margins, disturbances."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from flightid.control.margins.disk_geometry import gain_limits
from flightid.control.margins.disk_margin import DiskMargin
from flightid.control.margins.disturbance_rejection import DisturbanceRejection
from flightid.control.margins.loop_metrics import DISTURBANCE_LEVEL_DB
from flightid.control.margins.margins import GAIN_GUIDE_DB, PHASE_GUIDE_DEG, LoopCurve, Margins
from flightid.plot import graph_objects as go
from flightid.plot import look
from flightid.uncertainty.estimate import Reading
from flightid.uncertainty.quantiles import half_width, shown

Array = NDArray[np.float64]
WIDEST_DEG = 180.0
NAME = "loop"
ROUND_DEG = np.linspace(0.0, 360.0, 361)
GUIDE = {"color": look.LINE, "dash": "dot", "width": 1}
SEEN_DB = (-40.0, 40.0)
SEEN_DEG = (-400.0, 20.0)
NYQUIST_REACH = 2.4


def loop_bode(margins: Margins) -> go.PlotFigure:
    """Gain and phase of a loop with 95 % bands; its margins drawn where they are taken.

    Parameters
    ----------
    margins : Margins

    Returns
    -------
    PlotFigure

    Example
    -------
    >>> import flightid as fid
    >>> loop = fid.LinearSystem([[0.0]], [[4.0]], [[1.0]], [[0.0]], ("e",), ("y",), [0.1])
    >>> type(loop_bode(fid.margins(loop))).__name__
    'PlotFigure'
    """
    made = look.figure(rows=2, row_heights=(1.0, 1.0), height_px=500)
    omega, decibel, degrees = drawn_curve(margins.curve, margins.crossover)
    for row, values, stderr in (
        (1, decibel, margins.curve.stderr_db),
        (2, degrees, margins.curve.stderr_deg),
    ):
        add_band(made, omega, values, stderr, row)
        made.add_trace(
            look.line(NAME, omega, values, colour=look.MODEL, legend=False), row=row, col=1
        )
    made.add_hline(0.0, line=GUIDE, row=1, col=1)
    made.add_hline(-180.0, line=GUIDE, row=2, col=1)
    _mark(made, margins.gain_margin, margins.phase_crossover, omega, decibel, 1, 0.0, look.RIVAL)
    reduction = margins.gain_reduction_margin, margins.gain_reduction_crossing
    _mark(made, *reduction, omega, decibel, 1, 0.0, look.OTHER)
    _mark(made, margins.phase_margin, margins.crossover, omega, degrees, 2, -180.0, look.TRUTH)
    titles = (look.axis_title("gain", "dB"), look.axis_title("phase", "deg"))
    look.label_axes(made, x="frequency [rad/s]", y=titles, log_x=True)
    made.update_yaxes(range=seen_limits(decibel, SEEN_DB), row=1, col=1)
    made.update_yaxes(range=seen_limits(degrees, SEEN_DEG), dtick=90, row=2, col=1)
    return made


def loop_nyquist(margins: Margins, disk: DiskMargin | None = None) -> go.PlotFigure:
    """A loop in the complex plane around −1, with the disk that it must not enter.

    Parameters
    ----------
    margins : Margins
    disk : DiskMargin, optional
        Of the same loop: its forbidden disk is drawn; left out, that of the modulus margin.

    Returns
    -------
    PlotFigure

    Example
    -------
    >>> import flightid as fid
    >>> loop = fid.LinearSystem([[0.0]], [[4.0]], [[1.0]], [[0.0]], ("e",), ("y",), [0.1])
    >>> type(loop_nyquist(fid.margins(loop))).__name__
    'PlotFigure'
    """
    made = look.figure(height_px=520)
    values = margins.curve.response
    near = np.where(np.abs(values) < 20.0 * NYQUIST_REACH, values, np.nan)
    turn = np.exp(1j * np.radians(ROUND_DEG))
    made.add_trace(
        look.line("unit circle", turn.real, turn.imag, colour=look.LINE, dash="dot", width=1)
    )
    name, edge = _forbidden(margins, disk, turn)
    if edge is not None:
        made.add_trace(
            go.Scatter(
                x=edge.real,
                y=edge.imag,
                name=name,
                mode="lines",
                fill="toself",
                line={"color": look.RIVAL, "width": 1},
                fillcolor="rgba(213,94,0,0.12)",
            )
        )
    made.add_trace(look.line(NAME, near.real, near.imag, colour=look.MODEL))
    made.add_trace(
        look.line(
            "negative frequencies", near.real, -near.imag, colour=look.MODEL, dash="dot", width=1
        )
    )
    made.add_trace(_points("−1", [-1.0], [0.0], look.BLACK, "x"))
    _nyquist_marks(made, margins)
    reach = [-NYQUIST_REACH, NYQUIST_REACH]
    made.update_xaxes(title_text="real part", range=reach)
    made.update_yaxes(title_text="imaginary part", range=reach, scaleanchor="x", scaleratio=1)
    made.update_layout(hovermode="closest")
    return made


def loop_nichols(
    margins: Margins,
    *,
    phase_guide_deg: float = PHASE_GUIDE_DEG,
    gain_guide_db: float = GAIN_GUIDE_DB,
) -> go.PlotFigure:
    """Gain over phase of a loop, with the zone that the guides keep free around −1.

    Parameters
    ----------
    margins : Margins
    phase_guide_deg, gain_guide_db : float
        Half axes of the ellipse.

    Returns
    -------
    PlotFigure

    Example
    -------
    >>> import flightid as fid
    >>> loop = fid.LinearSystem([[0.0]], [[4.0]], [[1.0]], [[0.0]], ("e",), ("y",), [0.1])
    >>> type(loop_nichols(fid.margins(loop))).__name__
    'PlotFigure'
    """
    made = look.figure(height_px=500)
    _, decibel, degrees = drawn_curve(margins.curve, margins.crossover)
    angle = np.radians(ROUND_DEG)
    made.add_trace(
        go.Scatter(
            x=-180.0 + phase_guide_deg * np.cos(angle),
            y=gain_guide_db * np.sin(angle),
            name=f"{phase_guide_deg:g}° and {gain_guide_db:g} dB",
            mode="lines",
            fill="toself",
            line={"color": look.RIVAL, "width": 1},
            fillcolor="rgba(213,94,0,0.12)",
        )
    )
    made.add_trace(look.line(NAME, degrees, decibel, colour=look.MODEL))
    made.add_trace(_points("−1", [-180.0], [0.0], look.BLACK, "x"))
    phase = margins.phase_margin
    if phase.value is not None:
        at = np.interp(0.0, *_ordered(margins, decibel, degrees))
        made.add_trace(
            _points("crossover", [float(at)], [0.0], look.TRUTH, "circle", x_error=_half(phase))
        )
    gain = margins.gain_margin
    if gain.value is not None:
        made.add_trace(
            _points("gain margin", [-180.0], [-gain.value], look.RIVAL, "square", _half(gain))
        )
    made.update_xaxes(title_text="phase [deg]", range=seen_limits(degrees, SEEN_DEG), dtick=45)
    made.update_yaxes(title_text="gain [dB]", range=seen_limits(decibel, SEEN_DB))
    made.update_layout(hovermode="closest")
    return made


def disturbance_figure(found: DisturbanceRejection) -> go.PlotFigure:
    """Response to disturbances over frequency with its 95 % band, bandwidth and peak.

    Parameters
    ----------
    found : DisturbanceRejection

    Returns
    -------
    PlotFigure
    """
    made = look.figure(height_px=340)
    curve = found.curve
    decibel = 20.0 * np.log10(np.abs(curve.response))
    add_band(made, curve.omega_rad_s, decibel, curve.stderr_db, 1)
    made.add_trace(look.line("|S|", curve.omega_rad_s, decibel, colour=look.MODEL, legend=False))
    made.add_hline(DISTURBANCE_LEVEL_DB, line=GUIDE)
    made.add_hline(0.0, line=GUIDE)
    if found.bandwidth.value is not None:
        text = f"bandwidth {found.bandwidth.text}"
        point = _points(
            text,
            [found.bandwidth.value],
            [DISTURBANCE_LEVEL_DB],
            look.TRUTH,
            "circle",
            x_error=_half(found.bandwidth),
        )
        made.add_trace(point)
    if found.peak.value is not None and found.peak_frequency.value is not None:
        made.add_trace(
            _points(
                f"peak {found.peak.text}",
                [found.peak_frequency.value],
                [found.peak.value],
                look.RIVAL,
                "square",
                _half(found.peak),
            )
        )
    look.label_axes(made, x="frequency [rad/s]", y=("disturbance response [dB]",), log_x=True)
    made.update_yaxes(range=seen_limits(decibel, (-40.0, 20.0)))
    made.update_layout(hovermode="closest")
    return made


def disk_figure(found: DiskMargin) -> go.PlotFigure:
    """Disk margin over frequency, as the gain and the phase that all loops stand there.

    Parameters
    ----------
    found : DiskMargin

    Returns
    -------
    PlotFigure
    """
    made = look.figure(height_px=340)
    made.add_trace(look.line("α", found.omega_rad_s, found.alphas, colour=look.MODEL, legend=False))
    if found.alpha.value is not None and found.frequency.value is not None:
        point = _points(
            f"disk margin {found.alpha.text}",
            [found.frequency.value],
            [found.alpha.value],
            look.RIVAL,
            "circle",
            _half(found.alpha),
        )
        made.add_trace(point)
    look.label_axes(made, x="frequency [rad/s]", y=("disk margin α",), log_x=True)
    made.update_yaxes(range=[0.0, min(4.0, 1.05 * float(np.max(found.alphas, initial=1.0)))])
    made.update_layout(hovermode="closest")
    return made


def drawn_curve(curve: LoopCurve, crossover: Reading) -> tuple[Array, Array, Array]:
    """Frequencies, dB, and degrees on the turn that has the crossover within ±180° of −180°."""
    omega = curve.omega_rad_s
    degrees = np.degrees(np.unwrap(np.angle(curve.response)))
    place = len(omega) // 2
    if crossover.value is not None:
        place = int(np.argmin(np.abs(np.log(omega / crossover.value))))
    degrees -= 360.0 * np.round((degrees[place] + 180.0) / 360.0)
    return omega, 20.0 * np.log10(np.abs(curve.response)), degrees


def add_band(
    made: go.PlotFigure,
    omega: Array,
    values: Array,
    errors: Array | None,
    row: int,
    named: tuple[str, str] = (NAME, look.MODEL),
) -> None:
    """Draw the band of a curve in a row; its name and colour are those of the line."""
    if errors is None:
        return
    wide = np.minimum(half_width(shown()) * np.nan_to_num(errors, nan=WIDEST_DEG), WIDEST_DEG)
    edges = look.band(named[0], omega, values - wide, values + wide, colour=named[1])
    made.add_traces(edges, rows=row, cols=1)


def _mark(
    made: go.PlotFigure,
    margin: Reading,
    place: Reading,
    omega: Array,
    values: Array,
    row: int,
    level: float,
    colour: str,
) -> None:
    """A bar from the curve to the level, named with the margin and its interval."""
    if margin.value is None or not place.value:  # nothing stands at 0 rad/s on a log axis
        return
    at = float(np.interp(np.log(place.value), np.log(omega), values))
    # The level's next turn: a crossover may lie on either side of it.
    end = level if row == 1 else level + 360.0 * round((at - level) / 360.0)
    made.add_trace(
        go.Scatter(
            x=[place.value, place.value],
            y=[at, end],
            name=f"{margin.name} {margin.text}",
            mode="lines+markers",
            line={"color": colour, "width": 2.5},
            marker={"size": 6},
        ),
        row=row,
        col=1,
    )


def _forbidden(
    margins: Margins, disk: DiskMargin | None, turn: NDArray[np.complex128]
) -> tuple[str, NDArray[np.complex128] | None]:
    """Name and edge of the disk of −1/f over all factors f that the margin allows."""
    if disk is not None and disk.alpha.value is not None:
        low, high = gain_limits(disk.alpha.value, disk.skew)
        if low <= 0.0:
            return "", None
        left, right = -1.0 / low, 0.0 if np.isinf(high) else -1.0 / high
        edge = 0.5 * (left + right) + 0.5 * (right - left) * turn
        return f"disk margin {disk.alpha.text}", np.asarray(edge)
    if margins.modulus_margin.value is None or not margins.is_stable:
        return "", None
    edge = -1.0 + margins.modulus_margin.value * turn
    return f"modulus margin {margins.modulus_margin.text}", np.asarray(edge)


def _nyquist_marks(made: go.PlotFigure, margins: Margins) -> None:
    for margin in (margins.phase_margin,):
        if margin.value is not None:
            side = next(
                c.margin for c in margins.crossovers if _same(c.omega_rad_s, margins.crossover)
            )
            at = -np.exp(1j * np.radians(side))
            text = f"{margin.name} {margin.text}"
            made.add_trace(_points(text, [at.real], [at.imag], look.TRUTH, "circle"))
    for margin, place, colour in (
        (margins.gain_margin, margins.phase_crossover, look.RIVAL),
        (margins.gain_reduction_margin, margins.gain_reduction_crossing, look.OTHER),
    ):
        if margin.value is not None and place.value:
            real = np.interp(
                np.log(place.value),
                np.log(margins.curve.omega_rad_s),
                -np.abs(margins.curve.response),
            )
            text = f"{margin.name} {margin.text}"
            made.add_trace(_points(text, [float(real)], [0.0], colour, "square"))


def _same(omega: float, quantity: Reading) -> bool:
    return quantity.value is not None and abs(omega - quantity.value) < 1e-6 * quantity.value


def _ordered(margins: Margins, decibel: Array, degrees: Array) -> tuple[Array, Array]:
    """The stretch of the curve around the crossover, gain increasing, for interpolation."""
    assert margins.crossover.value is not None
    omega = margins.curve.omega_rad_s
    place = int(np.clip(np.searchsorted(omega, margins.crossover.value), 1, len(omega) - 1))
    pair = np.array([place - 1, place])
    pair = pair[np.argsort(decibel[pair])]
    return decibel[pair], degrees[pair]


def _half(quantity: Reading) -> float | None:
    return quantity.half(shown())


def _points(
    name: str,
    x: list[float],
    y: list[float],
    colour: str,
    symbol: str,
    y_error: float | None = None,
    x_error: float | None = None,
) -> go.Node:
    errors = {
        key: {"type": "data", "array": [each]}
        for key, each in (("error_x", x_error), ("error_y", y_error))
        if each is not None
    }
    marker = {"color": colour, "symbol": symbol, "size": 9}
    return go.Scatter(x=x, y=y, name=name, mode="markers", marker=marker, **errors)


def seen_limits(values: Array, seen: tuple[float, float]) -> list[float]:
    """A little more than the values, but not beyond what is worth seeing."""
    low, high = float(np.min(values)), float(np.max(values))
    room = 0.05 * max(high - low, 1.0)
    return [max(low - room, seen[0]), min(high + room, seen[1])]
