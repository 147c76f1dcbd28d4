"""Windowed estimates: direct or with an excitation as instrument, one or several window lengths."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from flightid.frozen import dataclass
from flightid.record.history import Step
from flightid.responses.cautions import band_findings, correlation_findings
from flightid.responses.errors.covariance import WindowedErrors
from flightid.responses.errors.noise import NoiseOfRecords, require_bins
from flightid.responses.estimators.composite import Composite, combine
from flightid.responses.estimators.conditioned import ConditionalSpectra, condition, random_error
from flightid.responses.estimators.instrument import condition_on_excitation, excitation_projection
from flightid.responses.response import FrequencyResponse
from flightid.responses.spectra import Spectra, average_spectra
from flightid.responses.windows.halving import Halves
from flightid.responses.windows.kept_bases import basis_of
from flightid.responses.windows.planning import valid_windows
from flightid.responses.windows.samples import Samples
from flightid.responses.windows.transform import HANN_POWER, WindowPlan
from flightid.responses.windows.window_weights import WindowShare, WindowWeights


@dataclass(frozen=True)
class WindowedEstimate:
    """A windowed estimate in the making.

    Attributes
    ----------
    samples : Samples
    omega : ndarray, shape (n_f,)
        rad/s.
    spectra : list of Spectra
        One for each window length, longest first.
    parts : list of ConditionalSpectra
    composite : Composite
    """

    samples: Samples
    omega: NDArray[np.float64]
    detrend: str
    spectra: list[Spectra]
    parts: list[ConditionalSpectra]
    composite: Composite


def estimate_windowed(
    samples: Samples, omega: NDArray[np.float64], plans: Sequence[WindowPlan], detrend: str
) -> WindowedEstimate:
    """Spectra, conditioning and composite; with excitations in `samples`, by instrument."""
    spectra, parts = [], []
    n_in, halves = len(samples.inputs), [Halves(rows) for rows in samples.records]
    for plan in plans:
        basis = basis_of(plan, omega * samples.sample_time_s, detrend)
        one = average_spectra(halves, basis, samples.sample_time_s)
        spectra.append(one)
        if samples.excitations:
            part = condition_on_excitation(one, n_in, len(samples.outputs), omega, samples)
        else:
            part = condition(one, n_in, omega, samples.inputs)
        parts.append(part)
    valid = valid_windows(plans, omega, samples.sample_time_s)
    return WindowedEstimate(samples, omega, detrend, spectra, parts, combine(parts, valid))


def windowed_errors(estimate: WindowedEstimate) -> WindowedErrors:
    """What the covariance of a windowed estimate is made from.

    Raises
    ------
    DataError
        The records are too short for a noise spectrum.
    """
    samples = estimate.samples
    require_bins(samples)
    shares = []
    for one, part in zip(estimate.spectra, estimate.parts, strict=True):
        scale = 2.0 * samples.sample_time_s / (HANN_POWER * one.plan.length * one.n_windows)
        projection = part.inverse
        if samples.excitations:
            projection = part.inverse @ excitation_projection(one, samples)
        shares.append(WindowShare(one.plan, scale * projection))
    kind = "excitations" if samples.excitations else "inputs"
    windows = WindowWeights(
        tuple(samples.part(kind)),
        estimate.omega * samples.sample_time_s,
        estimate.detrend,
        tuple(shares),
    )
    composite = estimate.composite
    noise = NoiseOfRecords(samples, estimate.omega, composite.response)
    return WindowedErrors(windows, samples.sample_time_s, composite, noise)


def windowed_response(estimate: WindowedEstimate, estimator: str, step: Step) -> FrequencyResponse:
    """The frequency response without its covariance."""
    samples, composite = estimate.samples, estimate.composite
    n_in, n_out = len(samples.inputs), len(samples.outputs)
    # Spectra are the means over window lengths with each length's weight, averaged over pairs.
    share = composite.weights.mean(axis=(1, 2))
    matrices = np.array([one.matrix for one in estimate.spectra])
    spectrum = np.einsum("wf,wfab->abf", share, matrices)
    multiple = np.array([part.multiple for part in estimate.parts])
    plans = [one.plan for one in estimate.spectra]
    window_s = tuple(plan.length * samples.sample_time_s for plan in plans)
    outputs = slice(n_in, n_in + n_out)
    return FrequencyResponse(
        omega_rad_s=estimate.omega,
        inputs=samples.inputs,
        outputs=samples.outputs,
        units={name: samples.units[name] for name in samples.inputs + samples.outputs},
        response=composite.response,
        coherence=composite.coherence,
        multiple_coherence=np.clip(
            np.einsum("wof,wof->of", composite.weights.mean(axis=2), multiple), 0.0, 1.0
        ),
        random_error=random_error(composite.coherence, composite.n_independent, plans[0].shifts),
        n_independent=composite.n_independent,
        input_spectrum=spectrum[:n_in, :n_in],
        cross_spectrum=spectrum[:n_in, outputs].transpose(1, 0, 2),
        output_spectrum=np.real(np.einsum("iif->if", spectrum[outputs, outputs])),
        n_windows=tuple(one.n_windows for one in estimate.spectra),
        window_s=window_s,
        estimator=estimator,
        findings=(
            *band_findings(estimate.omega, window_s[0], samples.sample_time_s),
            *correlation_findings(samples.inputs, spectrum[:n_in, :n_in]),
        ),
        history=(*samples.history, step),
    )
