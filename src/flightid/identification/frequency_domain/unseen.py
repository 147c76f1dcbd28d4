"""Parameters that no fitted pair answers to: a fit leaves them where they started.

What a pair outside the fit does leaks into the estimates of the others by their windows. A search
that takes this leakage out has to move such a parameter, which the last decimals of a cost may
pull anywhere: that number is not an estimate, and no model may carry it on. The fitted pairs are
the same without it.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

from flightid.identification.fit import Fit
from flightid.identification.fit_findings import judge_parameters
from flightid.models import GreyBoxModel


def with_starts(fit: Fit, model: GreyBoxModel) -> Fit:
    """The fit with each parameter that it did not see at its value in `model`."""
    starts = {
        name: float(model.parameters[name].value or 0.0)
        for name, found in fit.parameters.items()
        if found.status == "not seen"
    }
    if not starts:
        return fit
    back = fit.model.with_values(starts)
    moved = {
        name: replace(found, value=float(back.parameters[name].value or 0.0))
        for name, found in fit.parameters.items()
        if found.value != back.parameters[name].value
    }
    said = {**fit.parameters, **moved}
    minima = tuple(replace(each, values=_at(each.values, starts)) for each in fit.minima)
    return replace(
        fit,
        model=back,
        parameters=said,
        minima=minima,
        findings=(
            *(each for each in fit.findings if each.code != "not-seen"),
            *judge_parameters({name: said[name] for name in starts}),
        ),
    )


def _at(values: Mapping[str, float], starts: Mapping[str, float]) -> dict[str, float]:
    return {name: starts.get(name, value) for name, value in values.items()}
