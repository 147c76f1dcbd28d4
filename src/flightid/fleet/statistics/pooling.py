"""One model for a type: its mean, with the spread that the next vehicle brings, for `tune`."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from flightid.conventions import Light
from flightid.errors import DataError, ModelError
from flightid.evidence.evidence import BAND, NAMES, Check, Evidence
from flightid.fleet.statistics.population import Population
from flightid.identification.model_error import ModelErrorBound
from flightid.identification.uncertain_of import evidence_behind
from flightid.models.estimated import EstimateProvenance
from flightid.models.model import Model, model_of
from flightid.version import VERSION

Array = NDArray[np.float64]
METHOD = "population"
INTERVALS_FROM = "spread between vehicles and error of the mean: where the next vehicle lies"
UPPER = 0.9
"""Quantile over flights of a model's error against its data that stands for the type."""
ORDER = (Light.RED, Light.AMBER, Light.UNKNOWN, Light.GREEN)
Pair = tuple[float, float]


def pooled_model(population: Population, model: Model, members: Sequence[object] = ()) -> Any:  # noqa: ANN401 — the kind of `model`
    """The type as one model whose covariance is that of the next vehicle.

    What `flightid tune` makes of it holds for the fleet: the plants it draws are vehicles.

    Parameters
    ----------
    population : Population
    model : model
        Structure that all flights were fitted with; parameters that the population does not tell
        keep its values.
    members : sequence of Fit or model with `estimated`, optional
        Fits of the flights: their bands, evidence and errors against data are carried on, red ones
        left out. Without them the model says of no band that it was shown there, and tuning asks
        for one.

    Returns
    -------
    model
        With `estimated`; `write_model` keeps it in a file.

    Raises
    ------
    ModelError
        A parameter of the population that the model lacks, or a mean outside the model's bounds.
    DataError
        Fits of flights all of which are red, or that have no band in common.

    Assumes
    -------
    Vehicles normal about the mean, inside the model's bounds. Biased as the population is: see
    `estimate_population`.

    Reference
    ---------
    Higgins, Thompson & Spiegelhalter, *J. R. Stat. Soc. A* 172 (2009), 137–159 (the next one).
    """
    stray = [name for name in population.names if name not in model.parameters]
    if stray:
        raise ModelError(
            "the population has parameters that the model lacks",
            found=", ".join(stray),
            needed=", ".join(model.parameters),
        )
    means = dict(zip(population.names, map(float, population.spreads.mean), strict=True))
    made: Any = model.with_values(means)
    kept = [each for each in members if _light(each) is not Light.RED]
    if members and not kept:
        raise DataError(
            "every fit of the type is red, so no model is made of them",
            found=f"{len(members)} fits",
            needed="fits that their data support",
        )
    estimated = EstimateProvenance(
        population.names,
        population.next_covariance,
        METHOD,
        INTERVALS_FROM,
        _bands(kept),
        _evidence(kept).to_dict() if kept else {},
        {
            "flightid": VERSION,
            "type": population.type_name,
            "vehicles": len(population.data.members),
            "flights": len(population.data.vehicles),
            "structure": population.spreads.structure,
            **_hold(kept),
        },
        {name: bound.to_dict() for name, bound in _errors(kept).items()},
    )
    return replace(made, estimated=estimated)


def _light(member: object) -> Light:
    examined = evidence_behind(member)
    return Light.UNKNOWN if examined is None else examined.light


def _known(member: object) -> EstimateProvenance | None:
    found = getattr(member, "estimated", None)
    return found if found is not None else getattr(model_of(member), "estimated", None)


def _hold(members: Sequence[object]) -> dict[str, object]:
    """How inputs were held, where all fits were told the same."""
    found = set()
    for each in members:
        known = _known(each)
        provenance: Any = {} if known is None else known.provenance
        options = provenance.get("options", provenance)
        hold = options.get("hold", provenance.get("hold")) if hasattr(options, "get") else None
        found.add(hold if isinstance(hold, str) else None)
    only = found.pop() if len(found) == 1 else None
    return {} if only is None else {"hold": only}


def _common(bands: Sequence[Pair], what: str) -> Pair:
    low, high = max(band[0] for band in bands), min(band[1] for band in bands)
    if not low < high:
        raise DataError(
            f"flights of a type have no band of {what} in common",
            found=f"{low:.3g} rad/s at least, {high:.3g} rad/s at most",
            needed="fits over a common band",
            action="leave out the flights whose sweeps were shorter",
        )
    return low, high


def _bands(members: Sequence[object]) -> dict[str, Pair]:
    """Band of each response that all flights have in common."""
    several = [known.bands for each in members if (known := _known(each)) is not None]
    names = set(several[0]).intersection(*several) if several else set()
    return {name: _common([bands[name] for bands in several], name) for name in sorted(names)}


def _errors(members: Sequence[object]) -> dict[str, ModelErrorBound]:
    """Error of the model against the data that nine flights of ten keep, by response."""
    several = [known.model_errors for each in members if (known := _known(each)) is not None]
    names = set(several[0]).intersection(*several) if several else set()
    found = {}
    for name in sorted(names):
        bounds = [ModelErrorBound.from_dict(errors[name]) for errors in several]
        low, high = _common([(b.omega_rad_s[0], b.omega_rad_s[-1]) for b in bounds], name)
        first = bounds[0].omega_rad_s
        omega = first[(first >= low) & (first <= high)]
        if len(omega) > 1:
            each = [np.interp(np.log(omega), np.log(b.omega_rad_s), b.bound) for b in bounds]
            found[name] = ModelErrorBound(omega, np.quantile(each, UPPER, axis=0))
    return found


def _evidence(members: Sequence[object]) -> Evidence:
    """The worst of every check, over the flights."""
    several = [examined for each in members if (examined := evidence_behind(each)) is not None]
    checks = []
    for name in NAMES:
        found = [check for each in several if (check := each.check(name)) is not None]
        if found:
            checks.append(_worst_check(found, len(several)))
    required = dict.fromkeys(name for each in several for name in each.required)
    return Evidence(tuple(checks), tuple(required))


def _worst_check(found: Sequence[Check], flights: int) -> Check:
    worst = min(found, key=lambda check: ORDER.index(check.light))
    bands = [check.band_rad_s for check in found if check.band_rad_s is not None]
    band = _common(bands, "excitation") if worst.name == BAND and bands else worst.band_rad_s
    text = f"the least of {flights} flights: {worst.what}" if flights > 1 else worst.what
    return replace(worst, what=text, band_rad_s=band)
