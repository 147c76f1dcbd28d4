"""The AH-64 study: sweeps of an unstable helicopter to a verified six-degree-of-freedom model.

Run: python examples/ah64/identify.py [--short] [--seed 1] [--output ah64-output]
"""

from __future__ import annotations

import argparse
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from augmentation import Augmented, augment, tables_of
from flights import INPUTS, OUTPUTS, fly_manoeuvres, fly_sweeps, truth
from report import write
from structures import SUPERFLUOUS, candidate, linearised_full_envelope

import flightid as fid
from flightid.responses import CoherentPairs

HEAVE = Path(__file__).with_name("heave.toml")
HEAVE_KEPT = ("Zw", "tau_lead", "tau_lag")
"""Kept through the reduction: the fit of heave alone determines them."""
INFLOW_OFF = 0.05
BEFORE_RAD_S, AFTER_RAD_S = (0.2, 10.0), (0.2, 25.0)


@dataclass(frozen=True)
class Results:
    """What the study found.

    Attributes
    ----------
    response : FrequencyResponse
        All 32 responses, and w to collective.
    coherent : CoherentPairs
        Which of the 32 are fitted.
    heave : mapping of str to Fit
        Heave before and after the inflow.
    reduction : Reduction
        From the candidate to the structure that the data determine.
    fit : Fit
        Six degrees of freedom and inflow.
    comparison : Comparison
        Against the stand-in of the linearised full-envelope model.
    augmented : Augmented
        The vehicle with an augmentation of limited authority.
    """

    response: fid.FrequencyResponse
    coherent: CoherentPairs
    heave: dict[str, fid.Fit]
    reduction: fid.Reduction
    fit: fid.Fit
    comparison: fid.Comparison
    augmented: Augmented


def main() -> None:
    """Run the study and write its report."""
    given = argparse.ArgumentParser(description=__doc__)
    given.add_argument("--short", action="store_true", help="one shorter sweep of each stick")
    given.add_argument("--seed", type=int, default=1)
    given.add_argument("--output", type=Path, default=Path("ah64-output"))
    options = given.parse_args()
    found = study(options.seed, short=options.short)
    print(found.coherent.summary())
    for name, fit in found.heave.items():
        print(f"heave {name}: {fit}")
    print(found.reduction.summary())
    print(found.fit.summary())
    inside, count = inside_of(found.fit)
    print(f"truth inside the 95 % interval: {inside} of {count}")
    print(found.comparison.summary())
    for table in tables_of(found.augmented):
        print(table)
    print(f"wrote {write(found, options.output)}")


def study(seed: int, *, short: bool = False) -> Results:
    """Fly, estimate, fit, reduce, verify.

    Parameters
    ----------
    seed : int
        Seed of the flights and of the start values.
    short : bool
        One sweep of each stick and fewer frequencies.

    Returns
    -------
    Results
    """
    response, coherent, heave, reduction, fit = identified(seed, short=short)
    assert isinstance(fit.model, fid.StateSpaceModel)
    comparison = fid.verify(
        [fit, linearised_full_envelope().with_responses(*coherent.names)],
        fly_manoeuvres(seed),
        names=["identified", "full-envelope"],
        initial_state="estimate",
        outputs=OUTPUTS,
        responses=response,
    )
    return Results(response, coherent, heave, reduction, fit, comparison, augment(fit))


def identified(
    seed: int, *, short: bool = False
) -> tuple[fid.FrequencyResponse, CoherentPairs, dict[str, fid.Fit], fid.Reduction, fid.Fit]:
    """Fly, estimate, fit and reduce: what comes before any use of the model."""
    flown = fly_sweeps(seed, repeats=1, duration_s=120.0) if short else fly_sweeps(seed)
    response = _estimate(flown, 24 if short else 40)
    coherent = fid.coherent_pairs(response.select(outputs=OUTPUTS))
    heave = {
        "before inflow": fid.identify(
            _heave().with_fixed(tau_lead=INFLOW_OFF, tau_lag=INFLOW_OFF),
            response,
            band_rad_s=BEFORE_RAD_S,
        ),
        "after inflow": fid.identify(_heave(), response, band_rad_s=AFTER_RAD_S),
    }
    start = candidate(seed).with_responses(*coherent.names)
    start = start.with_values({p: heave["after inflow"].parameters[p].value for p in HEAVE_KEPT})
    # The path of the reduction needs neither intervals nor corrections: the last fit has both.
    plain = replace(response, errors=None, linear=None)
    rough = fid.identify(start, plain, band_rad_s=coherent.bands, correct_bias=False)
    reduction = fid.reduce(
        rough, plain, keep=HEAVE_KEPT, maximum_cost_rise_percent=5.0, after_rise="next"
    )
    fit = fid.identify(reduction.fit.model, response, band_rad_s=coherent.bands)
    return response, coherent, heave, reduction, fit


def _heave() -> fid.StateSpaceModel:
    model = fid.load_model(HEAVE)
    assert isinstance(model, fid.StateSpaceModel)
    return model.with_responses("az/col")


def _estimate(flown: list[fid.Record], n_frequencies: int) -> fid.FrequencyResponse:
    # The pilot closes loops around the vehicle, so the sweeps are instruments.
    return fid.estimate_response(
        flown,
        inputs=INPUTS,
        outputs=(*OUTPUTS, "w"),
        excitations=[f"sweep_{name}" for name in INPUTS],
        estimator="instrument",
        omega_rad_s=np.geomspace(*AFTER_RAD_S, n_frequencies),
    )


def inside_of(fit: fid.Fit) -> tuple[int, int]:
    """How many true values lie inside their 95 % intervals, and of how many."""
    known = truth().parameters
    inside = count = 0
    for name, parameter in fit.parameters.items():
        if parameter.interval95 is None:
            continue
        low, high = parameter.interval95
        right = 0.0 if name in SUPERFLUOUS else known[name].value or 0.0
        inside += low <= right <= high
        count += 1
    return inside, count


if __name__ == "__main__":
    main()
