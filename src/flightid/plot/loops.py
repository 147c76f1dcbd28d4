"""Pictures of connections: their blocks, and what a step from outside does."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from flightid.control.loops import Block, Interconnection
from flightid.plot import graph_objects as go
from flightid.plot import look
from flightid.record import Record

COLUMN, ROW, WIDTH, HEIGHT = 1.0, 0.75, 0.68, 0.42
LANE = 0.25
"""Between two lines of feedback."""
ROW_PX, COLUMN_PX = 90, 165


def diagram(loops: Interconnection) -> go.PlotFigure:
    """Blocks with the signals between them; feedback runs below, from right to left.

    Parameters
    ----------
    loops : Interconnection

    Returns
    -------
    PlotFigure

    Example
    -------
    >>> import flightid as fid
    >>> roll = fid.LinearSystem([[-4.0]], [[20.0]], [[1.0]], [[0.0]], ("lat",), ("p",))
    >>> loop = fid.connect([roll, fid.loops.gain("p", "lat", -0.2)], inputs=[], outputs=["p"])
    >>> type(diagram(loop)).__name__
    'PlotFigure'
    """
    made, columns = look.figure(1, 1), _columns(loops)
    places: dict[int, tuple[float, float]] = {}
    filled: dict[int, int] = {}
    for number, column in enumerate(columns):
        row = filled.get(column, 0)
        filled[column] = row + 1
        places[number] = (column * COLUMN, -row * ROW)
    rows, width = max(filled.values(), default=1), max(columns, default=0)
    links = _links(loops, columns)
    lanes = [link for link in links if link[3]]
    for lane, (source, target, name, _) in enumerate(lanes):
        low = -(rows - 0.35) * ROW - lane * LANE
        _feedback(made, places[int(source)], places[target], name, low)
    for source, target, name, back in links:
        if not back:
            _arrow(made, _end(places, source, loops), places[target], name)
    for number, block in enumerate(loops.blocks):
        _box(made, places[number], block)
    bottom = -(rows - 0.35) * ROW - len(lanes) * LANE
    made.update_xaxes(visible=False, range=[-1.1, width * COLUMN + 0.6])
    made.update_yaxes(visible=False, range=[bottom, 0.6 * ROW])
    height = int((0.6 * ROW - bottom) / ROW * ROW_PX + 90)
    made.update_layout(
        showlegend=False, height=height, width=max(640, int((width + 1.7) * COLUMN_PX))
    )
    return made


def _columns(loops: Interconnection) -> list[int]:
    """How far from the outside each block stands, by the shortest way."""
    known = dict.fromkeys(loops.inputs, 0)
    columns: list[int | None] = [None] * len(loops.blocks)
    for _ in loops.blocks:
        for number, block in enumerate(loops.blocks):
            reached = [known[name] for name in block.inputs if name in known]
            if columns[number] is None and (reached or not block.inputs):
                columns[number] = max(reached, default=0)
        for number, block in enumerate(loops.blocks):
            column = columns[number]
            if column is not None:
                for name in block.outputs:
                    known.setdefault(name, column + 1)
    return [0 if column is None else column for column in columns]


def _links(
    loops: Interconnection, columns: Sequence[int]
) -> list[tuple[int | str, int, str, bool]]:
    """Source, target, signal and whether it runs back."""
    found: list[tuple[int | str, int, str, bool]] = []
    for target, block in enumerate(loops.blocks):
        for name in dict.fromkeys(block.inputs):
            source = loops.wiring.sources.get(name)
            back = source is not None and columns[source] >= columns[target]
            found.append((name if source is None else source, target, name, back))
    return found


def _end(
    places: dict[int, tuple[float, float]], source: int | str, loops: Interconnection
) -> tuple[float, float]:
    if isinstance(source, int):
        return places[source]
    return (-COLUMN + 0.1, -loops.inputs.index(source) * ROW)


def _arrow(
    made: go.PlotFigure, start: tuple[float, float], end: tuple[float, float], name: str
) -> None:
    tail = (start[0] + (0.5 * WIDTH if start[0] >= -0.5 else 0.0), start[1])
    head = (end[0] - 0.5 * WIDTH, end[1])
    _head(made, tail, head, look.BLACK)
    made.add_annotation(
        x=0.5 * (head[0] + tail[0]), y=0.5 * (head[1] + tail[1]) + 0.09, text=name,
        showarrow=False, font={"size": 10, "color": look.BLACK},
    )  # fmt: skip


def _feedback(
    made: go.PlotFigure, start: tuple[float, float], end: tuple[float, float], name: str, low: float
) -> None:
    """Below all blocks, from the bottom of one to the bottom of another."""
    colour = look.RIVAL
    (x0, y0), (x1, y1) = start, end
    path = f"M {x0 + 0.1},{y0 - HEIGHT / 2} L {x0 + 0.1},{low} L {x1},{low}"
    made.add_shape(type="path", path=path, line={"color": colour, "width": 1.3})
    _head(made, (x1, low), (x1, y1 - HEIGHT / 2), colour)
    made.add_annotation(
        x=0.5 * (x0 + x1), y=low + 0.08, text=name, showarrow=False,
        font={"size": 10, "color": colour},
    )  # fmt: skip


def _head(
    made: go.PlotFigure, tail: tuple[float, float], head: tuple[float, float], colour: str
) -> None:
    made.add_annotation(
        x=head[0], y=head[1], ax=tail[0], ay=tail[1], xref="x", yref="y", axref="x", ayref="y",
        showarrow=True, arrowhead=2, arrowwidth=1.3, arrowcolor=colour, text="",
    )  # fmt: skip


def _box(made: go.PlotFigure, place: tuple[float, float], block: Block) -> None:
    x, y = place
    made.add_shape(
        type="rect", x0=x - WIDTH / 2, x1=x + WIDTH / 2, y0=y - HEIGHT / 2, y1=y + HEIGHT / 2,
        line={"color": look.BLUE, "width": 1.4}, fillcolor="white",
    )  # fmt: skip
    what = str(block).replace(" … ", "…")
    made.add_annotation(
        x=x, y=y, showarrow=False, font={"size": 10, "color": look.BLACK},
        text=f"<b>{block.name[:19]}</b><br>{what if len(what) <= 20 else what[:19] + '…'}",
    )  # fmt: skip


def step(
    loops: Interconnection,
    source: str,
    *,
    size: float = 1.0,
    duration_s: float = 10.0,
    sample_time_s: float = 0.01,
    outputs: Sequence[str] | None = None,
) -> go.PlotFigure:
    """Answers of signals to a step from outside, limits included.

    Parameters
    ----------
    loops : Interconnection
    source : str
        Input that steps; the others rest.
    size : float
        In the input's unit.
    duration_s, sample_time_s : float
        s.
    outputs : sequence of str, optional
        Signals to draw; those of the connection when left out.

    Returns
    -------
    PlotFigure

    Example
    -------
    >>> import flightid as fid
    >>> roll = fid.LinearSystem([[-4.0]], [[20.0]], [[1.0]], [[0.0]], ("lat",), ("p",))
    >>> loop = fid.connect([roll], inputs=["lat"], outputs=["p"])
    >>> len(step(loop, "lat", duration_s=1.0).data)
    1
    """
    shown = tuple(loops.outputs if outputs is None else outputs)
    time_s = sample_time_s * np.arange(round(duration_s / sample_time_s) + 1)
    inputs = {name: np.full(len(time_s), size if name == source else 0.0) for name in loops.inputs}
    units = {name: unit for name, unit in loops.units.items() if name in inputs}
    record = Record.from_arrays(time_s, inputs=inputs, units=units)
    found = loops.simulate(record, outputs=shown, hold="zero")
    made = look.figure(len(shown), 1)
    for row, name in enumerate(shown, start=1):
        line = {"color": look.MODEL}
        trace = go.Scatter(x=time_s, y=found[name], name=name, line=line, showlegend=False)
        made.add_trace(trace, row=row, col=1)
        made.update_yaxes(title_text=look.axis_title(name, loops.units.get(name, "")), row=row)
    made.update_xaxes(title_text=look.axis_title("time", "s"), row=len(shown))
    return made
