"""Pictures: one file per noun, each with functions that take a result and return a `PlotFigure`.

Conventions. A function is named for the picture (`bode`, `time_histories`), takes the result first
and options by keyword, computes nothing that a result could hold, and begins with
`flightid.plot.look.figure`. Every axis names its quantity and unit (`look.axis_title`). Frequency
axes are logarithmic in rad/s; phase is in degrees, the one place where flightid shows degrees
unasked. Series keep their colour throughout a report: measured grey-black, model blue, a rival
estimate orange, truth green. Colours are Okabe and Ito's, which colour-blind readers tell apart,
and no meaning rests on colour alone: series differ in dash or marker too.
"""

from flightid.plot.fit import EstimateBar, parameter_intervals
from flightid.plot.frequency_response import Curve, bode
from flightid.plot.inputs import input_figure
from flightid.plot.loops import diagram, step
from flightid.plot.margins import loop_bode, loop_nichols, loop_nyquist
from flightid.plot.modes import pole_map
from flightid.plot.pictures import fit_picture, record_history
from flightid.plot.record import Panel, Trace, time_histories

__all__ = [
    "Curve",
    "EstimateBar",
    "Panel",
    "Trace",
    "bode",
    "diagram",
    "fit_picture",
    "input_figure",
    "loop_bode",
    "loop_nichols",
    "loop_nyquist",
    "parameter_intervals",
    "pole_map",
    "record_history",
    "step",
    "time_histories",
]


def __dir__() -> list[str]:
    return sorted(__all__)
