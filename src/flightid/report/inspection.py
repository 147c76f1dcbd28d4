"""Pages of what a file holds: a log with its verdicts and histories, or the columns of records."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from flightid.errors import FlightidError
from flightid.inspection import Inspection
from flightid.inspection.carried import carried_sentence
from flightid.inspection.signals import Signal, find
from flightid.logs import Log
from flightid.plot import graph_objects as go
from flightid.plot import look
from flightid.plot.record import Panel, Trace, time_histories
from flightid.record.contents import table_contents
from flightid.record.formats import ColumnTable, file_format
from flightid.record.tables import read_table
from flightid.record.time_columns import with_time
from flightid.report.content import Block, Document, Lights, Paragraph, Section, TableBlock
from flightid.report.figures import figure_block
from flightid.units import conversion_factor

RATES = ("p", "q", "r")
FOLDED = 8
"""Rows from which a table of messages is opened on demand."""
MOST_PANELS = 24
CAPTION = "Throttle, and body rates beside their set-points; shaded: in the air"


def inspection_document(log: Log, inspection: Inspection) -> Document:
    """A page of what a log holds and can carry.

    Parameters
    ----------
    log : Log
    inspection : Inspection
        Of that log.
    """
    blocks: list[Block] = [Paragraph(carried_sentence(inspection))]
    if drawn := _histories(log, inspection):
        blocks.append(figure_block(drawn, CAPTION))
    blocks.append(Lights(inspection.findings))
    blocks += [TableBlock(each, len(each.rows) > FOLDED) for each in inspection.tables()[1:]]
    head = f"{inspection.firmware or inspection.kind}, {inspection.logged_words}"
    return Document(
        f"Inspection of {inspection.name}", head, (Section("What this log holds", tuple(blocks)),)
    )


def _histories(log: Log, inspection: Inspection) -> go.PlotFigure | None:
    """Throttle and body rates over the log; None of one that holds neither."""
    throttle = find(log, "thrust")
    panels = [] if throttle is None else [Panel("throttle [%]", (_trace(throttle, 100.0),))]
    for name in RATES:
        rate, asked = find(log, name), find(log, f"{name}_ref")
        if rate is None:
            continue
        wanted = () if asked is None else (_trace(asked, _degrees(asked), "asked for"),)
        traces = (_trace(rate, _degrees(rate), "measured"), *wanted)
        panels.append(Panel(f"{name} [deg/s]", traces))
    if not panels:
        return None
    made = time_histories(panels)
    if throttle is not None:
        made.update_yaxes(rangemode="tozero", row=1)
    for start_s, stop_s in inspection.phases.airborne:
        for row in range(1, len(panels) + 1):
            made.add_vrect(start_s, stop_s, row=row, fillcolor=look.AIR, line={"width": 0})
    titles = [panel.title for panel in panels]
    look.label_axes(made, x="time on the autopilot's clock [s]", y=titles)
    return made


def _degrees(signal: Signal) -> float:
    return float(np.degrees(1.0)) if signal.unit == "rad/s" else 1.0


def _trace(signal: Signal, factor: float, name: str = "") -> Trace:
    colour, dash = (look.ORANGE, "dash") if name == "asked for" else (look.BLUE, "solid")
    if not name:
        colour = look.BLACK
    values = factor * signal.values
    return Trace(name or "throttle", signal.time_s, values, colour, dash)


def contents_document(path: Path) -> Document:
    """A page of the columns of a file of records.

    Parameters
    ----------
    path : Path

    Raises
    ------
    FileFormatError
        The content is of no known format, damaged or too large.
    """
    contents = table_contents(path)
    table = read_table(path, file_format(path), ())
    names = [str(row[0]) for row in contents.rows if row[-1] is not None]
    drawn, along = _columns(table, names[:MOST_PANELS])
    blocks: list[Block] = [TableBlock(contents)]
    if drawn is not None:
        left = len(names) - MOST_PANELS
        rest = f"; {left} more columns are not drawn" if left > 0 else ""
        blocks.insert(0, figure_block(drawn, f"Columns that move, over {along}{rest}"))
    return Document(
        f"Inspection of {path.name}",
        contents.title,
        (Section("What this file holds", tuple(blocks)),),
    )


def _columns(table: ColumnTable, names: list[str]) -> tuple[go.PlotFigure | None, str]:
    """Histories of columns, and what they are drawn over."""
    try:
        timed, stamps = with_time(table, None)
    except FlightidError:
        timed, stamps = table, ""
    known = table.clock is not None or stamps in timed.lengths
    panels = []
    for name in names:
        if name == stamps:
            continue
        values = np.asarray(timed.raw(name), dtype=np.float64)
        title = look.axis_title(name, timed.unit(name) or "")
        panels.append(Panel(title, (Trace(name, _stamps(timed, name, stamps), values),)))
    if not panels:
        return None, ""
    made = time_histories(panels)
    made.update_layout(showlegend=False)
    if not known:
        for axis in made.select_xaxes():
            if axis.title.text:
                axis.title.text = "sample"
    return made, "time" if known else "samples: no time is told"


def _stamps(
    table: ColumnTable, name: str, stamps: str
) -> np.ndarray[tuple[int], np.dtype[np.float64]]:
    if table.clock is not None:
        return np.asarray(table.clock(name).time_s, dtype=np.float64)
    if stamps not in table.lengths:
        return np.arange(float(table.lengths[name]))
    raw = np.asarray(table.raw(stamps), dtype=np.float64)
    return raw * conversion_factor(table.unit(stamps) or "s", "s")
