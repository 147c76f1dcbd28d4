"""Loops before and after: gain and phase of both, one over the other."""

from __future__ import annotations

import numpy as np

from flightid.plot import graph_objects as go
from flightid.plot import look
from flightid.plot.margins import GUIDE, SEEN_DB, SEEN_DEG, add_band, drawn_curve, seen_limits
from flightid.review import MarginComparison


def compared_loops(result: MarginComparison) -> go.PlotFigure:
    """Gain and phase of loops before and after, one column of two panels, a loop after the other.

    Parameters
    ----------
    result : MarginComparison

    Returns
    -------
    PlotFigure

    Example
    -------
    >>> import flightid as fid
    >>> yaw = fid.load_model("rate_first_order", axis="yaw")
    >>> found = fid.compare_margins((yaw, {"tau_psi": {"r": 0.1}}), (yaw, {"tau_psi": {"r": 0.2}}))
    >>> type(compared_loops(found)).__name__
    'PlotFigure'
    """
    count = 2 * len(result.before)
    made = look.figure(rows=count, row_heights=(1.0,) * count, height_px=90 + 180 * count)
    titles: list[str] = []
    for place, loop in enumerate(result.before):
        rows, seen = (2 * place + 1, 2 * place + 2), []
        for name, side, colour, dash in zip(
            result.names, (result.before, result.after), (look.ORANGE, look.BLUE),
            ("dash", "solid"), strict=True,
        ):  # fmt: skip
            curve = side[loop].curve
            omega, *curves = drawn_curve(curve, side[loop].crossover)
            # Far below the crossover an integral leaves the picture, and nothing else is there.
            shown = curves[0] <= SEEN_DB[1]
            omega, curves = omega[shown], [each[shown] for each in curves]
            seen.append(curves)
            errors = [
                None if each is None else each[shown]
                for each in (curve.stderr_db, curve.stderr_deg)
            ]
            for row, values, stderr in zip(rows, curves, errors, strict=True):
                add_band(made, omega, values, stderr, row, (name, colour))
                first = not place and row == rows[0]
                line = look.line(name, omega, values, colour=colour, dash=dash, legend=first)
                made.add_trace(line, row=row, col=1)
        for row, level, limits in zip(rows, (0.0, -180.0), (SEEN_DB, SEEN_DEG), strict=True):
            made.add_hline(level, line=GUIDE, row=row, col=1)
            drawn = np.concatenate([each[row - rows[0]] for each in seen])
            made.update_yaxes(range=seen_limits(drawn, limits), row=row, col=1)
        named = f"{loop}: " if len(result.before) > 1 else ""
        titles += [look.axis_title(f"{named}gain", "dB"), look.axis_title("phase", "deg")]
    look.label_axes(made, x="frequency [rad/s]", y=tuple(titles), log_x=True)
    return made
