"""Who takes part in a mode: a bar for each, parted by its states."""

from __future__ import annotations

from flightid.dynamics.modes.result import LEAST_SHOWN, Modes
from flightid.errors import DataError
from flightid.plot import graph_objects as go
from flightid.plot import look
from flightid.uncertainty.quantiles import shown

ROW_PX = 30
WORDED = 0.12
"""Shares from this on have room for the name of their state."""


def participation_bars(found: Modes) -> go.PlotFigure:
    """Draw the shares of the states in each mode, its largest first.

    Parameters
    ----------
    found : Modes
        Result of `flightid.modes`.

    Returns
    -------
    PlotFigure

    Raises
    ------
    DataError
        No mode tells its states: those of a black box have no names.

    Reference
    ---------
    Pérez-Arriaga, Verghese & Schweppe, *IEEE Trans. Power Apparatus and Systems* 101 (1982), eq. 5.

    Example
    -------
    >>> import flightid as fid
    >>> made = participation_bars(fid.modes(fid.load_model("fixed_wing_longitudinal")))
    >>> [trace.name for trace in made.data][:2]
    ['theta', 'u']
    """
    told = [mode for mode in found if mode.participations]
    if not told:
        raise DataError("no mode tells which states take part in it", found=found.name)
    made = look.figure(height_px=look.MARGIN_PX + ROW_PX * len(told))
    seen: set[str] = set()
    colours: dict[str, str] = {}
    for mode in told:
        # Each bar by its own order: one trace a state and mode, one entry of the legend a state.
        for part in sorted(mode.participations, key=lambda each: -(each.share.value or 0.0)):
            share = part.share.value or 0.0
            if share < LEAST_SHOWN:
                continue
            colour = colours.setdefault(part.state, look.SERIES[len(colours) % len(look.SERIES)])
            half = part.share.half(shown())
            spread = "" if half is None else f" ± {100.0 * half:.2g}"
            bar = go.Bar(
                x=[100.0 * share], y=[mode.name], orientation="h", width=0.7, name=part.state,
                legendgroup=part.state, showlegend=part.state not in seen,
                marker={"color": colour}, text=[part.state if share >= WORDED else ""],
                textposition="inside", insidetextanchor="middle",
                hovertemplate=f"{mode.name}, {part.state}: %{{x:.3g}}{spread} %<extra></extra>",
            )  # fmt: skip
            seen.add(part.state)
            made.add_trace(bar, 1, 1)
    made.update_layout(barmode="stack", hovermode="closest")
    made.update_xaxes(range=(0.0, 100.0), title_text=look.axis_title("participation", "%"))
    made.update_yaxes(autorange="reversed")
    return made
