"""Frequency responses of one model as pictures: every estimate, the model, and the truth."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

from flightid.plot import look
from flightid.plot.frequency_response import Curve, bode, bode_page
from flightid.report.content import Figure
from flightid.report.figures import figure_block
from flightid.report.glossary import channel_words
from flightid.responses.response_band import ResponseIntervals, response_bands
from flightid.study.estimate_tables import WORDS
from flightid.uncertainty.quantiles import interval_words, shown

MODEL, GUIDE = "model", 0.6
ALONE, PAGE = 4, 9
"""Most responses that have a picture each, and how many small ones make a picture else."""

Known = Mapping[tuple[str, str], ResponseIntervals | None]
"""Intervals by output and input."""

if TYPE_CHECKING:
    from flightid.study.identified import ModelResults
    from flightid.study.truth import Truth


def response_figures(item: ModelResults, truth: Truth | None) -> list[Figure]:
    """One picture for each fitted response, best fit first; of a structure, for each tested.

    Parameters
    ----------
    item : ModelResults
        With responses.
    truth : Truth or None
        What should have been found, where the flight was simulated.

    Returns
    -------
    list of Figure
    """
    fit, response = item.fit, item.response
    if response is None:
        return []
    if fit is not None and fit.responses:
        names = list(fit.ranked)
    else:
        names = [f"{output}/{name}" for output in response.outputs for name in response.inputs]
    bands = {} if fit is None else {each.name: each.band_rad_s for each in fit.responses}
    first = next(iter(item.responses.values())).shown
    known = response_bands(first, [_pair(name) for name in names], level=shown())
    if len(names) <= ALONE:
        return [_figure(item, name, truth, bands.get(name), known) for name in names]
    parts = [names[start : start + PAGE] for start in range(0, len(names), PAGE)]
    return [_page(item, part, truth, bands, known) for part in parts]


def _pair(name: str) -> tuple[str, str]:
    """Output and input of a response."""
    output, source = name.split("/")
    return output, source


def _page(
    item: ModelResults,
    names: list[str],
    truth: Truth | None,
    bands: Mapping[str, tuple[float, float]],
    known: Known,
) -> Figure:
    """Small pictures of several responses."""
    cells, costs = {name: _curves(item, name, truth, known)[0] for name in names}, {}
    if item.fit is not None:
        costs = {name: f" ({item.fit.costs[name]:.3g})" for name in names if name in bands}
    first = WORDS[next(iter(item.responses))]
    modelled = any(curve.name == MODEL for curves in cells.values() for curve in curves)
    said = f"{first} with its {interval_words(shown())} band{', and model' if modelled else ''}"
    said += ": " + ", ".join(f"{name}{costs.get(name, '')}" for name in names)
    said += "; in brackets the cost, the best fit first" if costs else ""
    said += "; grey: beyond the band of the fit" if bands else ""
    page = bode_page(cells, minimum_coherence=_least(item), bands_rad_s=bands)
    return figure_block(page, f"{said}.")


def _least(item: ModelResults) -> float:
    """Guideline of coherence: what chose inputs, or the usual where coherence only weighs."""
    chosen = item.settings.structure is not None
    return item.settings.response.minimum_coherence if chosen else GUIDE


def _figure(
    item: ModelResults,
    name: str,
    truth: Truth | None,
    band: tuple[float, float] | None,
    known: Known,
) -> Figure:
    curves, said = _curves(item, name, truth, known)
    output, source = _pair(name)
    response = item.response
    assert response is not None
    unit = response.pair(output, source).unit
    ends = curves[0].omega_rad_s[[0, -1]]
    beyond = band is not None and (ends[0] < band[0] or ends[1] > band[1])
    grey = "; grey: beyond the band of the fit" if beyond else ""
    picture = bode(curves, unit=unit, minimum_coherence=_least(item), band_rad_s=band)
    return figure_block(picture, f"{said}{grey}.")


def _curves(
    item: ModelResults, name: str, truth: Truth | None, known: Known
) -> tuple[list[Curve], str]:
    """Curves of one response, and what they are in words."""
    output, source = _pair(name)
    curves = []
    for number, (method, response) in enumerate(item.responses.items()):
        pair = response.shown.pair(output, source)
        own = known[output, source] if number == 0 else None
        curves.append(
            Curve(
                WORDS[method],
                pair.omega_rad_s,
                pair.response,
                colour=look.MEASURED if number == 0 else look.SERIES[number],
                dash="solid" if number == 0 else "dash",
                coherence=pair.coherence,
                intervals=own,
            )
        )
    omega, fit = curves[0].omega_rad_s, item.fit
    units = item.response.units if item.response is not None else {}
    sides = [channel_words(each, units.get(each, "")) for each in (output, source)]
    said = f"{' to '.join(sides)}: {curves[0].name} with its {interval_words(shown())} band"
    exact = None
    # A NARX model has no frequency response, and inputs without coherence are in no model.
    if fit is not None and source in fit.model.inputs and hasattr(fit.model, "frequency_response"):
        row, column = fit.model.outputs.index(output), fit.model.inputs.index(source)
        fitted = fit.model.frequency_response(omega)[row, column]
        curves.append(Curve(MODEL, omega, fitted, colour=look.MODEL))
        said += ", and model" if fit.responses else ", and model fitted in time"
        if name in fit.costs and len(fit.costs) > 1:
            place = {fit.ranked[0]: ", the best fit", fit.ranked[-1]: ", the worst fit"}
            said += f"; cost {fit.costs[name]:.3g}{place.get(name, '')}"
        exact = None if truth is None else truth.response(fit.model, omega)
    if exact is not None and fit is not None and len(fit.responses) == 1:
        curves.append(Curve("truth", omega, exact, colour=look.TRUTH, dash="dot"))
        said += "; truth dotted"
    return curves, said
