"""Fits to samples that were not measured, or not in their unit: no interval holds the vehicle."""

from __future__ import annotations

from collections.abc import Sequence

from flightid.conventions import Light
from flightid.evidence.data_checks import sample_findings
from flightid.identification.fit import Fit
from flightid.identification.withheld_intervals import without_intervals
from flightid.record import Record
from flightid.responses import FrequencyResponse

SYSTEMATIC = frozenset({"flat", "clipped", "units-swapped", "wrapped"})
"""Faults of samples that are no noise: bars are of noise. Spikes are, and make bars longer."""


def with_damage_judged(fit: Fit, data: Sequence[object]) -> Fit:
    """The fit without intervals where its samples are red for what is no noise.

    Parameters
    ----------
    fit : Fit
    data : sequence of Record and FrequencyResponse
        What it was made from.

    Returns
    -------
    Fit
        Its evidence says what was found, and what to do.
    """
    if fit.covariance is None:
        return fit
    channels = (*fit.model.inputs, *fit.model.outputs)
    known = [each for each in data if isinstance(each, Record | FrequencyResponse)]
    for found in sample_findings(known, channels):
        if found.light is Light.RED and found.code in SYSTEMATIC:
            return without_intervals(fit, found.message)
    return fit
