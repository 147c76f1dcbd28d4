"""The records behind a model, end to end: instruments, inputs, and outputs that were used."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from flightid.plot import graph_objects as go
from flightid.plot import look
from flightid.plot.record import Panel, Trace, time_histories
from flightid.plot.thinning import thinned_on_shared_stamps
from flightid.record import Record

SHOWN_POINTS = 900
"""Twice the pixels of a plot in two columns."""
STEPS = 2**9
"""Of a channel's range: twice the pixels of a plot's height."""
GAP = 0.01
"""Between two records, of all their time."""


def training_history(
    records: Sequence[Record],
    inputs: Sequence[str],
    outputs: Sequence[str],
    instruments: Sequence[str] = (),
) -> go.PlotFigure:
    """Draw what a model was fitted to, its records one after the other.

    Parameters
    ----------
    records : sequence of Record
        One alone keeps its own time; several follow each other with a gap between them.
    inputs, outputs : sequence of str
        Channels with a plot each; a channel that never moves has none.
    instruments : sequence of str
        Channels that were injected; those of one unit share a plot.

    Returns
    -------
    PlotFigure

    Example
    -------
    >>> made = Record.from_arrays([0.0, 0.1], inputs={"u": [0.0, 1.0]}, outputs={"p": [0.0, 0.2]})
    >>> drawn = training_history([made, made], ["u"], ["p"])
    >>> [trace.name for trace in drawn.data]
    ['input', 'input', 'output', 'output']
    """
    starts = _starts(records)
    injected: dict[str, list[Trace]] = {}
    colours = [each for each in look.SERIES if each not in (look.OTHER, look.MEASURED)]
    for place, name in enumerate(instruments):
        colour = colours[place % len(colours)]
        for trace in _traces(records, starts, name, name, colour):
            injected.setdefault(records[0].unit(name), []).append(trace)
    panels = [Panel(look.axis_title("injected", unit), (*of,)) for unit, of in injected.items()]
    for words, names, colour in (
        ("input", inputs, look.OTHER),
        ("output", outputs, look.MEASURED),
    ):
        for name in names:
            traces = _traces(records, starts, name, words, colour)
            if traces:
                panels.append(Panel(look.axis_title(name, records[0].unit(name)), (*traces,)))
    return time_histories(panels)


def _starts(records: Sequence[Record]) -> list[float]:
    """What is added to the stamps of each record."""
    if len(records) == 1:
        return [0.0]
    lasted = [float(each.time_s[-1] - each.time_s[0]) for each in records]
    gap = GAP * sum(lasted)
    before = np.concatenate([[0.0], np.cumsum([each + gap for each in lasted[:-1]])])
    return [float(at - each.time_s[0]) for at, each in zip(before, records, strict=True)]


def _traces(
    records: Sequence[Record], starts: Sequence[float], name: str, words: str, colour: str
) -> list[Trace]:
    """One channel of all records; none where it never moves."""
    if all(name not in each or np.ptp(each[name]) == 0 for each in records):
        return []
    whole = sum(each.n_samples for each in records)
    widest = max(float(np.ptp(each[name])) for each in records if name in each)
    step = 2.0 ** np.floor(np.log2(widest / STEPS))
    traces = []
    for record, start in zip(records, starts, strict=True):
        if name not in record:
            continue
        share = max(2, 2 * round(0.5 * SHOWN_POINTS * record.n_samples / whole))
        stamps, samples = thinned_on_shared_stamps(record.time_s + start, record[name], share)
        traces.append(Trace(words, stamps, step * np.round(samples / step), colour))
    return traces
