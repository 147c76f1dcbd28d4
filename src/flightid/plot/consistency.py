"""Kinematic consistency: measured outputs beside those rebuilt from rates and accelerations."""

from __future__ import annotations

from flightid.conditioning.consistency_result import KinematicConsistency
from flightid.plot import graph_objects as go
from flightid.plot import look
from flightid.plot.record import Panel, Trace, time_histories


def consistency(result: KinematicConsistency) -> go.PlotFigure:
    """Draw each output as measured and as rebuilt with the estimated instrument errors.

    Parameters
    ----------
    result : KinematicConsistency
        Result of `flightid.conditioning.check_consistency`.

    Returns
    -------
    PlotFigure
    """
    time_s = result.corrected.time_s
    return time_histories(
        [
            Panel(
                name,
                (
                    Trace("measured", time_s, result.measured[name]),
                    Trace("rebuilt", time_s, values, look.MODEL),
                ),
            )
            for name, values in result.reconstructed.items()
        ]
    )
