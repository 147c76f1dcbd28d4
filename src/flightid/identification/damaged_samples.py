"""Fits to samples that were not measured, or not in their unit: no interval holds the vehicle."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from flightid.conventions import Light
from flightid.evidence.copied_samples import COPIED
from flightid.evidence.data_checks import sample_findings
from flightid.identification.fit import Fit
from flightid.identification.innovation_tests import INPUTS_IN_ERRORS
from flightid.identification.withheld_intervals import without_intervals
from flightid.record import Record
from flightid.responses import FrequencyResponse

SYSTEMATIC = frozenset({"flat", "clipped", "units-swapped", "wrapped", COPIED})
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
    channels = (*fit.model.inputs, *fit.model.outputs)
    known = [each for each in data if isinstance(each, Record | FrequencyResponse)]
    every = sample_findings(known, channels)
    copied = next((each for each in every if each.code == COPIED), None)
    if copied is not None:
        return without_intervals(_untested(fit), copied.message)
    if fit.covariance is None:
        return fit
    for found in every:
        if found.light is Light.RED and found.code in SYSTEMATIC:
            return without_intervals(fit, found.message)
    return fit


def _untested(fit: Fit) -> Fit:
    """The fit without tests of its errors: chance counts samples, and these were counted twice."""
    said = {each.message for each in fit.findings if each.code == INPUTS_IN_ERRORS}
    parameters = {
        name: replace(each, reason="") if each.reason in said else each
        for name, each in fit.parameters.items()
    }
    return replace(
        fit,
        parameters=parameters,
        findings=tuple(each for each in fit.findings if each.code != INPUTS_IN_ERRORS),
        input_correlations=(),
    )
