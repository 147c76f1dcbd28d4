"""Pictures of a simulated record: what went in, what came out, measured beside."""

from __future__ import annotations

from flightid.plot import graph_objects as go
from flightid.plot import look
from flightid.plot.record import Panel, Trace, time_histories
from flightid.record import Record
from flightid.units import DIMENSIONLESS


def simulated_history(simulated: Record, measured: Record | None = None) -> go.PlotFigure:
    """Inputs above outputs over time; measured channels of the same names beside the outputs.

    Parameters
    ----------
    simulated : Record
        As `flightid.simulate` makes it.
    measured : Record, optional
        On the same time base.

    Returns
    -------
    PlotFigure
    """
    panels = [
        Panel(
            _titled(simulated, name),
            (Trace("input", simulated.time_s, simulated[name], colour=look.GREEN),),
        )
        for name in simulated.inputs
    ]
    for name in simulated.outputs:
        traces = [Trace("simulated", simulated.time_s, simulated[name], colour=look.MODEL)]
        if measured is not None and name in measured:
            traces.insert(0, Trace("measured", measured.time_s, measured[name]))
        panels.append(Panel(_titled(simulated, name), tuple(traces)))
    return time_histories(panels)


def _titled(record: Record, name: str) -> str:
    unit = record.unit(name)
    return name if unit == DIMENSIONLESS else f"{name} [{unit}]"
