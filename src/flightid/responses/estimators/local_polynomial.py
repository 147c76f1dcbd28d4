"""The local polynomial method: no windows, no leakage of a record's ends, a noise covariance."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from flightid.errors import DataError
from flightid.record.history import Step
from flightid.responses.cautions import correlation_findings
from flightid.responses.errors.linear_estimate import LinearEstimate, LocalWeights
from flightid.responses.errors.local_errors import LocalErrors
from flightid.responses.errors.noise import NoiseSpectrum
from flightid.responses.estimators.conditioned import random_error
from flightid.responses.response import FrequencyResponse
from flightid.responses.windows.local_fit import Bins, LocalFit, around, bins_needed, fit_locally
from flightid.responses.windows.samples import Samples


def estimate_local_polynomial(
    samples: Samples, omega: NDArray[np.float64], step: Step, *, covariance: bool
) -> FrequencyResponse:
    """Responses by local polynomial fits, each centred at a requested frequency.

    The bins of a record lie where its length puts them; a fit takes those nearest to the requested
    frequency and evaluates its polynomial there, so nothing is interpolated afterwards.

    Raises
    ------
    DataError
        The records hold too few samples, or inputs that cannot be told apart.

    Reference
    ---------
    Pintelon & Schoukens, *System Identification: A Frequency Domain Approach*, 2nd ed., chapter 7.
    """
    records = [Bins.of(record, samples.sample_time_s) for record in samples.records]
    n_in = len(samples.inputs)
    count = bins_needed(n_in, len(records))
    size = min(len(bins.omega) for bins in records)
    if size < count:
        raise DataError(
            "the records are too short for local polynomials",
            found=f"{size} Fourier bins in the shortest",
            needed=f"{count}",
            action="leave the short record out",
        )
    fits = []
    for one in omega:
        places = [around(bins, one, count) for bins in records]
        fit = fit_locally(records, places, one, n_in)
        if not fit.full_rank:
            raise DataError(
                f"inputs {', '.join(samples.inputs)} cannot be told apart",
                found=f"linearly dependent bins around {one:.4g} rad/s",
                needed="inputs that move independently in the band",
                action="leave out an input, or narrow omega_rad_s",
            )
        fits.append(fit)
    return response_of_fits(samples, omega, records, fits, step, covariance)


def response_of_fits(
    samples: Samples,
    omega: NDArray[np.float64],
    records: Sequence[Bins],
    fits: Sequence[LocalFit],
    step: Step,
    covariance: bool,
    *,
    estimator: str = "local_polynomial",
    n_independent: float | None = None,
) -> FrequencyResponse:
    """The response of fits on bins of whole records, one at each frequency.

    `n_independent` counts independent measurements; default: the bins of a fit.
    """
    n_in = len(samples.inputs)
    response = np.array([fit.gain.T for fit in fits]).transpose(1, 2, 0)
    residuals = np.array([fit.residual for fit in fits])
    noise = np.real(np.einsum("fii->if", residuals))
    # Variance of a gain for unit noise: what conditioning on other inputs and leakage leave.
    spread = np.array([sum(np.sum(np.abs(w) ** 2, axis=1) for w in fit.weights) for fit in fits]).T
    n_bins = np.array([n_independent or fit.n_bins for fit in fits], dtype=np.float64)
    unexplained = n_bins * spread[None] * noise[:, None]
    power = np.abs(response) ** 2
    coherence = power / np.maximum(power + unexplained, np.finfo(float).tiny)
    spectrum = _mean_spectra(records, fits)
    outputs = np.real(np.einsum("iif->if", spectrum[n_in:, n_in:]))
    multiple = 1.0 - noise / np.maximum(outputs, np.finfo(float).tiny)
    independent = np.broadcast_to(n_bins, response.shape)
    spectrum_of_noise = NoiseSpectrum.of_matrices(omega, residuals)
    weights = LocalWeights(tuple(fits), samples.sample_time_s, spectrum_of_noise)
    return FrequencyResponse(
        omega_rad_s=omega,
        inputs=samples.inputs,
        outputs=samples.outputs,
        units=samples.units,
        response=response,
        coherence=coherence,
        multiple_coherence=np.clip(multiple, 0.0, 1.0),
        random_error=random_error(coherence, independent, 1),
        n_independent=independent,
        input_spectrum=spectrum[:n_in, :n_in],
        cross_spectrum=spectrum[:n_in, n_in:].transpose(1, 0, 2),
        output_spectrum=outputs,
        estimator=estimator,
        findings=tuple(correlation_findings(samples.inputs, spectrum[:n_in, :n_in])),
        history=(*samples.history, step),
        errors=LocalErrors(tuple(fits), spectrum_of_noise) if covariance else None,
        linear=LinearEstimate.of(samples, weights, omega) if covariance else None,
    )


def _mean_spectra(records: Sequence[Bins], fits: Sequence[LocalFit]) -> NDArray[np.complex128]:
    found = []
    for fit in fits:
        values = np.concatenate(
            [bins.values[:, place] for bins, place in zip(records, fit.places, strict=True)], axis=1
        )
        found.append(values.conj() @ values.T / values.shape[1])
    return np.array(found).transpose(1, 2, 0)
