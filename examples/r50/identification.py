"""From the records alone to a reduced model: responses, what their coherence allows, the fit."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from flights import INPUTS, LIBRARY, Plan

import flightid as fid
from flightid.identification import Reduction

OUTPUTS = ("um", "vm", "w", "p", "q", "r", "ax", "ay", "az")
MINIMUM_COHERENCE = 0.6
SMALLEST_RATIO = 2.0
"""A response is used where its coherent band is at least an octave wide."""

# What an engineer writes down before the first fit, for hover and cruise alike: the signs that the
# physics demands and round numbers.
FIRST_GUESS = {
    **{"tau_f": 0.05, "tau_s": 0.3, "hcg": -0.2, "Lb": 120.0, "Ma": 120.0},
    **{"Xu": -0.1, "Yv": -0.1, "Lu": -0.1, "Lv": 0.1, "Mu": -0.1, "Mv": -0.1},
    **{"Lw": -0.1, "Mw": 0.1, "Nv": 0.1, "Nw": 0.1, "Np": -1.0, "Nr": -3.0, "Kr": 1.0},
    **{"Ba": 0.3, "Ab": -0.3, "Bd": 0.5, "Ac": 0.5, "Zb": -50.0, "Za": -50.0},
    **{"Zw": -1.0, "Zr": 1.0, "Zcol": -30.0, "Ncol": -1.0, "Mcol": 3.0, "Yped": 3.0},
    **{"Blat": 0.1, "Blon": 0.01, "Alat": 0.01, "Alon": -0.1, "Nped": 20.0},
    **{"Dlat": 0.2, "Clon": -0.2, "tau_ped": 0.05},
}


@dataclass(frozen=True)
class Identified:
    """What the records of one flight condition gave.

    Attributes
    ----------
    response : FrequencyResponse
    fit : Fit
        Without what the data do not determine where `reduction` is there.
    reduction : Reduction or None
        Its path.
    """

    response: fid.FrequencyResponse
    fit: fid.Fit
    reduction: Reduction | None = None


def estimate(plan: Plan, records: Sequence[fid.Record]) -> fid.FrequencyResponse:
    """Estimate the responses with the logged sweeps as instrument, for a pilot closes the loop."""
    longest = 25.0 if plan.condition == "hover" else 20.0
    return fid.estimate_response(
        records,
        inputs=INPUTS,
        outputs=OUTPUTS,
        excitations=[f"sweep_{name}" for name in INPUTS],
        estimator="instrument",
        window_s=(longest, longest / 2.0, longest / 5.0),
        band_rad_s=(4.0 * np.pi / longest, 26.0),
        n_omega=36,
    )


def usable(response: fid.FrequencyResponse) -> list[str]:
    """Names of the responses whose coherence holds over an octave or more."""
    found = []
    for output in response.outputs:
        for source in response.inputs:
            band = response.pair(output, source).usable_band(MINIMUM_COHERENCE)
            if band is not None and band[1] >= SMALLEST_RATIO * band[0]:
                found.append(f"{output}/{source}")
    return found


def identify(plan: Plan, response: fid.FrequencyResponse, *, reduced: bool) -> Identified:
    """Fit the thirteen-state structure from the first guess; drop what is not determined."""
    structure = fid.load_model(LIBRARY[plan.condition]).with_responses(*usable(response))
    guess = {p.name: FIRST_GUESS[p.name] for p in structure.parameters.free}
    fit = fid.identify(
        structure.with_values(guess),
        response,
        minimum_coherence=MINIMUM_COHERENCE,
        hold="first",
    )
    if not reduced:
        return Identified(response, fit)
    reduction = fid.reduce(fit, response)
    return Identified(response, reduction.fit, reduction)
