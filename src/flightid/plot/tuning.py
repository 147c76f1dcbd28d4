"""Tuned gains: steps and disturbances, loops in the Nichols plane, and what each gain trades."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from flightid.control.tuning.pid_design import PidDesign
from flightid.errors import UnknownNameError
from flightid.plot import graph_objects as go
from flightid.plot import look
from flightid.plot.record import sparse

Array = NDArray[np.float64]
SHOWN = 16
POINTS_ACROSS = 80
"""Points of a curve that is as long as the window is wide."""
TITLES = {
    "rate step": ("rate, its set-point 1", "rad/s"),
    "angle step": ("angle, its set-point 1", "rad"),
    "disturbance to rate": ("rate, disturbed by 1", "rad/s"),
    "disturbance to angle": ("angle, disturbed by 1", "rad"),
    "step": ("output, its set-point 1", ""),
    "disturbance": ("output, disturbed by 1 at the input", ""),
}
PHASE_WINDOW_DEG, GAIN_WINDOW_DB = (-270.0, -45.0), (-30.0, 30.0)
GRID = 25
MAP_PLANTS, MAP_STRIDE = 8, 3
WIDEST = 2.0
"""Factor by which the trade-off map goes beyond the new gains."""


def time_responses(design: PidDesign) -> go.PlotFigure:
    """Draw steps and disturbances: the estimate, the extremes of all plants, and the flown gains.

    Parameters
    ----------
    design : PidDesign
        Result of `flightid.tune_pid`.

    Returns
    -------
    PlotFigure
    """
    names = [name for name in TITLES if any(each.name == name for each in design.responses)]
    columns = 2
    rows = max(1, (len(names) + 1) // columns)
    made = look.figure(rows, columns, shared_x=False, height_px=130 + 270 * rows)
    for place, name in enumerate(names):
        found = design.response(name)
        row, column = place // columns + 1, place % columns + 1
        few = sparse(found.time_s.size)
        time_s, low, high = (each[few] for each in (found.time_s, found.low, found.high))
        for edge in look.band("new gains", time_s, low, high, colour=look.MODEL):
            made.add_trace(edge, row=row, col=column)
        curves = [("new gains", found.estimate, look.MODEL, "solid")]
        if found.flown is not None:
            curves.append(("flown gains", found.flown, look.RIVAL, "dash"))
        for label, values, colour, dash in curves:
            line = look.line(
                label, time_s, values[few], colour=colour, dash=dash, legend=place == 0
            )
            made.add_trace(line, row=row, col=column)
        words, unit = TITLES[name]
        made.update_yaxes(title_text=look.axis_title(words, unit), row=row, col=column)
        if row == rows:
            made.update_xaxes(title_text="time [s]", row=row, col=column)
    return made


def nichols(design: PidDesign) -> go.PlotFigure:
    """Draw the loops in the Nichols plane with the zone that they must leave free.

    Parameters
    ----------
    design : PidDesign

    Returns
    -------
    PlotFigure
    """
    problem = design.problem
    count = min(SHOWN, len(problem.plants))
    plants = problem.plants.take(list(range(count)))
    keep = plants.omega_rad_s > 0.2 / problem.time_scale
    named = {
        label: dict(problem.loops(_gains(design, label)[None], plants).named())
        for label in _labels(design)
    }
    loops = list(named["new gains"])
    made = look.figure(1, len(loops), column_titles=loops, shared_x=False, height_px=480)
    for column, loop in enumerate(loops, 1):
        for label in reversed(_labels(design)):
            colour = look.MODEL if label == "new gains" else look.RIVAL
            rows = named[label][loop][0][:, keep]
            first, *others = (_nichols_curve(row) for row in rows)
            curves = [(first, 2.0)]
            if others and label == "new gains":
                # One series, with a gap after each plant: NaN breaks a line.
                joined = np.concatenate([np.c_[each, [[np.nan], [np.nan]]] for each in others], 1)
                curves.append((joined, 0.5))
            for (phase, gain), width in curves:
                line = look.line(
                    label, phase, gain, colour=colour, width=width,
                    legend=column == 1 and width > 1.0,
                )  # fmt: skip
                made.add_trace(line, row=1, col=column)
        made.add_trace(_zone(design, legend=column == 1), row=1, col=column)
        made.update_xaxes(
            title_text="phase [deg]", range=PHASE_WINDOW_DEG, dtick=45, row=1, col=column
        )
        made.update_yaxes(range=GAIN_WINDOW_DB, row=1, col=column)
    made.update_yaxes(title_text="gain [dB]", row=1, col=1)
    made.update_layout(hovermode="closest", legend={"y": 1.1})
    return made


def gain_map(design: PidDesign, across: str = "P", up: str = "D") -> go.PlotFigure:
    """Draw what two gains trade: the area that meets all requirements, and how good it is.

    The other gains keep their ratio to P, so that a loop keeps its shape along a ray.

    Parameters
    ----------
    design : PidDesign
    across, up : {"P", "I", "D", "A"}
        Gains to vary.

    Returns
    -------
    PlotFigure

    Raises
    ------
    UnknownNameError
        The axis has no such gain.
    """
    problem = design.problem
    for kind in (across, up):
        if kind not in problem.kinds:
            raise UnknownNameError(
                "there is no such gain", found=kind, needed=", ".join(problem.kinds)
            )
    x, y = problem.kinds.index(across), problem.kinds.index(up)
    worth = _worth(design)
    best = _gains(design, "new gains") * worth
    sides = [np.linspace(1 / WIDEST, WIDEST, GRID) * _scale(best, problem.high, k) for k in (x, y)]
    table = np.repeat(best[None], GRID * GRID, axis=0)
    table[:, x], table[:, y] = (each.ravel() for each in np.meshgrid(*sides))
    ratio = table[:, problem.kinds.index("P")] / best[problem.kinds.index("P")]
    for k, kind in enumerate(problem.kinds):
        if k not in (x, y) and kind in "ID":
            table[:, k] = best[k] * ratio
    problem = problem.with_plants(
        problem.plants.take(list(range(min(MAP_PLANTS, len(problem.plants))))).thinned(MAP_STRIDE)
    )
    parts = [problem.judge(part) for part in np.array_split(table, 12)]
    slack = np.concatenate([each.slack.min(axis=(0, 2)) for each in parts]).reshape(GRID, GRID)
    merit = np.concatenate([each.objective.min(axis=1) for each in parts]).reshape(GRID, GRID)
    sides = [side / worth[place] for side, place in zip(sides, (x, y), strict=True)]
    return _map_figure(design, sides, (x, y), slack, merit)


def _map_figure(
    design: PidDesign, sides: list[Array], places: tuple[int, int], slack: Array, merit: Array
) -> go.PlotFigure:
    made = look.figure(height_px=520)
    names = [change.name for change in design.changes]
    shown = np.where(slack > -1.0, 20.0 / np.log(10.0) * (merit - merit.max()), np.nan)
    top = float(np.nanmax(np.where(slack >= 0.0, shown, np.nan))) if (slack >= 0).any() else 0.0
    made.add_trace(
        go.Contour(
            x=sides[0], y=sides[1], z=shown - top, colorscale="Greys", reversescale=True,
            contours={"coloring": "heatmap", "showlines": False}, opacity=0.6,
            zmin=-6.0, zmax=6.0, colorbar={"title": {"text": "objective [dB]"}}, name="objective",
        )
    )  # fmt: skip
    made.add_trace(
        go.Contour(
            x=sides[0], y=sides[1], z=np.clip(slack, -1.0, 1.0), showscale=False,
            contours={"coloring": "lines", "start": 0.0, "end": 0.0, "size": 1.0},
            line={"width": 3, "color": look.TRUTH}, colorscale=[[0, look.TRUTH], [1, look.TRUTH]],
            name="all requirements met", showlegend=True,
        )
    )  # fmt: skip
    for label in _labels(design):
        colour, symbol = (look.MODEL, "star") if label == "new gains" else (look.RIVAL, "circle")
        gains = _gains(design, label)
        made.add_trace(
            go.Scatter(
                x=[gains[places[0]]], y=[gains[places[1]]], name=label, mode="markers",
                marker={"color": colour, "symbol": symbol, "size": 14},
            )
        )  # fmt: skip
    made.update_xaxes(title_text=names[places[0]])
    made.update_yaxes(title_text=names[places[1]])
    made.update_layout(hovermode="closest")
    return made


def _scale(gains: Array, high: Array, place: int) -> float:
    """Size about which a gain varies; one that is zero starts from a part of its range."""
    return float(gains[place]) if gains[place] > 0.0 else 0.05 * float(high[place])


def _labels(design: PidDesign) -> list[str]:
    return ["new gains", "flown gains"] if design.flown.has_flown else ["new gains"]


def _gains(design: PidDesign, label: str) -> Array:
    loop = design.loop if label == "new gains" else design.flown
    found = [design.gains[change.name] for change in design.changes]
    if label == "flown gains":
        found = [change.flown or 0.0 for change in design.changes]
    gains = np.array(found)
    if "angle_tc" in loop.names and "A" in design.problem.kinds:
        gains[-1] = 1.0 / gains[-1]
    return gains


def _worth(design: PidDesign) -> Array:
    """What one of each gain is worth to the loops: a firmware's parameters may be counts."""
    roles = [kind.lower() for kind in design.problem.kinds]
    return np.array([design.loop.unit_of(role) if role in "pid" else 1.0 for role in roles])


def _nichols_curve(loop: NDArray[np.complex128]) -> Array:
    """Phase on the branch of an integrator, degrees, and gain, dB: what the window shows of them.

    Points nearer to each other than a screen tells apart are left out.
    """
    phase = np.degrees(np.unwrap(np.angle(loop)))
    crossing = int(np.argmin(np.abs(np.log(np.abs(loop)))))
    phase -= 360.0 * np.round((phase[crossing] + 135.0) / 360.0)
    curve = np.stack([phase, 20.0 * np.log10(np.abs(loop))])
    lows, highs = np.transpose([PHASE_WINDOW_DEG, GAIN_WINDOW_DB])
    size = (highs - lows)[:, None]
    seen = np.all(np.abs(curve - (0.5 * (lows + highs))[:, None]) < 0.6 * size, axis=0)
    way = np.cumsum(np.hypot(*np.diff(curve / size, axis=1, prepend=curve[:, :1] / size)))
    step = np.diff(np.floor(POINTS_ACROSS * way), prepend=-1.0) > 0.0
    drawn = np.where(seen, curve, np.nan)
    return drawn[:, step & (seen | np.roll(seen, 1))]


def _zone(design: PidDesign, *, legend: bool) -> go.Node:
    """Where the sensitivity would be above the limit, about the critical point."""
    turn = np.linspace(0.0, 2.0 * np.pi, 181)
    points = -1.0 + np.exp(1j * turn) / design.requirements.peak
    phase = np.degrees(np.angle(points))
    phase = np.where(phase > 0.0, phase - 360.0, phase)
    return go.Scatter(
        x=phase, y=20.0 * np.log10(np.abs(points)), name="sensitivity too high",
        mode="lines", fill="toself",
        fillcolor="rgba(128,128,128,0.35)", line={"width": 0}, showlegend=legend,
        legendgroup="zone", hoverinfo="skip",
    )  # fmt: skip
