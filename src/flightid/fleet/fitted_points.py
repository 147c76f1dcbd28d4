"""Points of responses that a fit used, as a catalogue keeps them for a joint fit of a type."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from flightid.errors import FlightidError
from flightid.identification import Fit
from flightid.identification.frequency_domain.estimator_bias import Correction
from flightid.responses import FrequencyResponse
from flightid.units import DIMENSIONLESS


def response_rows(fit: Fit, data: FrequencyResponse | None) -> Iterator[dict[str, Any]]:
    """One row a fitted response: what was measured, without what the estimator adds to it.

    Parameters
    ----------
    fit : Fit
    data : FrequencyResponse or None
        What was fitted. None, or a fit of records: no row.

    Yields
    ------
    dict
        Columns of the table ``responses`` but those that all rows of a model have.
    """
    if data is None or not fit.responses:
        return
    clean = _without_bias(fit, data)
    for each in fit.responses:
        pair = clean.pair(each.measured.output, each.measured.input)
        at = np.searchsorted(pair.omega_rad_s, each.omega_rad_s).clip(0, len(pair.omega_rad_s) - 1)
        values, errors = pair.response[at], pair.random_error[at]
        if not (np.all(np.isfinite(values)) and np.all(np.isfinite(errors)) and errors.min() > 0.0):
            continue
        yield {
            "output": pair.output,
            "input": pair.input,
            "unit": data.units.get(pair.output, DIMENSIONLESS),
            "omega_rad_s": pair.omega_rad_s[at].tolist(),
            "real": values.real.tolist(),
            "imag": values.imag.tolist(),
            "random_error": errors.tolist(),
        }


def _without_bias(fit: Fit, data: FrequencyResponse) -> FrequencyResponse:
    """The response that the fit, its bias corrected, was made of."""
    taken = fit.provenance.get("estimator_bias")
    if not isinstance(taken, dict) or not taken.get("applied"):
        return data
    try:
        return Correction(data, str(taken["hold"])).apply(fit.model)
    except FlightidError:
        return data
