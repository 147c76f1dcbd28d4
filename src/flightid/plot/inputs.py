"""What inputs excite: their spectra, and how often they have each size."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from flightid.excitation.spectrum import smoothed_matrix
from flightid.plot import graph_objects as go
from flightid.plot import look
from flightid.record import Record

FREQUENCIES, BINS = 200, 40
TURN = 2 * np.pi
FAINTEST_DB = 60.0
"""How far below its peak a spectrum is drawn."""


def input_figure(record: Record, inputs: Iterable[str] | None = None) -> go.PlotFigure:
    """Draw the spectrum of each input, and beside it the distribution of its amplitudes.

    Spectra are means over third-octave bands of the periodogram about the mean, per Hz.

    Parameters
    ----------
    record : Record
    inputs : iterable of str, optional
        Default: all inputs of the record; those that do not move are left out.

    Returns
    -------
    PlotFigure

    Example
    -------
    >>> made = Record.from_arrays(np.arange(400) / 20, inputs={"u": np.sin(np.arange(400) / 3)})
    >>> [trace.type for trace in input_figure(made).data]
    ['scatter', 'bar']
    """
    names = [n for n in (record.inputs if inputs is None else inputs) if np.ptp(record[n]) > 0]
    made = look.figure(
        max(1, len(names)), 2, column_titles=["spectrum", "distribution"], shared_x=False
    )
    spacing = 2 * np.pi / (record.n_samples * record.sample_time_s)
    omega = np.geomspace(spacing, np.pi / record.sample_time_s, FREQUENCIES)
    for row, name in enumerate(names, 1):
        moved = (record[name] - record[name].mean())[None]
        density = np.real(smoothed_matrix(moved, record.sample_time_s, omega)[0, 0])
        drawn = density > density.max() * 10 ** (-FAINTEST_DB / 10)
        made.add_trace(
            look.line(name, omega[drawn], density[drawn], colour=look.OTHER, legend=False),
            row=row, col=1,
        )  # fmt: skip
        counts, edges = np.histogram(record[name], BINS)
        made.add_trace(
            go.Bar(
                x=0.5 * (edges[1:] + edges[:-1]), y=100 * counts / record.n_samples,
                width=np.diff(edges), name=name, marker={"color": look.OTHER}, showlegend=False,
            ),
            row=row, col=2,
        )  # fmt: skip
        unit = record.unit(name)
        squared = "1/Hz" if unit == "1" else f"({unit})²/Hz"
        made.update_yaxes(type="log", exponentformat="power", dtick=1, row=row, col=1)
        made.update_yaxes(title_text="share of samples [%]", row=row, col=2)
        made.update_xaxes(title_text=look.axis_title(name, unit), row=row, col=2)
        made.update_yaxes(title_text=f"{name} [{squared}]", row=row, col=1)
    decades = [
        (t, f"{t:g}<br>{t / TURN:.2g} Hz") for t in look.LOG_TICKS if np.log10(t) % 1.0 == 0.0
    ]
    for axis in made.select_xaxes(col=1):
        axis.type, (axis.tickvals, axis.ticktext) = "log", zip(*decades, strict=True)
    made.update_xaxes(title_text="frequency [rad/s]", row=max(1, len(names)), col=1)
    # Two lines of tick labels stand above the title.
    made.update_xaxes(title_standoff=4, col=1)
    made.update_layout(margin={"b": 65})
    return made
