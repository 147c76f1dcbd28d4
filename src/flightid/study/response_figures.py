"""Frequency responses of one model as pictures: every estimate, the model, and the truth."""

from __future__ import annotations

from typing import TYPE_CHECKING

from flightid.plot import look
from flightid.plot.frequency_response import Curve, bode
from flightid.report.content import Figure
from flightid.report.figures import figure_block
from flightid.responses.response_band import response_band
from flightid.study.estimate_tables import WORDS
from flightid.uncertainty.quantiles import interval_words, shown

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
    return [_figure(item, name, truth) for name in names]


def _figure(item: ModelResults, name: str, truth: Truth | None) -> Figure:
    output, source = name.split("/")
    curves = []
    for number, (method, response) in enumerate(item.responses.items()):
        pair = response.pair(output, source)
        own = response_band(response, source, output, level=shown()) if number == 0 else None
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
    said = f"{output} to {source}: {curves[0].name} with its {interval_words(shown())} band"
    exact = None
    # A NARX model has no frequency response, and inputs without coherence are in no model.
    if fit is not None and source in fit.model.inputs and hasattr(fit.model, "frequency_response"):
        row, column = fit.model.outputs.index(output), fit.model.inputs.index(source)
        fitted = fit.model.frequency_response(omega)[row, column]
        curves.append(Curve("model", omega, fitted, colour=look.MODEL))
        said += ", and model" if fit.responses else ", and model fitted in time"
        if name in fit.costs and len(fit.costs) > 1:
            place = {fit.ranked[0]: ", the best fit", fit.ranked[-1]: ", the worst fit"}
            said += f"; cost {fit.costs[name]:.3g}{place.get(name, '')}"
        exact = None if truth is None else truth.response(fit.model, omega)
    if exact is not None and fit is not None and len(fit.responses) == 1:
        curves.append(Curve("truth", omega, exact, colour=look.TRUTH, dash="dot"))
        said += "; truth dotted"
    least = item.settings.response.minimum_coherence
    if item.settings.structure is None:
        return figure_block(bode(curves, unit=pair.unit), f"{said}.")
    return figure_block(bode(curves, unit=pair.unit, minimum_coherence=least), f"{said}.")
