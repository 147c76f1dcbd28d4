"""A measured frequency response: gain and phase with their error bands, and coherence."""

from __future__ import annotations

import math
from collections.abc import Iterable

from flightid.plot import graph_objects as go
from flightid.plot import look
from flightid.plot.frequency_response import Curve, bode
from flightid.responses import FrequencyResponse
from flightid.responses.excited_band import excited_to
from flightid.responses.response_band import response_bands
from flightid.uncertainty.quantiles import shown


def response_figure(
    response: FrequencyResponse,
    pairs: Iterable[tuple[str, str]] | None = None,
    *,
    minimum_coherence: float = 0.6,
) -> go.PlotFigure:
    """Draw measured responses over frequency as they are shown, with 95 % bands.

    Line, band and coherence are of one estimate, `FrequencyResponse.shown`. Of a closed loop all is
    greyed above the power of what excited the inputs.

    Parameters
    ----------
    response : FrequencyResponse
        What was measured.
    pairs : iterable of (output, input), optional
        Responses to draw; default: of each output, the one to the input with most coherence.
    minimum_coherence : float
        Guideline drawn in the coherence plot.

    Returns
    -------
    PlotFigure
    """
    known = response.shown
    chosen = list(pairs) if pairs is not None else leading_pairs(known)
    drawn = [known.pair(output, name) for output, name in chosen]
    bands = response_bands(known, chosen, level=shown())
    curves = [
        Curve(
            f"{pair.output} / {pair.input}",
            pair.omega_rad_s,
            pair.response,
            look.MEASURED if len(drawn) == 1 else look.SERIES[index % len(look.SERIES)],
            look.DASHES[index % len(look.DASHES)],
            pair.coherence,
            intervals=bands[pair.output, pair.input],
        )
        for index, pair in enumerate(drawn)
    ]
    units = {pair.unit for pair in drawn}
    unit = units.pop() if len(units) == 1 else ""
    end = min((excited_to(response, name) for _, name in chosen), default=math.inf)
    band = (float(response.omega_rad_s[0]), end) if math.isfinite(end) else None
    return bode(curves, unit=unit, minimum_coherence=minimum_coherence, band_rad_s=band)


def leading_pairs(response: FrequencyResponse) -> list[tuple[str, str]]:
    """For each output, the input to which it is most coherent on average."""
    best = response.coherence.mean(axis=2).argmax(axis=1)
    return [
        (output, response.inputs[column])
        for output, column in zip(response.outputs, best, strict=True)
    ]
