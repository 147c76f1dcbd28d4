"""Modes: the map of eigenvalues with their 95 % regions over lines of damping and frequency."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping

import numpy as np
from numpy.typing import NDArray

from flightid.dynamics.modes.result import Mode, Modes
from flightid.plot import graph_objects as go
from flightid.plot import look
from flightid.uncertainty.quantiles import ellipse_radius, shown

HEIGHT_PX = 440
DAMPING_LINES = (0.1, 0.3, 0.5, 0.7, 0.9)
CIRCLES = 5
"""At most so many circles of natural frequency."""
SLOW = 0.15
"""Eigenvalues below this share of the largest have a plot of their own beside the whole."""
WIDEST = 1.2
"""Least width of a frame in its heights: both axes have one scale, and labels need room."""
MARGIN = 0.12
ROOM = (0.15, 0.08)
"""Of a frame: how far labels stand apart, so that none covers another on a phone."""
MARKERS = ("x", "circle-open", "diamond-open", "square-open", "triangle-up-open")

Points = NDArray[np.complex128]


def pole_map(found: Modes | Mapping[str, Modes]) -> go.PlotFigure:
    """Draw eigenvalues in the upper half of the s plane with their 95 % regions.

    A complex eigenvalue has an ellipse, a real one a bar. Where slow and fast modes lie far apart
    the slow ones are drawn again beside the whole.

    Parameters
    ----------
    found : Modes, or mapping of str to Modes
        Result of `flightid.modes`, or several by name (conditions, fits, a truth).

    Returns
    -------
    PlotFigure

    Example
    -------
    >>> import flightid as fid
    >>> pole_map(fid.modes(fid.load_model("rate_first_order"))).layout.xaxis.type is None
    True
    """
    several = {found.name: found} if isinstance(found, Modes) else dict(found)
    shown = [m for modes in several.values() for m in modes if m.eigenvalue is not None]
    sizes = [abs(m.eigenvalue) for m in shown if m.eigenvalue]
    largest = max(sizes, default=1.0)
    slow = [m for m in shown if abs(m.eigenvalue or 0.0) <= SLOW * largest]
    zoomed = any(m.eigenvalue for m in slow) and len(slow) < len(shown)
    made = look.figure(1, 2 if zoomed else 1, height_px=HEIGHT_PX, shared_x=False)
    made.update_layout(hovermode="closest")
    panels = [shown, slow] if zoomed else [shown]
    for column, visible in enumerate(panels, start=1):
        words = "slow modes: " if column > 1 else ""
        _frame(made, visible, column, words, len(panels) * ROOM[0])
        for number, (name, modes) in enumerate(several.items()):
            there = [m for m in modes if m in visible]
            _modes(made, name, there, number, column)
    return made


def _modes(made: go.PlotFigure, name: str, modes: Iterable[Mode], number: int, column: int) -> None:
    colour = look.SERIES[number % len(look.SERIES)]
    for mode in modes:
        outline = _region(mode)
        if outline is None:
            continue
        edge = go.Scatter(
            x=outline.real,
            y=outline.imag,
            legendgroup=name,
            showlegend=False,
            hoverinfo="skip",
            mode="lines",
            line={"color": colour, "width": 1.2 if mode.is_pair else 5},
            opacity=1.0 if mode.is_pair else 0.45,
            fill="toself" if mode.is_pair else None,
            fillcolor=_faint(colour) if mode.is_pair else None,
        )
        made.add_trace(edge, row=1, col=column)
    drawn = [mode for mode in modes if mode.eigenvalue is not None]
    places = np.array([mode.eigenvalue for mode in drawn], dtype=complex)
    points = go.Scatter(
        x=places.real,
        y=places.imag,
        name=name,
        legendgroup=name,
        showlegend=column == 1,
        mode="markers",
        marker={"color": colour, "symbol": MARKERS[number % len(MARKERS)], "size": 9},
        text=[_said(mode) for mode in drawn],
        hovertemplate="%{text}<extra></extra>",
    )
    made.add_trace(points, row=1, col=column)


def _said(mode: Mode) -> str:
    return "<br>".join([mode.name, *(f"{q.name} {q.text}" for q in mode.quantities)])


def _region(mode: Mode) -> Points | None:
    """Closed outline of the 95 % region, or the ends of the interval of a real eigenvalue."""
    if mode.eigenvalue is None or mode.covariance is None:
        return None
    if not mode.is_pair:
        return np.array(mode.real.interval(shown()) or (), dtype=complex)
    sizes, axes = np.linalg.eigh(mode.covariance)
    turn = np.linspace(0.0, 2.0 * np.pi, 73)
    half = ellipse_radius(shown()) * np.sqrt(np.maximum(sizes, 0.0))
    x, y = axes @ (half[:, None] * np.array([np.cos(turn), np.sin(turn)]))
    return np.asarray(mode.eigenvalue + x + 1j * y)


def _frame(made: go.PlotFigure, visible: list[Mode], column: int, words: str, room: float) -> None:
    """Range of the axes, lines of equal damping, circles of equal natural frequency."""
    corners = [np.array([m.eigenvalue or 0.0]) for m in visible]
    corners += [outline for m in visible if (outline := _region(m)) is not None and len(outline)]
    every = np.concatenate([*corners, np.zeros(1, dtype=complex)])
    left, right, top = float(every.real.min()), float(every.real.max()), float(every.imag.max())
    size = max(right - left, top, 1e-9)
    x = (left - MARGIN * size, max(right, 0.0) + MARGIN * size)
    y = (-MARGIN * size / 2.0, max(top, size / 3.0) + MARGIN * size)
    x = (min(x[0], x[1] - WIDEST * (y[1] - y[0])), x[1])
    reach = math.hypot(max(-x[0], x[1]), y[1])
    labels: list[tuple[complex, str]] = []
    for damping in DAMPING_LINES:
        end = reach * complex(-damping, math.sqrt(1.0 - damping**2))
        _thin(made, np.array([0j, end]), column)
        labels.append((_inside(end, x, y), f"ζ {damping:g}"))
    for radius in _rounds(max(-x[0], y[1])):
        turn = np.linspace(0.0, np.pi, 91)
        _thin(made, radius * np.exp(1j * turn), column)
        if radius < 0.85 * y[1]:
            labels.append((complex(0.0, radius), f"{radius:g} rad/s"))
    for place, text in _apart(labels, room * (x[1] - x[0]), ROOM[1] * (y[1] - y[0])):
        _label(made, place, text, column)
    _thin(made, np.array([complex(0.0, y[0]), complex(0.0, y[1])]), column, 1.4)
    axis = {"showgrid": False, "row": 1, "col": column}
    made.update_xaxes(range=x, title_text=words + look.axis_title("real part", "rad/s"), **axis)
    made.update_yaxes(
        range=y,
        title_text=look.axis_title("imaginary part", "rad/s"),
        scaleanchor="x" if column == 1 else f"x{column}",
        constrain="domain",
        **axis,
    )
    made.update_xaxes(constrain="domain", row=1, col=column)


def _apart(
    labels: Iterable[tuple[complex, str]], across: float, along: float
) -> list[tuple[complex, str]]:
    """Labels that stand apart from all before them."""
    kept: list[tuple[complex, str]] = []
    for place, text in labels:
        gaps = (place - other for other, _ in kept)
        if all(abs(gap.real) >= across or abs(gap.imag) >= along for gap in gaps):
            kept.append((place, text))
    return kept


def _inside(end: complex, x: tuple[float, float], y: tuple[float, float]) -> complex:
    """Where a ray from the origin leaves the frame, a little inside."""
    shares = [1.0]
    if end.real < 0.0:
        shares.append(x[0] / end.real)
    if end.imag > 0.0:
        shares.append(y[1] / end.imag)
    return 0.95 * min(shares) * end


def _rounds(reach: float) -> list[float]:
    """Round numbers up to the reach, evenly spaced."""
    rough = reach / CIRCLES
    power = 10.0 ** math.floor(math.log10(rough))
    step = next(power * digit for digit in (1.0, 2.0, 5.0, 10.0) if power * digit >= rough)
    return [step * k for k in range(1, math.floor(reach / step) + 1)]


def _thin(made: go.PlotFigure, points: Points, column: int, width: float = 0.8) -> None:
    made.add_trace(
        go.Scatter(
            x=points.real,
            y=points.imag,
            mode="lines",
            line={"color": look.LINE if width > 1.0 else look.GRID, "width": width},
            showlegend=False,
            hoverinfo="skip",
        ),
        row=1,
        col=column,
    )


def _label(made: go.PlotFigure, place: complex, text: str, column: int) -> None:
    made.add_annotation(
        x=place.real,
        y=place.imag,
        text=text,
        showarrow=False,
        font={"size": 10, "color": look.LINE},
        row=1,
        col=column,
    )


def _faint(colour: str) -> str:
    red, green, blue = (int(colour[i : i + 2], 16) for i in (1, 3, 5))
    return f"rgba({red},{green},{blue},{look.BAND_OPACITY})"
