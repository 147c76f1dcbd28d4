"""A response with the bias of its estimator taken out, as far as a pilot model foretells it."""

from __future__ import annotations

from dataclasses import replace

from flightid.errors import DataError
from flightid.responses.corrected import corrected
from flightid.responses.errors.random_error import StoredCovariance
from flightid.responses.response import FrequencyResponse
from flightid.responses.shown import WITHOUT_BIAS


def without_bias(source: FrequencyResponse) -> FrequencyResponse:
    """The response less what leakage and resolution add to it, with the errors of what remains.

    A pilot model (`flightid.responses.errors.pilot`) is put through the estimator's own weights on
    the measured inputs; what comes out less its own response is the bias. To first order the error
    of the difference has the covariance ``C − E P Eᵀ + G P Gᵀ``: C that of the estimate, P that of
    the pilot's coefficients, G the slopes of its response and E those of what the estimator makes
    of it.

    Parameters
    ----------
    source : FrequencyResponse

    Raises
    ------
    DataError
        The response is no longer linear in measured outputs (after arithmetic, from a file, given),
        has no errors, or its records hold too few bins.

    Assumes
    -------
    A pilot that comes near the vehicle: of what it misses, only what the estimator blurs remains,
    a bias of second order. It may be `SURER` times as sure as the bins beside a frequency, with
    their own leakage free, are by themselves: where inputs have no power but that of a record's
    ends it would be sure of what it assumes.

    Reference
    ---------
    Pintelon & Schoukens, *System Identification: A Frequency Domain Approach*, 2nd ed., sections
    2.6 (leakage), 6.7 (transients); the covariance: Rasmussen & Williams, *Gaussian Processes for
    Machine Learning* (2006), equation 2.41, for a prior without weight.

    Example
    -------
    >>> import numpy as np, flightid as fid
    >>> u = np.random.default_rng(0).standard_normal(4000)
    >>> record = fid.Record.from_arrays(np.arange(4000) / 100, inputs={"u": u},
    ...                                 outputs={"y": np.convolve(u, [0.5, 0.5])[:4000]})
    >>> without_bias(fid.estimate_response(record, band_rad_s=(2.0, 50.0), n_omega=20)).estimator
    'composite, without leakage'
    """
    found = unbiased(source)
    if found is None:
        raise DataError(
            "the bias of this response cannot be foretold",
            found=f"estimator {source.estimator!r}, {source.n_frequencies} frequencies",
            needed="a response as `estimate_response` gives it, with covariance=True",
            action="take the bias out before arithmetic, or read a model fitted to the response",
        )
    return found


def unbiased(response: FrequencyResponse, *, refined: bool = False) -> FrequencyResponse | None:
    """As `without_bias`, or None where that cannot be had.

    `refined` adds frequencies where the response turns too fast for straight lines between
    neighbours, as at a light mode: there the pilot is known, and what it leaves is interpolated.
    """
    linear = response.linear
    if linear is None or response.errors is None:
        return None
    found = corrected(linear, response.omega_rad_s, refined=refined)
    if found is None:
        return None
    kept = {
        name: getattr(response, name) @ found.spread
        for name in ("multiple_coherence", "n_independent")
    }
    if refined:  # no window had these frequencies
        kept |= dict.fromkeys(("input_spectrum", "cross_spectrum", "output_spectrum"))
    return replace(
        response,
        **kept,
        omega_rad_s=found.omega_rad_s,
        response=found.values,
        coherence=found.coherence(response.coherence),
        random_error=found.relative,
        errors=StoredCovariance(found.errors[0], len(found.omega_rad_s)),
        linear=None,
        estimator=f"{response.estimator}, {WITHOUT_BIAS}",
    )
