"""Noise spectrum of the outputs: what the inputs do not explain, without leakage."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from flightid.errors import DataError
from flightid.responses.local_fit import Bins, bins_needed, fit_locally
from flightid.responses.samples import Samples

BEYOND_BAND = 1.5
"""Noise is estimated up to this multiple of the highest frequency of the response."""


@dataclass(frozen=True)
class NoiseSpectrum:
    """One-sided noise spectra of the outputs on a grid of their own.

    Attributes
    ----------
    omega_rad_s : ndarray, shape (n,)
    density : ndarray, shape (n_out, n)
        unit² per Hz, positive.
    """

    omega_rad_s: NDArray[np.float64]
    density: NDArray[np.float64]

    def at(self, omega_rad_s: NDArray[np.float64]) -> NDArray[np.float64]:
        """Density between the grid's frequencies, log-linear; held beyond its ends."""
        logs = np.log(np.maximum(self.density, np.finfo(float).tiny))
        return np.exp([np.interp(omega_rad_s, self.omega_rad_s, row) for row in logs])


def estimate_noise(
    samples: Samples, omega: NDArray[np.float64], response: NDArray[np.complex128]
) -> NoiseSpectrum:
    """Noise spectra from local polynomial fits on neighbouring groups of bins.

    With excitations, outputs and inputs are both fitted on them and the noise of ``y − H u`` is
    formed from their joint residual: fitting y on u would absorb what the loop feeds back.

    Parameters
    ----------
    samples : Samples
    omega : ndarray, shape (n_f,)
        Frequencies of `response`, rad/s.
    response : ndarray of complex, shape (n_out, n_in, n_f)
        Needed with excitations only.

    Returns
    -------
    NoiseSpectrum

    Raises
    ------
    DataError
        The records hold too few samples.

    Notes
    -----
    What remains of leakage is the part of third degree over a group of bins; a mode whose bandwidth
    is below a few bins of the record still raises the estimate there. Noise is taken to be
    stationary over all records.
    """
    joint = bool(samples.excitations)
    order = ("excitations", "inputs", "outputs") if joint else ("inputs", "outputs")
    rows = np.concatenate([np.arange(len(samples.records[0]))[samples.rows(k)] for k in order])
    n_regressors = len(samples.excitations if joint else samples.inputs)
    records = [Bins.of(record[rows], samples.sample_time_s) for record in samples.records]
    found = [
        (centre, _of_outputs(residual, joint, centre, omega, response))
        for centre, residual in _groups(records, n_regressors, float(omega[-1]))
    ]
    return NoiseSpectrum(np.array([one for one, _ in found]), np.array([d for _, d in found]).T)


def noise_of_residuals(
    residuals: Sequence[NDArray[np.float64]],
    regressors: Sequence[NDArray[np.float64]],
    sample_time_s: float,
    highest_rad_s: float,
) -> NoiseSpectrum:
    """Noise spectra from what a model leaves of the outputs.

    A model takes out the motion whose leakage no local polynomial follows: modes narrower than a
    few bins, and vehicles that only a loop holds. What the regressors still explain, the model's
    own errors, is fitted locally and counts as no noise.

    Parameters
    ----------
    residuals : sequence of ndarray, each shape (n_out, n_samples)
        Measured less modelled outputs of each record.
    regressors : sequence of ndarray, each shape (n_regressors, n_samples)
        Inputs, or excitations of a closed loop.
    sample_time_s : float
    highest_rad_s : float
        Highest frequency of the response.

    Returns
    -------
    NoiseSpectrum
    """
    records = [
        Bins.of(np.concatenate([given, left]), sample_time_s)
        for given, left in zip(regressors, residuals, strict=True)
    ]
    found = list(_groups(records, len(regressors[0]), highest_rad_s))
    densities = [np.real(np.diag(residual)) for _, residual in found]
    return NoiseSpectrum(np.array([centre for centre, _ in found]), np.array(densities).T)


def _groups(
    records: Sequence[Bins], n_regressors: int, highest_rad_s: float
) -> Iterator[tuple[float, NDArray[np.complex128]]]:
    """Centre of each group of neighbouring bins, and the residual of its local fit."""
    count = bins_needed(n_regressors, len(records))
    size = min(len(bins.omega) for bins in records)
    if size < count:
        raise DataError(
            "the records are too short for a noise spectrum",
            found=f"{size} Fourier bins",
            needed=f"{count}",
            action="use longer records, or covariance=False",
        )
    at_longest = int(np.argmax([len(bins.omega) for bins in records]))
    longest = records[at_longest]
    # A window's side lobes beyond this are far below its main lobe; the last density is held there.
    stride = max(count, len(longest.omega) * count // size)
    edges = np.append(longest.omega[::stride], np.inf)
    inside_band = int(np.searchsorted(edges, BEYOND_BAND * highest_rad_s))
    edges = edges[: max(inside_band + 1, 2)]
    for low, high in pairwise(edges):
        places = [
            slice(*np.searchsorted(bins.omega, [low * (1 - 1e-12), high * (1 - 1e-12)]))
            for bins in records
        ]
        if sum(place.stop - place.start for place in places) < 0.9 * count * len(records):
            continue
        inside = longest.omega[places[at_longest]]
        centre = float(0.5 * (inside[0] + inside[-1]))
        yield centre, fit_locally(records, places, centre, n_regressors).residual


def _of_outputs(
    residual: NDArray[np.complex128],
    joint: bool,
    centre: float,
    omega: NDArray[np.float64],
    response: NDArray[np.complex128],
) -> NDArray[np.float64]:
    if not joint:
        return np.real(np.diag(residual))
    n_out = response.shape[0]
    nearest = int(np.argmin(np.abs(omega - centre)))
    combine = np.concatenate([-response[:, :, nearest], np.eye(n_out)], axis=1)
    # residual has its conjugate on the first index.
    density = np.real(np.einsum("oa,ab,ob->o", combine.conj(), residual, combine))
    return np.asarray(np.maximum(density, 0.0))
