"""Handling qualities: charts of levels with the estimate in them, and where bandwidth is read."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from flightid.dynamics.handling_qualities.pilot_cutoff import PilotCutoff
from flightid.dynamics.handling_qualities.rating import Rating
from flightid.dynamics.handling_qualities.rating_charts import RatingChart
from flightid.dynamics.handling_qualities.result import AttitudeBandwidth
from flightid.dynamics.lower_order.result import LowerOrder
from flightid.errors import DataError
from flightid.plot import graph_objects as go
from flightid.plot import look
from flightid.plot.frequency_response import Curve, bode
from flightid.plot.record import sparse
from flightid.uncertainty.quantiles import ellipse_radius, shown

SHADES = ("#b8dfc9", "#f7e3a1", "#f3bfa5", "#d9d9d9")
"""Levels 1, 2, 3 and worse; each is named in the plot too."""
CELLS = 300
NARROW = 0.18
"""Share of the width below which a region's name is written upright."""
LOGARITHMIC = {"cap", "n_alpha", "frequency"}
LEAST_SPAN = {"bandwidth": (0.0, 5.0), "phase_delay": (0.0, 0.2), "damping": (0.0, 1.5)}
Array = NDArray[np.float64]


def level_chart(ratings: Rating | Sequence[Rating]) -> go.PlotFigure:
    """Draw a chart of levels with one or more estimates and their 95 % regions.

    Parameters
    ----------
    ratings : Rating or sequence of Rating
        On one chart with two axes.

    Returns
    -------
    PlotFigure

    Raises
    ------
    DataError
        A requirement on one number has no chart; nothing to draw.
    """
    shown = [ratings] if isinstance(ratings, Rating) else list(ratings)
    if not shown or len(shown[0].chart.axes) != 2:
        raise DataError("there is no chart to draw", needed="a requirement on two numbers")
    chart = shown[0].chart
    spans = [_span(chart, name, shown) for name in chart.axes]
    made = look.figure(1, 1, height_px=440)
    made.update_layout(hovermode="closest")
    _regions(made, chart, spans, shown[0])
    for name, (_, high) in chart.valid.items():
        if name == chart.axes[1] and high < spans[1][1]:
            _level(made, high, "boundaries are stored up to here", row=1)
    for number, rating in enumerate(shown):
        _estimate(made, rating, look.SERIES[number % len(look.SERIES)], number)
    titles = [look.axis_title(chart.labels[name], chart.units[name]) for name in chart.axes]
    look.label_axes(made, x=titles[0], y=(titles[1],))
    for name, span, update in zip(
        chart.axes, spans, (made.update_xaxes, made.update_yaxes), strict=True
    ):
        if name in LOGARITHMIC:
            ticks: dict[str, Any] = {"tickvals": look.LOG_TICKS, "ticktext": look.LOG_LABELS}
            update(type="log", range=[float(np.log10(end)) for end in span], **ticks)
        else:
            update(range=list(span))
    return made


def bandwidth_curves(found: AttitudeBandwidth) -> go.PlotFigure:
    """Draw gain and phase of the attitude, and where bandwidths and phase delay are read.

    Parameters
    ----------
    found : AttitudeBandwidth

    Returns
    -------
    PlotFigure
    """
    curve, crossing = found.curve, found.omega_180_rad_s
    low = 0.3 * min(found.phase_bandwidth_rad_s, found.gain_bandwidth_rad_s or crossing)
    keep = np.flatnonzero((curve.omega >= low) & (curve.omega <= 3.0 * crossing))
    keep = keep[sparse(keep.size)]
    made = look.figure(2, 1, row_heights=(2.0, 2.2), height_px=520)
    for row, values in enumerate((curve.decibels, curve.degrees), start=1):
        line = look.line(
            found.name, curve.omega[keep], values[keep], colour=look.MODEL, legend=False
        )
        made.add_trace(line, row=row, col=1)
    for level, text in ((-135.0, "−135°"), (-180.0, "−180°")):
        _level(made, level, text, row=2)
    level_db = curve.at(crossing)[0]
    _level(made, level_db, "gain at ω_180", row=1)
    _level(made, level_db + 6.0, "+6 dB", row=1)
    _marks(made, found)
    _slope(made, found)
    look.label_axes(made, x="frequency [rad/s]", y=("gain [dB]", "phase [deg]"), log_x=True)
    return made


def lower_order_curves(found: LowerOrder) -> go.PlotFigure:
    """Draw the response and its equivalent system of low order.

    Parameters
    ----------
    found : LowerOrder

    Returns
    -------
    PlotFigure
    """
    pair = found.response.pair(found.output, found.input)
    measured = found.response.estimator != "model"
    low, high = found.band_rad_s
    inside = (pair.omega_rad_s >= 0.999 * low) & (pair.omega_rad_s <= 1.001 * high)
    omega = pair.omega_rad_s[inside]
    smooth = np.geomspace(omega[0], omega[-1], 200)
    first = Curve(
        "measured" if measured else "system",
        omega,
        pair.response[inside],
        look.MEASURED,
        coherence=pair.coherence[inside] if measured else None,
        random_error=pair.random_error[inside] if measured else None,
    )
    equivalent = Curve(
        "equivalent system",
        smooth,
        found.model.frequency_response(smooth)[0, 0],
        look.MODEL,
        "dash",
    )
    return bode((first, equivalent), unit=pair.unit)


def cutoff_spectrum(found: PilotCutoff) -> go.PlotFigure:
    """Draw the share of a control's power below each frequency, with the cut-off.

    Parameters
    ----------
    found : PilotCutoff

    Returns
    -------
    PlotFigure
    """
    omega, density = found.omega_rad_s, found.density
    steps = np.diff(omega) * 0.5 * (density[1:] + density[:-1])
    share = np.concatenate([[0.0], np.cumsum(steps)]) / np.sum(steps)
    keep = omega > 0.0
    made = look.figure(1, 1, height_px=340)
    title = f"{found.channel}: cut-off {found.cutoff.text}"
    made.add_trace(look.line(title, omega[keep], 100.0 * share[keep], colour=look.MEASURED))
    made.add_hline(50.0, line={"color": look.LINE, "dash": "dot", "width": 1})
    if found.cutoff.value is not None:
        made.add_vline(found.cutoff.value, line={"color": look.MODEL, "width": 1.5})
    if (ends := found.cutoff.interval(shown())) is not None:
        made.add_vrect(*ends, fillcolor=look.MODEL, opacity=0.12, line_width=0)
    look.label_axes(made, x="frequency [rad/s]", y=("power below [%]",), log_x=True)
    return made


def _span(chart: RatingChart, name: str, ratings: Sequence[Rating]) -> tuple[float, float]:
    """What an axis shows: boundaries, estimates and their draws, with some room."""
    ends = [value for region in chart.regions for value in region.limits.get(name, ())]
    for region in chart.regions:
        if region.boundary is not None:
            ends += list(region.boundary[:, chart.axes.index(name)])
    ends += [rating.values[name] for rating in ratings]
    for rating in ratings:
        if name in rating.samples:
            ends += list(np.quantile(rating.samples[name], [0.005, 0.995]))
    known = np.array([end for end in ends if np.isfinite(end)])
    if name in LOGARITHMIC:
        above = known[known > 0.0]
        low, high = (above.min(), above.max()) if above.size else (0.1, 10.0)
        return float(low) / 2.5, float(high) * 2.5
    least = LEAST_SPAN.get(name, (0.0, 1.0))
    low, high = min(least[0], float(known.min())), max(least[1], 1.15 * float(known.max()))
    return low, high


def _regions(
    made: go.PlotFigure, chart: RatingChart, spans: Sequence[tuple[float, float]], rating: Rating
) -> None:
    """Shade each level, and name it in its middle."""
    axes = [
        np.geomspace(*span, CELLS) if name in LOGARITHMIC else np.linspace(*span, CELLS)
        for name, span in zip(chart.axes, spans, strict=True)
    ]
    x, y = np.meshgrid(*axes)
    levels = chart.levels(_completed(chart, x.ravel(), y.ravel(), rating)).reshape(x.shape)
    count = len(chart.regions) + 1
    shades = [*SHADES[: len(chart.regions)], SHADES[min(count, len(SHADES)) - 1]]
    scale = [(k / count + end, shades[k]) for k in range(count) for end in (0.0, 1.0 / count)]
    made.add_trace(
        go.Heatmap(
            x=axes[0],
            y=axes[1],
            z=levels.astype(np.uint8),
            zmin=0.5,
            zmax=count + 0.5,
            colorscale=scale,
            showscale=False,
            hoverinfo="skip",
        ),
        row=1,
        col=1,
    )
    for level in np.unique(levels):
        place, share = _middle(levels == level)
        made.add_annotation(
            textangle=0 if share > NARROW else -90,
            x=_coordinate(chart.axes[0], axes[0][place[1]]),
            y=_coordinate(chart.axes[1], axes[1][place[0]]),
            text=chart.level_name(int(level)),
            showarrow=False,
            font={"size": 12, "color": look.BLACK},
        )


def _completed(chart: RatingChart, x: Array, y: Array, rating: Rating) -> dict[str, Array]:
    """All quantities of the chart over its plane: derived ones follow, others stay as rated."""
    found = {chart.axes[0]: x, chart.axes[1]: y}
    if "decay" in chart.labels and {"damping", "frequency"} <= set(found):
        found["decay"] = found["damping"] * found["frequency"]
    if "cap" in chart.labels and {"n_alpha", "frequency"} <= set(found):
        found["cap"] = found["frequency"] ** 2 / found["n_alpha"]
    for name in chart.labels:
        if name not in found:
            found[name] = np.full(x.size, rating.values[name])
    return found


def _middle(inside: NDArray[np.bool_]) -> tuple[tuple[int, int], float]:
    """A cell deep inside a region, the middle of its longest run, and that run's share of a row."""
    rows = np.argsort(-inside.sum(axis=1))
    widest = inside.sum(axis=1)[rows[0]]
    row = int(np.percentile(np.flatnonzero(inside.sum(axis=1) >= 0.9 * widest), 30))
    if not inside[row].any():
        row = int(rows[0])
    edges = np.flatnonzero(np.diff(np.concatenate([[0], inside[row].astype(np.int8), [0]])))
    runs = edges.reshape(-1, 2)
    first, last = runs[np.argmax(runs[:, 1] - runs[:, 0])]
    return (row, int((first + last - 1) // 2)), float(last - first) / inside.shape[1]


def _coordinate(name: str, value: float) -> float:
    """Place of an annotation, which logarithmic axes want as an exponent."""
    return float(np.log10(value)) if name in LOGARITHMIC else float(value)


def _estimate(made: go.PlotFigure, rating: Rating, colour: str, number: int) -> None:
    name = rating.subject or "estimate"
    x, y = (rating.values[axis] for axis in rating.chart.axes)
    outline = _ellipse(rating)
    if outline is not None:
        made.add_trace(
            go.Scatter(
                x=outline[0],
                y=outline[1],
                mode="lines",
                line={"color": colour, "width": 1.6},
                legendgroup=name,
                showlegend=False,
                hoverinfo="skip",
            ),
            row=1,
            col=1,
        )
    made.add_trace(
        go.Scatter(
            x=[x],
            y=[y],
            mode="markers",
            name=f"{name}: {rating.text}",
            legendgroup=name,
            marker={"color": colour, "size": 9, "symbol": ("circle", "diamond", "x")[number % 3]},
        ),
        row=1,
        col=1,
    )


def _ellipse(rating: Rating) -> tuple[Array, Array] | None:
    """Outline of the 95 % region of a normal estimate, in the chart's own scales."""
    axes = rating.chart.axes
    if not set(axes) <= set(rating.samples):
        return None
    drawn = np.array([rating.samples[name] for name in axes])
    logs = [name in LOGARITHMIC for name in axes]
    for row, is_log in enumerate(logs):
        if is_log:
            drawn[row] = np.log(np.maximum(drawn[row], np.finfo(float).tiny))
    factor = np.linalg.cholesky(np.cov(drawn) + 1e-18 * np.eye(2))
    angle = np.linspace(0.0, 2.0 * np.pi, 121)
    ring = ellipse_radius(shown()) * factor @ np.array([np.cos(angle), np.sin(angle)])
    ends = drawn.mean(axis=1)[:, None] + ring
    x, y = (np.exp(end) if is_log else end for end, is_log in zip(ends, logs, strict=True))
    return np.asarray(x), np.asarray(y)


def _level(made: go.PlotFigure, value: float, text: str, row: int) -> None:
    made.add_hline(
        value,
        row=row,
        col=1,
        line={"color": look.LINE, "dash": "dot", "width": 1},
        annotation_text=text,
        annotation_position="bottom left",
        annotation_font={"size": 11},
    )


def _marks(made: go.PlotFigure, found: AttitudeBandwidth) -> None:
    curve, crossing = found.curve, found.omega_180_rad_s
    points: list[tuple[str, float, int, str, str]] = [
        ("ω_180", crossing, 2, look.ORANGE, "circle"),
        ("phase bandwidth", found.phase_bandwidth_rad_s, 2, look.GREEN, "diamond"),
    ]
    if found.gain_bandwidth_rad_s is not None:
        points.append(("gain bandwidth", found.gain_bandwidth_rad_s, 1, look.PURPLE, "square"))
    if found.phase_delay_s is not None:
        points.append(("2 ω_180", 2.0 * crossing, 2, look.ORANGE, "circle-open"))
    for name, omega, row, colour, symbol in points:
        made.add_trace(
            go.Scatter(
                x=[omega],
                y=[curve.at(omega)[row - 1]],
                name=f"{name} {omega:.3g} rad/s",
                mode="markers",
                marker={"color": colour, "size": 9, "symbol": symbol},
            ),
            row=row,
            col=1,
        )
    interval = found.bandwidth.interval(shown())
    if interval is not None:
        made.add_vrect(*interval, fillcolor=look.MODEL, opacity=0.12, line_width=0)


def _slope(made: go.PlotFigure, found: AttitudeBandwidth) -> None:
    """The least-squares line of the phase beyond ω_180."""
    if found.phase_slope_delay_s is None:
        return
    low = found.omega_180_rad_s
    omega = np.linspace(low, min(2.0 * low, float(found.curve.omega[-1])), 60)
    phase = np.interp(np.log(omega), np.log(found.curve.omega), found.curve.degrees)
    line = np.polyval(np.polyfit(omega, phase, 1), omega)
    made.add_trace(
        look.line(
            f"slope: phase delay {found.phase_slope_delay_s:.3g} s",
            omega,
            line,
            colour=look.ORANGE,
            dash="dash",
        ),
        row=2,
        col=1,
    )
